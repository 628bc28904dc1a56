"""How long it takes from words to a command, and from a confirmed command to new routes."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from oath.bench.figures import COLOURS
from oath.bench.methods import grouped, sheet, tidy
from oath.bench.paper import maze
from oath.bench.study import Case, Row, Study
from oath.errors import BadInput
from oath.events import Allocated, AnyEvent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from oath.commands import Command, Live
    from oath.instruct import Interpreter
    from oath.runtime import Runtime

BUDGET = 0.05
"""The allocator may improve an answer for so long [s]."""

SAID = {
    "add_task": "There's a new special task at five and nineteen point five, take it to C.",
    "obstacle_update": "There is a wall from (7, 5) to (8, 5).",
    "change_task_priority": "Please make task bb the highest priority.",
    "cancel_task": "Cancel task bb.",
    "remove_obstacle": "The obstacle wall-1 is gone.",
    "pause_robot": "Pause robot2.",
    "resume_robot": "robot2 may go on.",
    "robot_failed": "robot2 has failed.",
    "query_status": "How far are we?",
    "undo": "Undo that.",
}
"""What is interpreted, by intent."""

REPEATS = 20
"""Every sentence is interpreted so often."""

PARTS = {
    "interpretation": "words to command",
    "repaired": "command to repaired plans",
    "update": "command to new routes",
}

PAPER = {"add_task": (1.0, 3.0), "obstacle_update": (0.01, 0.1)}
"""The paper's times of its updates [s], from and to."""


def measure(part: str, seed: int) -> list[Row]:
    """The times of one mission [ms]."""
    if part == "updates":
        return updates(seed)
    from oath.instruct.offline import Offline

    return interpretations(Offline, started(seed).live(), seed)


def started(seed: int, journal: Callable[[Sequence[AnyEvent]], None] = lambda _: None) -> Runtime:
    """The paper's mission with 25 tasks and 4 robots on 1000 points, just begun."""
    from oath.allocate import Budget, allocator
    from oath.fleet.sim import SimFleet
    from oath.runtime import Runtime
    from oath.scene import prepare

    mission = maze()
    runtime = Runtime(
        prepare(mission, seed=seed),
        SimFleet(mission),
        name="lns",
        allocator=allocator("lns"),
        budget=Budget(seconds=BUDGET),
        seed=seed,
        journal=journal,
    )
    runtime.start()
    return runtime


def interpretations(make: Callable[[], Interpreter], live: Live, seed: int) -> list[Row]:
    """How long any interpreter takes for every sentence, its first call included [ms]."""
    from oath.instruct import Dialogue

    interpreter, rows = make(), []
    for intent, words in SAID.items():
        for _ in range(REPEATS):
            begin = time.perf_counter()
            interpreter.interpret(Dialogue(said=(words,)), live)
            rows.append(_row(intent, "interpretation", begin, time.perf_counter(), seed))
    return rows


def updates(seed: int) -> list[Row]:
    """How long the mission takes to follow commands that come all the time, the gate included."""
    rng, rows = random.Random(seed), []
    told: list[tuple[float, AnyEvent]] = []

    def journal(events: Sequence[AnyEvent]) -> None:
        told.extend((time.perf_counter(), event) for event in events)

    runtime = started(seed, journal)
    for turn in range(100):
        runtime.advance(runtime.now + rng.uniform(0.1, 1.5))
        if not runtime.state.open_tasks():
            break
        command = _command(runtime, rng, turn)
        told.clear()
        begin = time.perf_counter()
        try:
            runtime.command([command], "study")
        except BadInput:
            continue  # in a wall, over a robot, ...
        end = time.perf_counter()
        rounds = [(t, e.seconds) for t, e in told if isinstance(e, Allocated)]
        # Plans are repaired before the allocator is asked; its own time stands in the log.
        repaired = min((t - seconds for t, seconds in rounds), default=end)
        rows.append(_row(command.intent, "update", begin, end, seed))
        if command.intent in ("obstacle_update", "remove_obstacle"):
            rows.append(_row(command.intent, "repaired", begin, repaired, seed))
    return rows


def _row(intent: str, part: str, begin: float, end: float, seed: int) -> Row:
    return {"intent": intent, "part": part, "seed": seed, "ms": (end - begin) * 1e3}


def _tenth(value: float) -> float:
    return round(value, 1)


