"""From 25 tasks to 1000: what an allocation costs in time, and what it is worth."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

import oath
from oath.allocate import Budget, allocator, plan_all
from oath.bench.methods import (
    INK,
    LOOKS,
    Look,
    available,
    figures,
    grouped,
    listed,
    mean,
    posed,
    sheet,
    tidy,
)
from oath.bench.paper import SCALABILITY, random_maze
from oath.bench.study import Case, Row, Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZES = ((25, 4), (50, 4), (100, 4), (100, 10), (200, 10), (500, 25), (1000, 50))
"""Tasks and robots; the first three with the paper's four robots."""
DRIVEN = 4
"""Missions of this many robots are also run to their end, to count steps."""

SHORT, LONG = "lns 1 s", "lns 30 s"
METHODS: dict[str, Look] = {
    "oath": LOOKS["oath"],
    SHORT: Look("LNS 1 s", "#D55E00", "*"),
    LONG: Look("LNS 30 s", "#000000", "P"),
}


def cases(quick: bool, seeds: int) -> list[Case]:
    """One case per size and seed; the long search only in full."""
    return [
        Case(
            key=f"{tasks} tasks, {robots} robots, seed={seed} long={not quick}",
            arguments={"tasks": tasks, "robots": robots, "seed": seed, "long": not quick},
        )
        for tasks, robots in SIZES
        for seed in range(1 if quick else min(seeds, 3))
    ]


def measure(tasks: int, robots: int, seed: int, long: bool) -> list[Row]:
    """Assign all tasks with every method; the travel costs are ready before the clock starts."""
    mission = random_maze(tasks, robots, seed=seed)
    begin = perf_counter()
    problem = posed(mission, seed=seed)
    prepared = perf_counter() - begin
    rows: list[Row] = []
    for name in METHODS:
        if (name == LONG and not long) or not available(name.split()[0]):
            continue
        seconds = {SHORT: 1.0, LONG: 30.0}.get(name)
        method, rng = allocator(name.split()[0]), np.random.default_rng(seed)
        method.allocate(problem, Budget(iterations=0), np.random.default_rng(seed))  # imports
        begin = perf_counter()
        answer = plan_all(problem, method, Budget(seconds=seconds), rng)
        spent = perf_counter() - begin
        distance, makespan = figures(problem, answer)
        steps = None
        if robots == DRIVEN and name != LONG:
            steps = oath.run(mission, allocator=name.split()[0], seed=seed).summary["total_steps"]
        rows.append(
            {
                "tasks": tasks,
                "robots": robots,
                "seed": seed,
                "method": name,
                "seconds": spent,
                "preparation": prepared,
                "distance": distance,
                "makespan": makespan,
                "per_task": distance / tasks,
                "unassigned": len(answer.unassigned),
                "steps": steps,
            }
        )
    return rows


def table(rows: Sequence[Row]) -> list[Row]:
    """Means over the seeds."""
    return [
        {
            "tasks": tasks,
            "robots": robots,
            "method": METHODS[method].label,
            "allocation [s]": mean(group, "seconds"),
            "per task [ms]": 1e3 * mean(group, "seconds") / tasks,
            "total distance [m]": mean(group, "distance"),
            "distance per task [m]": mean(group, "per_task"),
            "makespan [s]": mean(group, "makespan"),
            "distance / best": _relative(rows, group),
            "steps of the mission": mean(group, "steps"),
            "map and travel costs [s]": mean(group, "preparation"),
        }
        for (tasks, robots, method), group in grouped(
            rows, lambda r: (r["tasks"], r["robots"], r["method"])
        ).items()
    ]


def _relative(rows: Sequence[Row], group: Sequence[Row]) -> float:
    """Mean distance of a group over the mean of the best method of its size."""
    same = [
        row
        for row in rows
        if (row["tasks"], row["robots"]) == (group[0]["tasks"], group[0]["robots"])
    ]
    best = min(mean(some, "distance") for some in grouped(same, lambda r: r["method"]).values())
    return mean(group, "distance") / best


