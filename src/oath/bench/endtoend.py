"""Whole missions: steps, distance and running time of every method."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import combinations
from statistics import fmean
from typing import TYPE_CHECKING, Any

import oath
from oath.bench.methods import (
    INK,
    LOOKS,
    OURS,
    available,
    grouped,
    listed,
    mean,
    present,
    sheet,
    tidy,
)
from oath.bench.paper import TASK_SETS, TOTAL_SECONDS, TOTAL_STEPS, maze, random_maze
from oath.bench.study import Case, Row, Study
from oath.model import Mission
from oath.verify import verify

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OWN, DRAWN = "the paper's tasks", "random tasks"
SIZES = (10, 15, 20, 25, 30)
LEAST_SEEDS = 10
"""Random placements of a full study, at least."""

MEASURES = {
    "steps": "total steps",
    "distance": "total distance [m]",
    "makespan": "makespan [s]",
    "running": "total running time [s]",
}
PUBLISHED: dict[str, dict[str, tuple[float, ...]]] = {
    "steps": {k.lower(): tuple(v) for k, v in TOTAL_STEPS.items()},
    "running": {k.lower(): tuple(v) for k, v in TOTAL_SECONDS.items()},
}


def cases(quick: bool, seeds: int) -> list[Case]:
    """One case per mission and seed; on the paper's own tasks a seed changes the roadmap only."""
    sizes = SIZES[::2] if quick else SIZES
    draws = min(seeds, 3) if quick else max(seeds, LEAST_SEEDS)
    return [
        Case(key=f"{kind}, {n} seed={seed}", arguments={"kind": kind, "tasks": n, "seed": seed})
        for kind in (OWN, DRAWN)
        for n in ((10, 15, 20, 25) if kind == OWN else sizes)
        for seed in range(draws if kind == DRAWN else 2 if quick else 5)
    ]


def measure(kind: str, tasks: int, seed: int) -> list[Row]:
    """Run one mission with every method.

    Raises
    ------
    RuntimeError
        The independent judge found a violation, or a task was left undone.
    """
    mission = maze(TASK_SETS[tasks]) if kind == OWN else random_maze(tasks, seed=seed)
    methods = available("cbba", "kan", "kam", "oath", "lns")
    return [_run(mission, name, seed) | {"kind": kind, "tasks": tasks} for name in methods]


def _run(mission: Mission, method: str, seed: int) -> Row:
    result = oath.run(mission, allocator=method, seed=seed)
    verdict = verify(mission, result.events)
    summary = result.summary
    if not verdict.ok or summary["unserved"]:
        wrong = verdict.violations[0] if not verdict.ok else summary["unserved"]
        raise RuntimeError(f"{mission.name}, allocator {method}, seed {seed}: {wrong}")
    return {
        "kind": "",
        "tasks": 0,
        "seed": seed,
        "method": method,
        "steps": summary["total_steps"],
        "distance": summary["total_distance"],
        "makespan": summary["makespan"],
        "running": summary["total_running_time"],
        "allocation": summary["allocation_seconds"],
        "planning": summary["planning_seconds"],
        "rounds": summary["rounds"],
        "judged": sum(verdict.checked.values()),
    }


def table(rows: Sequence[Row]) -> list[Row]:
    """Means over the seeds, with the paper's figures where it has this size and method."""
    found: list[Row] = []
    for (kind, tasks, method), group in grouped(
        rows, lambda r: (r["kind"], r["tasks"], r["method"])
    ).items():
        line: Row = {"placement": kind, "tasks": tasks, "method": LOOKS[method].label}
        line |= {"runs": len(group)}
        line |= {label: mean(group, column) for column, label in MEASURES.items()}
        line["allocation [s]"] = mean(group, "allocation")
        line["the paper's steps"] = published("steps", tasks, method)
        line["the paper's running time [s]"] = published("running", tasks, method)
        found.append(line)
    return found


def published(measure: str, tasks: int, method: str) -> float | None:
    """The paper's figure for a number of tasks, if it has one."""
    sizes = PUBLISHED[measure]["tasks"]
    values = PUBLISHED[measure].get(method)
    return float(values[sizes.index(tasks)]) if values and tasks in sizes else None


