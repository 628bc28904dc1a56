"""What an instruction does to a running mission, taken up at once or when the present work is done.

A new task, a new obstacle or another priority is told at several times of the paper's mission.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from oath.bench.churn import GATES
from oath.bench.figures import COLOURS
from oath.bench.methods import grouped, mean, sheet, tidy
from oath.bench.paper import maze
from oath.bench.study import Case, Row, Study
from oath.errors import BadInput
from oath.events import AnyEvent, MissionStarted, StopServed
from oath.model import Mission, Obstacle, Point

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from oath.commands import Command
    from oath.runtime import Runtime

KINDS = {"add_task": "new task", "obstacle": "new obstacle", "priority": "priority change"}
"""What is told, and how a table calls it."""

METHODS = {"waits": "taken up later", "oath": "OATH, live", "lns": "LNS, live"}
"""Whether it is taken up at once, and by whom."""

TIMES = (5.0, 15.0, 25.0, 35.0, 45.0)
"""When it is told [s]."""

STEP = 0.5
"""A command that is refused, for a robot stands there, is tried again so much later [s]."""


def closed_gate(seed: int) -> tuple[Point, Point]:
    """The passage that closes, from end to end [m]."""
    x0, y, x1 = GATES[int(np.random.default_rng(seed).integers(len(GATES)))]
    return (float(x0), float(y)), (float(x1), float(y))


def command(kind: str, seed: int, runtime: Runtime) -> Command:
    """What is told; the same for every method, as far as the mission still allows it."""
    from oath.commands import AddTask, ChangeTaskPriority, ObstacleUpdate, admit

    rng = np.random.default_rng(seed)
    if kind == "obstacle":
        return ObstacleUpdate(obstacle_location=list(closed_gate(seed)), obstacle_type="gate")
    state, mission = runtime.state, runtime.scene.mission
    if kind == "priority":
        order = rng.permutation(sorted(task.id for task in mission.tasks)).tolist()
        label = next(id for id in order if id in state.open_tasks())
        return ChangeTaskPriority(task_label=label, priority="high")
    while True:
        x, y = rng.uniform(0.5, 19.5, 2).round(1).tolist()
        told = AddTask(
            location=(x, y),
            delivery_point=str(rng.choice(sorted(mission.places))),
            task_type=str(rng.choice(sorted(mission.task_types))),
            task_label="new",
            priority="normal",
        )
        try:
            admit(runtime.live(), [told])
        except BadInput:
            continue  # in a wall
        return told


def measure(kind: str, at: float, seed: int) -> list[Row]:
    """One instruction to one mission, by every method."""
    return [_run(kind, at, seed, method) for method in METHODS]


def _run(kind: str, at: float, seed: int, method: str) -> Row:
    from oath.allocate import Budget, allocator
    from oath.fleet.sim import SimFleet
    from oath.runtime import Runtime
    from oath.scene import prepare
    from oath.verify import verify

    mission, name = maze(), "lns" if method == "lns" else "oath"
    if kind == "obstacle" and method == "waits":
        mission = _hidden(mission, seed)
    runtime = Runtime(
        prepare(mission, seed=seed),
        SimFleet(mission),
        name=name,
        allocator=allocator(name),
        budget=Budget(),
        seed=seed,
    )
    runtime.start()
    runtime.advance(at)
    task = _tell(runtime, kind, seed, later=method == "waits")
    runtime.advance()
    result = runtime.finish()
    verdict = verify(mission, result.events)
    if not verdict.ok or result.summary["unserved"]:
        raise RuntimeError(f"{kind} at {at} s, seed {seed}, {method}: {verdict.violations[:1]}")
    return {
        "kind": kind,
        "at": at,
        "seed": seed,
        "method": method,
        "steps": result.summary["total_steps"],
        "distance": result.summary["total_distance"],
        "makespan": result.summary["makespan"],
        "wait": _done(result.events, task) - at if task else None,
    }


def _hidden(mission: Mission, seed: int) -> Mission:
    """The mission with the gate there from the start, for the robots' own sensors to find."""
    from oath.commands import ObstacleUpdate

    gate = ObstacleUpdate(obstacle_location=list(closed_gate(seed)), obstacle_type="gate")
    polygon = gate.polygon(mission.map.wall_thickness)
    unknown = Obstacle(id="gate-1", kind="gate", polygon=polygon, known=False)
    return replace(mission, map=replace(mission.map, obstacles=(unknown,)))


def _tell(runtime: Runtime, kind: str, seed: int, *, later: bool) -> str | None:
    """Tell it as soon as it is possible; return the task that it is about."""
    from oath.commands import AddTask, ChangeTaskPriority

    told = command(kind, seed, runtime)
    if kind == "obstacle" and later:
        return None  # nobody tells: the robots find it
    if later:
        _until(runtime, _finished(runtime))
    while True:
        try:
            runtime.command([told], "study")
            break
        except BadInput:
            if kind != "obstacle":
                break  # the task was begun meanwhile: its turn has come
            runtime.advance(runtime.now + STEP)
    return told.task_label if isinstance(told, AddTask | ChangeTaskPriority) else None


