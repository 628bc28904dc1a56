"""How much reconsidering routes under way is worth, and how often it moves tasks around."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from oath.bench.paper import random_maze
from oath.bench.study import Case, Row, Study
from oath.events import Allocated, AnyEvent, StopServed
from oath.model import Mission, Obstacle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GAINS = (0.0, 0.01, 0.05, 1.0)
"""Share of the objective that a switch must save; 1 never switches."""


GATES = tuple((x, y, x + width) for x, width in ((2, 2), (7, 1), (12, 2), (17, 1)) for y in (5, 15))
"""Passages of the maze as x from, y, x to [m]."""


def gated_maze(seed: int) -> Mission:
    """Twenty-five random tasks in the maze, four of whose passages turn out to be closed."""
    mission = random_maze(25, seed=seed)
    chosen = np.random.default_rng(seed).choice(len(GATES), 4, replace=False)
    gates = tuple(
        Obstacle(
            id=f"gate-{i}",
            kind="gate",
            polygon=((x0, y - 0.1), (x1, y - 0.1), (x1, y + 0.1), (x0, y + 0.1)),
            known=False,
        )
        for i in chosen.tolist()
        for x0, y, x1 in GATES[i : i + 1]
    )
    return replace(mission, map=replace(mission.map, obstacles=gates))


def moved_tasks(events: Sequence[AnyEvent]) -> int:
    """How often a round took a task that nobody had begun from one robot and gave it to another."""
    begun: set[str] = set()
    owners: list[dict[str, str]] = []
    for event in events:
        if isinstance(event, StopServed):
            begun.add(event.task)
        elif isinstance(event, Allocated):
            owners.append(
                {
                    stop.task: robot
                    for robot, route in event.routes.items()
                    for stop in route
                    if stop.task not in begun
                }
            )
    return sum(
        old[task] != new[task] for old, new in pairwise(owners) for task in old.keys() & new.keys()
    )


def measure(gain: float, seed: int) -> list[Row]:
    """One mission with one price on switching."""
    from oath.allocate import Budget
    from oath.allocate.lns import Lns, Params
    from oath.fleet.sim import SimFleet
    from oath.runtime import Runtime
    from oath.scene import prepare
    from oath.verify import verify

    mission = gated_maze(seed)
    result = Runtime(
        prepare(mission, seed=seed),
        SimFleet(mission),
        name="lns",
        allocator=Lns(Params(switch_gain=gain)),
        budget=Budget(),
        seed=seed,
    ).run()
    verdict = verify(mission, result.events)
    if not verdict.ok:
        raise RuntimeError(f"seed {seed}, gain {gain}: {verdict.violations[0]}")
    summary = result.summary
    return [
        {
            "gain": gain,
            "seed": seed,
            "completed": summary["completed"],
            "rounds": summary["rounds"],
            "moved": moved_tasks(result.events),
            "distance": summary["total_distance"],
            "makespan": summary["makespan"],
        }
    ]


def cases(quick: bool, seeds: int) -> list[Case]:
    """One mission per price and seed."""
    numbers = range(2 if quick else 2 * seeds)
    return [
        Case(f"{gain}-{seed}", {"gain": gain, "seed": seed}) for gain in GAINS for seed in numbers
    ]


def table(rows: Sequence[Row]) -> list[Row]:
    """Means by price."""
    out = []
    for gain in GAINS:
        some = [row for row in rows if row["gain"] == gain]
        means = {
            column: float(np.mean([row[column] for row in some]))
            for column in ("completed", "rounds", "moved", "distance", "makespan")
        }
        out.append(
            {
                "a switch must save": "never" if gain >= 1 else f"{gain:.0%}",
                "tasks done": means["completed"],
                "rounds": means["rounds"],
                "tasks moved": means["moved"],
                "distance [m]": means["distance"],
                "makespan [s]": means["makespan"],
                "sum + makespan": means["distance"] + means["makespan"],
            }
        )
    return out


def plot(rows: Sequence[Row]) -> Figure:
    """Objective against tasks moved."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot()
    marks = zip(table(rows), "osD^", ("#0072B2", "#D55E00", "#009E73", "#CC79A7"), strict=True)
    for row, marker, colour in marks:
        name = row["a switch must save"]
        label = "never switches" if name == "never" else f"must save {name}"
        axes.plot(row["tasks moved"], row["sum + makespan"], marker, color=colour, label=label)
    axes.set_xlabel("tasks moved from robot to robot per mission")
    axes.set_ylabel("distance [m] + makespan [s]")
    axes.legend()
    return figure


def finding(rows: Sequence[Row]) -> str:
    """What a price on switching costs and saves."""
    free, priced, *_, never = table(rows)
    saved = 1 - priced["sum + makespan"] / never["sum + makespan"]
    return (
        f"Reconsidering with a price of {priced['a switch must save']} moves "
        f"{priced['tasks moved']:.1f} tasks a mission instead of {free['tasks moved']:.1f}; "
        f"distance plus makespan is {saved:+.1%} better than without any switch "
        f"({free['sum + makespan'] / priced['sum + makespan'] - 1:+.1%} without a price)."
    )


STUDY = Study(
    name="churn",
    title="What reconsidering is worth, and how much it churns",
    asked="Routes under way are reconsidered when the map changes or a robot idles, and tasks move "
    "between robots only if that pays. How often do they, and what is it worth? 25 random tasks, 4 "
    "robots, four unknown closed passages.",
    paper="Tasks are allocated once per round and stay; nothing is published about changes.",
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
)