def plot(rows: Sequence[Row]) -> Figure:
    """Bars on the paper's tasks, its own as outlines; boxes over random placements."""
    figure = sheet(13.5, 11.0)
    panels = figure.subplots(3, 2)
    for line, column in zip(panels, ("steps", "distance", "running"), strict=True):
        _bars(line[0], [row for row in rows if row["kind"] == OWN], column)
        _boxes(line[1], [row for row in rows if row["kind"] == DRAWN], column)
    handles, labels = _legend(present(rows))
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _slots(rows: Sequence[Row]) -> tuple[list[int], list[str], float]:
    """Sizes, methods, and the width of one method's slot."""
    methods = present(rows)
    return sorted({row["tasks"] for row in rows}), methods, 0.84 / max(1, len(methods))


def _bars(axes: Any, rows: Sequence[Row], column: str) -> None:
    sizes, methods, width = _slots(rows)
    for m, method in enumerate(methods):
        look = LOOKS[method]
        at = [i + (m - (len(methods) - 1) / 2) * width for i in range(len(sizes))]
        means = [
            mean([r for r in rows if (r["method"], r["tasks"]) == (method, n)], column)
            for n in sizes
        ]
        axes.bar(at, means, width * 0.9, color=look.colour, edgecolor=INK, linewidth=0.5)
        if column in PUBLISHED:
            theirs = [published(column, n, method) for n in sizes]
            axes.bar(
                at,
                [value or 0.0 for value in theirs],
                width * 0.9,
                fill=False,
                hatch="////",
                edgecolor=look.colour,
                linewidth=1.0,
                zorder=0.8,
            )
            for x, value in zip(at, theirs, strict=True):
                if value:  # its top stays visible where ours is higher
                    axes.hlines(value, x - 0.45 * width, x + 0.45 * width, color=INK, linewidth=1.5)
        axes.plot(at, means, look.marker, color="white", markeredgecolor=INK, markersize=6)
    axes.set_xticks(range(len(sizes)), [str(n) for n in sizes])
    hatched = "; hatched: as published" if column in PUBLISHED else ""
    tidy(axes, "tasks", MEASURES[column], f"{OWN}{hatched}")


def _boxes(axes: Any, rows: Sequence[Row], column: str) -> None:
    sizes, methods, width = _slots(rows)
    for m, method in enumerate(methods):
        look = LOOKS[method]
        at = [i + (m - (len(methods) - 1) / 2) * width for i in range(len(sizes))]
        values = [
            [r[column] for r in rows if (r["method"], r["tasks"]) == (method, n)] for n in sizes
        ]
        boxes = axes.boxplot(
            values,
            positions=at,
            widths=width * 0.8,
            patch_artist=True,
            manage_ticks=False,
            showfliers=True,
            flierprops={"marker": look.marker, "markersize": 4, "markeredgecolor": INK},
            medianprops={"color": INK},
        )
        for box in boxes["boxes"]:
            box.set(facecolor=look.colour, edgecolor=INK, linewidth=0.8)
        axes.plot(
            at,
            [sum(v) / len(v) for v in values],
            look.marker,
            color="white",
            markeredgecolor=INK,
            markersize=6,
        )
    axes.set_xticks(range(len(sizes)), [str(n) for n in sizes])
    axes.set_ylim(bottom=0)
    runs = len({row["seed"] for row in rows})
    tidy(axes, "tasks", MEASURES[column], f"{DRAWN}, {runs} placements each; marker: mean")


def _legend(methods: Sequence[str]) -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys: list[Any] = [
        (
            Patch(facecolor=LOOKS[name].colour, edgecolor=INK),
            Line2D([], [], ls="", marker=LOOKS[name].marker, color="white", markeredgecolor=INK),
        )
        for name in methods
    ]
    outline = Patch(fill=False, hatch="////", edgecolor="#777777")
    return [*keys, outline], [*(LOOKS[name].label for name in methods), "as published"]