def _command(runtime: Runtime, rng: random.Random, turn: int) -> Command:
    """One command after the other; obstacles twice as often."""
    from oath.commands import parse

    state, mission = runtime.state, runtime.scene.mission
    x, y = _tenth(rng.uniform(0.5, 19.5)), _tenth(rng.uniform(0.5, 19.5))
    task, robot = rng.choice(state.open_tasks()), rng.choice(list(state.robots))
    wall = [[x, y], [_tenth(x + rng.uniform(-1.5, 1.5)), _tenth(y + rng.uniform(-1.5, 1.5))]]
    where, types = rng.choice(sorted(mission.places)), sorted(mission.task_types)
    turns: list[tuple[str, dict[str, Any]]] = [
        ("obstacle_update", {"obstacle_location": wall}),
        (
            "add_task",
            {"location": [x, y], "delivery_point": where, "task_type": rng.choice(types)},
        ),
        ("change_task_priority", {"task_label": task}),
        ("obstacle_update", {"obstacle_location": wall}),
        ("pause_robot", {"robot": robot}),
        ("resume_robot", {"robot": "all"}),
        ("remove_obstacle", {"obstacle": next(iter(state.obstacles), "wall-1")}),
        ("cancel_task", {"task_label": task}),
        ("undo", {}),
    ]
    if turn == 30:
        return parse({"intent": "robot_failed", "parameters": {"robot": robot}})
    intent, parameters = turns[turn % len(turns)]
    return parse({"intent": intent, "parameters": parameters})


def cases(quick: bool, seeds: int) -> list[Case]:
    """Missions with commands, and words without."""
    numbers = range(1 if quick else seeds)
    keys = [("updates", seed) for seed in numbers] + [("interpretation", 0)]
    return [Case(f"{part}-{seed}", {"part": part, "seed": seed}) for part, seed in keys]


def table(rows: Sequence[Row]) -> list[Row]:
    """Percentiles by what was asked and which part of the answer."""
    out = []
    for part, label in PARTS.items():
        for intent in SAID:
            times = [r["ms"] for r in rows if (r["part"], r["intent"]) == (part, intent)]
            if times:
                out.append(
                    {
                        "part": label,
                        "intent": intent,
                        "calls": len(times),
                        "p50 [ms]": float(np.percentile(times, 50)),
                        "p95 [ms]": float(np.percentile(times, 95)),
                        "longest [ms]": max(times),
                    }
                )
    return out


def plot(rows: Sequence[Row]) -> Figure:
    """Boxes of the times by intent on a logarithmic scale, and the paper's times behind them."""
    figure = sheet(9, 4.5)
    axes = figure.subplots()
    tidy(axes, "", "time [ms]")
    axes.set_yscale("log")
    shown = list(PARTS)
    for place, intent in enumerate(SAID):
        if intent in PAPER:
            low, high = (1e3 * t for t in PAPER[intent])
            label = "the paper's update" if intent == "add_task" else None
            axes.fill_between([place - 0.45, place + 0.45], low, high, color="#DDDDDD", label=label)
    for (part, intent), some in grouped(rows, lambda r: (r["part"], r["intent"])).items():
        at = list(SAID).index(intent) + 0.28 * (shown.index(part) - 1)
        boxes = axes.boxplot(
            [[row["ms"] for row in some]],
            positions=[at],
            widths=0.24,
            patch_artist=True,
            showfliers=False,
            whis=(5, 95),
        )
        boxes["boxes"][0].set_facecolor(COLOURS[shown.index(part)])
        boxes["medians"][0].set_color("black")
    for part, label in PARTS.items():
        axes.bar([0], [0], color=COLOURS[shown.index(part)], label=label)
    axes.set_xticks(range(len(SAID)), list(SAID), rotation=25, ha="right")
    axes.set_xlim(-0.6, len(SAID) - 0.4)
    axes.legend(fontsize=8)
    return figure


def finding(rows: Sequence[Row]) -> str:
    """The times that matter, p95."""
    found = {(row["part"], row["intent"]): row["p95 [ms]"] for row in table(rows)}

    def p95(part: str, intent: str) -> str:
        value = found.get((PARTS[part], intent))
        return "not measured" if value is None else f"{value:.3g} ms"

    words = [ms for (part, _), ms in found.items() if part == PARTS["interpretation"]]
    told = f" Words are interpreted in {max(words):.3g} ms at most (p95)." if words else ""
    return (
        f"p95 from a confirmed command, the gate included: new routes after a new task in "
        f"{p95('update', 'add_task')} and after a priority change in "
        f"{p95('update', 'change_task_priority')}, of which LNS may search {BUDGET * 1e3:g} ms; "
        f"repaired plans after a new obstacle in {p95('repaired', 'obstacle_update')}.{told}"
    )


STUDY = Study(
    name="latency",
    title="How fast instructions take effect",
    asked="How long does it take to understand an instruction, and from the confirmed command to "
    "new routes of a running mission (25 tasks, 4 robots, 1000 points, 50 ms for LNS)?",
    paper="1 to 3 s to update routes for a new task, tens of ms for an obstacle; a language model "
    "interprets in seconds.",
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
    timed=True,
)
