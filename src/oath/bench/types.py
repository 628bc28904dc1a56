"""Assignments with two, three and five types of task."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from oath.allocate import Budget, allocator, plan_all
from oath.bench.methods import (
    INK,
    LOOKS,
    OURS,
    available,
    figures,
    grouped,
    listed,
    mean,
    posed,
    present,
    sheet,
)
from oath.bench.paper import MAP, maze, random_maze
from oath.bench.study import Case, Row, Study
from oath.model import Mission

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TYPES = (2, 3, 5)
TASKS = 25
OWN, DRAWN = "the paper's", "random"
DRAWN_FOR_THREE = 0
"""Seed of the placement that is shown for three types, for which there is no list of tasks."""

ROBOT_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
TYPE_MARKERS = ("o", "s", "^", "D", "P")


def cases(quick: bool, seeds: int) -> list[Case]:
    """The shown placement of each number of types, and random ones."""
    draws = min(seeds, 2) if quick else max(seeds, 10)
    shown = [(OWN, 2, 0), (DRAWN, 3, DRAWN_FOR_THREE), (OWN, 5, 0)]
    drawn = [(DRAWN, types, seed) for types in TYPES for seed in range(draws)]
    return [
        Case(
            key=f"{kind} {types} types seed={seed}",
            arguments={"kind": kind, "types": types, "seed": seed},
        )
        for kind, types, seed in dict.fromkeys(shown + drawn)
    ]


def _mission(kind: str, types: int, seed: int) -> Mission:
    if kind == OWN:
        return maze(five_types=types == 5)
    return random_maze(TASKS, types=types, seed=seed)


def measure(kind: str, types: int, seed: int) -> list[Row]:
    """Assign all tasks with every method; `robots` says whose each task is, in their order."""
    mission = _mission(kind, types, seed)
    problem = posed(mission, seed=seed)
    rows: list[Row] = []
    for name in available("cbba", "kan", "kam", "oath", "lns"):
        answer = plan_all(problem, allocator(name), Budget(), np.random.default_rng(seed))
        whose = {stop.task: r for r, id in enumerate(problem.robots) for stop in answer.routes[id]}
        distance, makespan = figures(problem, answer)
        rows.append(
            {
                "placement": kind,
                "types": types,
                "seed": seed,
                "method": name,
                "distance": distance,
                "makespan": makespan,
                "unassigned": len(answer.unassigned),
                "robots": " ".join(str(whose.get(task.id, -1)) for task in mission.tasks),
            }
        )
    return rows


def table(rows: Sequence[Row]) -> list[Row]:
    """Means over the placements."""
    return [
        {
            "types": types,
            "placement": kind,
            "method": LOOKS[method].label,
            "placements": len(group),
            "total distance [m]": mean(group, "distance"),
            "makespan [s]": mean(group, "makespan"),
            "tasks of the busiest robot": mean(
                [{"most": max(_counts(row).values())} for row in group], "most"
            ),
            "unassigned": sum(row["unassigned"] for row in group),
        }
        for (types, kind, method), group in sorted(
            grouped(rows, lambda r: (r["types"], r["placement"], r["method"])).items(),
            key=lambda entry: (entry[0][0], entry[0][1] != OWN),
        )
    ]


def _counts(row: Row) -> dict[str, int]:
    robots = row["robots"].split()
    return {robot: robots.count(robot) for robot in dict.fromkeys(robots)}


def plot(rows: Sequence[Row]) -> Figure:
    """Whose every task is: a row of maps per method, a column per number of types."""
    methods = [name for name in ("oath", OURS) if name in present(rows)]
    figure = sheet(12.5, 4.3 * len(methods) + 1.0)
    panels = figure.subplots(len(methods), len(TYPES), squeeze=False)
    for line, method in zip(panels, methods, strict=True):
        for axes, types in zip(line, TYPES, strict=True):
            kind, seed = (DRAWN, DRAWN_FOR_THREE) if types == 3 else (OWN, 0)
            chosen = [
                row
                for row in rows
                if (row["placement"], row["types"], row["seed"], row["method"])
                == (kind, types, seed, method)
            ]
            if chosen:
                _map(axes, chosen[0], _mission(kind, types, seed))
            else:
                axes.set_axis_off()
    handles, labels = _legend()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=9)
    return figure


def _map(axes: Any, row: Row, mission: Mission) -> None:
    for wall in MAP.walls:
        axes.plot(*zip(*wall, strict=True), color="#3C3C3C", linewidth=2.0, zorder=1)
    kinds = list(mission.task_types)
    for task, owner in zip(mission.tasks, row["robots"].split(), strict=True):
        at, goal, who = task.stops[0].at, task.stops[-1].at, int(owner)
        colour = ROBOT_COLOURS[who] if who >= 0 else "white"
        axes.plot(*zip(at, goal, strict=True), color=colour, linewidth=0.7, alpha=0.35, zorder=2)
        axes.plot(
            *at,
            TYPE_MARKERS[kinds.index(task.type)],
            color=colour,
            markeredgecolor=INK,
            markeredgewidth=0.6,
            markersize=8,
            zorder=4,
        )
        axes.annotate(
            str(who + 1), at, ha="center", va="center", color="white", fontsize=6, zorder=6
        )
    for r, robot in enumerate(mission.robots):
        axes.plot(*robot.start, "*", color=ROBOT_COLOURS[r], markersize=15, mec=INK, zorder=5)
        axes.annotate(
            str(r + 1), robot.start, (6, 5), textcoords="offset points", fontsize=9, weight="bold"
        )
    for place, goal in mission.places.items():
        axes.plot(*goal, "v", color="white", markeredgecolor=INK, markersize=10, zorder=3)
        axes.annotate(place, goal, (5, -12), textcoords="offset points", fontsize=9)
    axes.set_aspect("equal")
    axes.set_xlim(-0.3, 20.3)
    axes.set_ylim(-0.3, 20.3)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(
        f"{LOOKS[row['method']].label}, {row['types']} types: "
        f"{row['distance']:.0f} m, makespan {row['makespan']:.0f} s",
        fontsize=11,
    )


def _legend() -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D

    def point(marker: str, colour: str) -> Any:
        return Line2D([], [], ls="", marker=marker, color=colour, markeredgecolor=INK, ms=9)

    robots = [point("*", colour) for colour in ROBOT_COLOURS]
    types = [point(marker, "#BBBBBB") for marker in TYPE_MARKERS]
    labels = [f"robot {r + 1}, start" for r in range(len(robots))]
    labels += [f"type {t + 1}, pickup" for t in range(len(types))]
    return [*robots, *types, point("v", "white")], [*labels, "delivery place"]


def finding(rows: Sequence[Row]) -> str:
    """Least distance and makespan by number of types, and what was left."""
    parts = []
    for types in sorted({row["types"] for row in rows}):
        some = [row for row in rows if row["types"] == types]
        by = {name: [r for r in some if r["method"] == name] for name in present(some)}
        best, soonest = (
            min(by, key=lambda name: mean(by[name], column)) for column in ("distance", "makespan")
        )
        parts.append(
            f"with {types} types {LOOKS[best].label} drives least "
            f"({mean(by[best], 'distance'):.0f} m on average) and {LOOKS[soonest].label} is done "
            f"first ({mean(by[soonest], 'makespan'):.0f} s)"
        )
    left = sum(row["unassigned"] for row in rows)
    placements = len({(row["placement"], row["types"], row["seed"]) for row in rows})
    text = f"Over {placements} placements, {listed(parts)}; " + (
        f"{left} tasks stayed unassigned." if left else "every task found a robot able to it."
    )
    if {"oath", OURS} <= set(present(rows)):
        saved = {
            types: 1
            - mean([r for r in some if r["method"] == OURS], "distance")
            / mean([r for r in some if r["method"] == "oath"], "distance")
            for types, some in grouped(rows, lambda r: r["types"]).items()
        }
        shares = [f"{saved[types]:.0%} with {types}" for types in sorted(saved)]
        text += f" LNS drives less than OATH by {listed(shares)} types."
    return text


STUDY = Study(
    name="types",
    title="Assignments with two, three and five types of task",
    asked=(
        "Who gets which task when robots can do different types, and what do distance and "
        "makespan cost with two, three and five types?"
    ),
    paper=(
        "Shows who gets which task with two, three and five types. Its tasks and capabilities of "
        "two and five types are used here; a random placement stands for three types."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
)