def finding(rows: Sequence[Row]) -> str:
    """The claims that hold on every row, the gain in percent, and the order of the methods."""
    judged = sum(int(row["judged"]) for row in rows)
    parts = [
        f"All {len(rows)} runs passed the independent judge ({judged} things judged, "
        "no violation, no task left)."
    ]
    others = [name for name in present(rows) if name != OURS]
    if OURS in present(rows) and others:
        parts += [_claim(rows, others, column) for column in ("steps", "distance", "running")]
    parts += [_order(rows, column) for column in PUBLISHED]
    parts.append(
        "A step is one edge of the roadmap, so the published numbers of steps belong to the "
        "paper's roadmap; compare ratios, or distances."
    )
    return " ".join(parts)


def _claim(rows: Sequence[Row], others: Sequence[str], column: str) -> str:
    """Whether ours is the least in every row of the table, and by how much."""
    sizes = grouped(rows, lambda r: (r["kind"], r["tasks"]))
    lost, gains, single, runs = [], [], 0, 0
    for (kind, tasks), group in sizes.items():
        ours = mean([r for r in group if r["method"] == OURS], column)
        best = min(mean([r for r in group if r["method"] == name], column) for name in others)
        gains.append(1 - ours / best)
        if ours >= best:
            lost.append(f"{kind} {tasks}")
        for each in grouped(group, lambda r: r["seed"]).values():
            own = next(r[column] for r in each if r["method"] == OURS)
            single += all(own < r[column] for r in each if r["method"] != OURS)
            runs += 1
    label = MEASURES[column].split(" [")[0]
    where = (
        f"on all {len(sizes)} rows"
        if not lost
        else f"on {len(sizes) - len(lost)} of {len(sizes)} rows (not: {listed(lost)})"
    )
    return (
        f"LNS has the least {label} {where}, by {min(gains):.1%} to {max(gains):.1%} against the "
        f"best other; run by run, in {single} of {runs}."
    )


def _order(rows: Sequence[Row], column: str) -> str:
    """The paper's order of its four methods, size by size, and what speaks against it."""
    methods = [name for name in present(rows) if name in PUBLISHED[column]]
    if len(methods) < 2:
        return ""
    pairs, against = 0, defaultdict(list)
    for (kind, tasks), group in grouped(rows, lambda r: (r["kind"], r["tasks"])).items():
        for low, high in combinations(methods, 2):
            theirs = [published(column, tasks, name) or 0.0 for name in (low, high)]
            if theirs[0] > theirs[1]:
                low, high = high, low
            pairs += 1
            evidence = _reversed(group, low, high, column)
            if evidence:
                against[low, high].append(f"{kind} {tasks}: {evidence}")
    label = MEASURES[column].split(" [")[0]
    stand = pairs - sum(map(len, against.values()))
    verdict = "is reproduced" if not against else "is not reproduced in full"
    text = f"The paper's order of methods by {label} {verdict}: {stand} of {pairs} pairs stand"
    reversed_ = [
        f"{LOOKS[low].label} is above {LOOKS[high].label} on {', '.join(where)}"
        for (low, high), where in against.items()
    ]
    return text + (f". Against it: {'; '.join(reversed_)}." if reversed_ else ".")


def _reversed(group: Sequence[Row], low: str, high: str, column: str) -> str:
    """By how much `low`, less in the paper, is more here, and in how many runs; "" if it is not."""
    ours = {(row["method"], row["seed"]): float(row[column]) for row in group}
    seeds = dict.fromkeys(row["seed"] for row in group)
    more = fmean(ours[low, s] for s in seeds) / fmean(ours[high, s] for s in seeds) - 1
    if more <= 0:
        return ""
    runs = sum(ours[low, seed] > ours[high, seed] for seed in seeds)
    return f"{more:+.1%} ({runs} of {len(seeds)} runs)"


STUDY = Study(
    name="endtoend",
    title="Whole missions: steps and running time",
    asked=(
        "How many steps (roadmap edges driven), how far, and how long in all (allocation, planning "
        "and simulated motion until the last delivery) do missions of 10 to 30 tasks take?"
    ),
    paper=(
        "Total steps and total running time of CBBA, KAN, KAM and OATH for "
        f"{listed([str(n) for n in TOTAL_STEPS['tasks']])} tasks: OATH has "
        f"{listed([str(n) for n in TOTAL_STEPS['OATH']])} steps, CBBA "
        f"{listed([str(n) for n in TOTAL_STEPS['CBBA']])}."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
    timed=True,
)