def plot(rows: Sequence[Row]) -> Figure:
    """Time, distance per task and makespan over the sizes."""
    figure = sheet(13.0, 4.8)
    panels = figure.subplots(1, 3)
    measures = (
        ("seconds", "allocation time [s]"),
        ("per_task", "distance per task [m]"),
        ("makespan", "makespan [s]"),
    )
    sizes = list(grouped(rows, lambda r: (r["tasks"], r["robots"])))
    for axes, (column, label) in zip(panels, measures, strict=True):
        for method, group in grouped(rows, lambda r: r["method"]).items():
            _line(axes, group, sizes, METHODS[method], column)
        tidy(axes, "tasks / robots", label)
        axes.set_xticks(range(len(sizes)), [f"{tasks}\n/{robots}" for tasks, robots in sizes])
        if column == "seconds":
            axes.set_yscale("log")
        else:
            axes.set_ylim(bottom=0)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _line(
    axes: Any, rows: Sequence[Row], sizes: Sequence[tuple[int, int]], look: Look, column: str
) -> None:
    by = grouped(rows, lambda r: (r["tasks"], r["robots"]))
    at = [i for i, size in enumerate(sizes) if size in by]
    axes.plot(
        at,
        [mean(by[sizes[i]], column) for i in at],
        "-",
        color=look.colour,
        marker=look.marker,
        markeredgecolor=INK,
        markeredgewidth=0.5,
        markersize=12 if look.marker == "*" else 7,
        label=look.label,
    )


def finding(rows: Sequence[Row]) -> str:
    """Time and worth at the largest size, and how steps grow beside the paper's."""
    sizes = grouped(rows, lambda r: (r["tasks"], r["robots"]))
    (tasks, robots), group = max(sizes.items(), key=lambda entry: entry[0])
    parts = [
        f"{METHODS[method].label} takes {mean(some, 'seconds'):.2f} s for "
        f"{mean(some, 'distance'):.0f} m with a makespan of {mean(some, 'makespan'):.0f} s"
        for method, some in grouped(group, lambda r: r["method"]).items()
    ]
    left = sum(row["unassigned"] for row in rows)
    text = f"For {tasks} tasks and {robots} robots {listed(parts)}. "
    text += f"{left} tasks stayed unassigned. " if left else "No task was left at any size. "
    return text + _slower(sizes) + _steps(rows)


def _slower(sizes: dict[tuple[int, int], list[Row]]) -> str:
    """Where the short search loses to the paper's method in distance or makespan."""
    lost = []
    for (tasks, robots), group in sizes.items():
        by = grouped(group, lambda r: r["method"])
        if not {"oath", SHORT} <= set(by):
            continue
        for column in ("distance", "makespan"):
            ratio = mean(by[SHORT], column) / mean(by["oath"], column)
            if ratio > 1:
                lost.append(f"{column} of {tasks} tasks, {robots} robots (by {ratio - 1:.1%})")
    if not lost:
        return "LNS 1 s beats OATH in distance and makespan at every size. "
    return f"LNS 1 s is behind OATH in the {listed(lost)}, ahead in all else. "


def _steps(rows: Sequence[Row]) -> str:
    """How many times the steps grow from the paper's first size to its second."""
    few, many = SCALABILITY["tasks"]
    growths = []
    for method, group in grouped(rows, lambda r: r["method"]).items():
        driven = [row for row in group if row["robots"] == DRIVEN and row["steps"] is not None]
        low, high = (
            mean([row for row in driven if row["tasks"] == size], "steps") for size in (few, many)
        )
        if low == low and high == high:
            name = LOOKS[method.split()[0]].label
            growths.append(f"{name} from {low:.0f} to {high:.0f} ({high / low:.2f} times)")
    if not growths:
        return ""
    theirs = SCALABILITY["steps"]
    return (
        f"From {few} to {many} tasks with {DRIVEN} robots the steps of the whole mission grow with "
        f"{listed(growths)}; the paper's from {theirs[0]} to {theirs[1]} "
        f"({theirs[1] / theirs[0]:.2f} times)."
    )


STUDY = Study(
    name="scaling",
    title="From 25 tasks to 1000",
    asked=(
        "How do allocation time, distance and makespan grow from 25 tasks and 4 robots to 1000 "
        "tasks and 50 robots?"
    ),
    paper=(
        f"From {SCALABILITY['tasks'][0]} to {SCALABILITY['tasks'][1]} tasks: "
        f"{SCALABILITY['steps'][0]} and {SCALABILITY['steps'][1]} steps, "
        f"{SCALABILITY['seconds'][0]} and {SCALABILITY['seconds'][1]} s; nothing larger."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
    timed=True,
)