def _finished(runtime: Runtime) -> Callable[[], bool]:
    """Whether everything is done that is assigned now."""
    assigned = {stop.task for robot in runtime.state.robots.values() for stop in robot.route}
    return lambda: assigned <= runtime.state.completed


def _until(runtime: Runtime, finished: Callable[[], bool]) -> None:
    while not finished():
        runtime.advance(runtime.now + STEP)


def _done(events: Sequence[AnyEvent], task: str) -> float:
    """When a task was done [s]."""
    served = (e for e in events if isinstance(e, StopServed | MissionStarted))
    return max(e.t for e in served if isinstance(e, StopServed) and e.task == task)


def cases(quick: bool, seeds: int) -> list[Case]:
    """One instruction per kind, time and seed."""
    times, numbers = TIMES[1::2] if quick else TIMES, range(1 if quick else seeds)
    return [
        Case(f"{kind}-{at:g}-{seed}", {"kind": kind, "at": at, "seed": seed})
        for kind in KINDS
        for at in times
        for seed in numbers
    ]


def table(rows: Sequence[Row]) -> list[Row]:
    """Means by what was told and how it was taken up."""
    out = []
    for (kind, method), some in grouped(rows, lambda row: (row["kind"], row["method"])).items():
        out.append(
            {
                "told": KINDS[kind],
                "taken up": METHODS[method],
                "runs": len(some),
                "steps": mean(some, "steps"),
                "distance [m]": mean(some, "distance"),
                "task done after [s]": mean(some, "wait"),
                "all done after [s]": mean(some, "makespan"),
            }
        )
    return out


def plot(rows: Sequence[Row]) -> Figure:
    """Steps as bars, and how long tasks and missions took as boxes."""
    figure = sheet(11, 7)
    parts = {"steps": "steps", "wait": "task done after [s]", "makespan": "all done after [s]"}
    grid = figure.subplots(len(parts), len(KINDS), squeeze=False, sharey="row")
    for down, (column, label) in enumerate(parts.items()):
        for along, (kind, title) in enumerate(KINDS.items()):
            axes = grid[down][along]
            some = [row for row in rows if row["kind"] == kind and row[column] is not None]
            tidy(axes, "", label if along == 0 else "", title if down == 0 else "")
            if not some:
                axes.set_axis_off()
                continue
            groups = [[row[column] for row in some if row["method"] == m] for m in METHODS]
            if column == "steps":
                means, spread = [np.mean(g) for g in groups], [np.std(g) for g in groups]
                axes.bar(
                    range(len(groups)), means, yerr=spread, capsize=4, color=COLOURS[: len(groups)]
                )
            else:
                boxes = axes.boxplot(
                    groups, positions=range(len(groups)), widths=0.6, patch_artist=True
                )
                for box, colour in zip(boxes["boxes"], COLOURS, strict=False):
                    box.set_facecolor(colour)
                for middle in boxes["medians"]:
                    middle.set_color("black")
            axes.set_xticks(range(len(METHODS)), list(METHODS.values()), fontsize=8)
    return figure


def finding(rows: Sequence[Row]) -> str:
    """What taking an instruction up at once is worth."""
    means = {(row["told"], row["taken up"]): row for row in table(rows)}

    def values(kind: str, column: str) -> str:
        later, oath, lns = (means[KINDS[kind], how][column] for how in METHODS.values())
        return f"{later:.0f}, {oath:.0f} and {lns:.0f}"

    wait, end = "task done after [s]", "all done after [s]"
    return (
        "Taken up when the present work is done, at once by OATH, and at once by LNS: a new task "
        f"is done after {values('add_task', wait)} s, one whose priority is raised after "
        f"{values('priority', wait)} s. Missions take {values('add_task', 'steps')} steps and "
        f"{values('add_task', end)} s with a new task, {values('priority', 'steps')} steps and "
        f"{values('priority', end)} s with a priority change, and where a passage is closed "
        f"{values('obstacle', 'steps')} steps and {values('obstacle', end)} s. Part of what LNS "
        "gains it gains without instructions."
    )


STUDY = Study(
    name="instructions",
    title="What instructions do to a running mission",
    asked="A task, an obstacle or a priority is told in the middle of the mission (25 tasks, 4 "
    "robots, five times, as many seeds). What is it worth to take it up at once, while robots "
    "drive? The baseline takes it up when all that is assigned at that time is done, and finds the "
    "closed passage, which is there from the start, by its robots' own sensors.",
    paper="Shows steps and times of its method against a built-in baseline for the same three "
    "instructions, as bars and boxes without numbers to compare with.",
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
)
