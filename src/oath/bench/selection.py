"""How long the selection of tasks takes: dynamic programming against the paper's program."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from statistics import fmean, median
from typing import TYPE_CHECKING

import numpy as np

from oath.allocate.problem import Problem
from oath.allocate.selection import dynamic, program, select
from oath.bench import paper
from oath.bench.figures import COLOURS, plain_ticks, sheet, style
from oath.bench.sampling import grouped
from oath.bench.study import Case, Row, Study
from oath.scene import pose, prepare
from oath.state import State
from oath.world.roadmap import Params

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CAPACITIES = range(1, 19)
MORE = 2
"""Candidates beyond the capacity, so that there is something to choose."""

PROOF_WORK, PROOF_UP_TO = 400_000_000, 12
"""Work in which the shortest path is looked for, as a reference, up to this capacity."""

REPEATS = 3
FIGURES = ((12, 0.030), (18, 0.7))
"""What is aimed at: up to a capacity, no more than so long [s]."""


def cases(quick: bool, seeds: int) -> list[Case]:
    """Every capacity by dynamic programming; the program up to where it hopelessly hits its limit.

    A program that a seed could not solve in time is not tried with more capacity at that seed.
    """
    limit, up_to = (2.0, 5) if quick else (10.0, 8)
    some = range(min(seeds, 3) if quick else 2 * seeds)
    found = [
        Case(f"dp-{capacity}-{seed}", {"method": "dp", "capacities": (capacity,), "seed": seed})
        for seed in some
        for capacity in CAPACITIES
    ]
    # A dozen runs into a limit of seconds would be most of the study's time.
    return found + [
        Case(
            f"milp-{up_to}-{limit:g}-{seed}",
            {"method": "milp", "capacities": range(1, up_to + 1), "seed": seed, "limit": limit},
        )
        for seed in range(min(seeds, 2) if quick else seeds)
    ]


@cache
def problem(candidates: int, capacity: int, seed: int) -> Problem:
    """One robot in the maze and random deliveries, all of which it can do."""
    mission = paper.random_maze(candidates, 1, capacity=capacity, seed=seed)
    found = pose(prepare(mission, Params(), seed), State.of(mission))
    return replace(found, capability=np.ones_like(found.capability))


def measure(
    method: str, capacities: Sequence[int], seed: int, limit: float = float("inf")
) -> list[Row]:
    """Time one method for some capacities; the program stops at the first that it cannot do."""
    rows: list[Row] = []
    for capacity in capacities:
        asked = problem(capacity + MORE, capacity, seed)
        row: Row = {
            "method": method,
            "capacity": capacity,
            "candidates": capacity + MORE,
            "seed": seed,
        }
        row |= _dp(asked, capacity) if method == "dp" else _milp(asked, capacity, limit)
        rows.append(row)
        if row["hit_limit"]:
            break
    return rows


def _dp(asked: Problem, capacity: int) -> Row:
    tasks = np.arange(len(asked.tasks))
    seconds = min(_seconds(lambda: select(asked, 0, tasks.tolist())) for _ in range(REPEATS))
    _, length, proven = dynamic(asked, 0, tasks, capacity)
    shortest = None
    if proven:
        shortest = length
    elif capacity <= PROOF_UP_TO:
        _, found, exact = dynamic(asked, 0, tasks, capacity, work=PROOF_WORK)
        shortest = found if exact else None
    return {
        "seconds": seconds,
        "hit_limit": False,
        "proven": proven,
        "length_m": length,
        "shortest_m": shortest,
    }


def _milp(asked: Problem, capacity: int, limit: float) -> Row:
    tasks = np.arange(len(asked.tasks))
    solved: list[list[int]] = []
    seconds = _seconds(lambda: solved.append(program(asked, 0, tasks, capacity, seconds=limit)))
    done = bool(solved[0])
    return {"seconds": seconds, "hit_limit": not done, "proven": done, "limit_seconds": limit}


def _seconds(call: Callable[[], object]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def _gap(row: Row) -> float | None:
    """Excess [%] over the shortest path, where that is known."""
    shortest = row.get("shortest_m")
    return None if shortest is None else round(100.0 * (row["length_m"] / shortest - 1.0), 9)


def table(rows: Sequence[Row]) -> list[Row]:
    """Medians and extremes over the seeds by capacity."""
    dp = grouped([row for row in rows if row["method"] == "dp"], "capacity")
    milp = grouped([row for row in rows if row["method"] == "milp"], "capacity")
    out = []
    for (capacity,) in sorted({**dp, **milp}):
        ours, theirs = dp.get((capacity,), []), milp.get((capacity,), [])
        gaps = [gap for row in ours if (gap := _gap(row)) is not None]
        out.append(
            {
                "Q": capacity,
                "candidates": capacity + MORE,
                "DP, median [ms]": 1e3 * median(row["seconds"] for row in ours) if ours else None,
                "DP, worst [ms]": 1e3 * max(row["seconds"] for row in ours) if ours else None,
                "proven [%]": 100 * fmean(row["proven"] for row in ours) if ours else None,
                "mean gap, where known [%]": fmean(gaps) if gaps else None,
                "gap known": f"{len(gaps)} of {len(ours)}",
                "MILP, median [ms]": _cell(theirs),
            }
        )
    return out


def _cell(rows: Sequence[Row]) -> object:
    if not rows:
        return None
    stuck = sum(row["hit_limit"] for row in rows)
    if stuck:
        return f"{stuck} of {len(rows)} over {rows[0]['limit_seconds']:g} s"
    return 1e3 * median(row["seconds"] for row in rows)


def plot(rows: Sequence[Row]) -> Figure:
    """Time over capacity on a logarithmic scale, what is proven, and how near the rest is."""
    figure, (left, middle, right) = sheet(1, 3, width=4.8, height=4.0)
    for index, (method, name) in enumerate((("dp", "DP, compiled"), ("milp", "MILP, HiGHS"))):
        _times(left, [row for row in rows if row["method"] == method], name, index)
    begin = 1
    for until, seconds in FIGURES:
        left.hlines(seconds, begin, until, color="black", linestyle=":", linewidth=1.2)
        text = f"aim {1e3 * seconds:g} ms"
        left.annotate(text, (until, seconds), ha="right", va="bottom", fontsize=8)
        begin = until
    left.set(ylabel="time, median and range [s]", yscale="log")
    left.legend(frameon=False, loc="lower right")
    ours = grouped([row for row in rows if row["method"] == "dp"], "capacity")
    x = sorted(q for (q,) in ours)
    share = [100 * fmean(row["proven"] for row in ours[(q,)]) for q in x]
    middle.bar(x, share, color=COLOURS[2])
    middle.set(ylabel="DP: paths proven to be shortest [%]", ylim=(0, 105))
    gaps = {q: [gap for row in ours[(q,)] if (gap := _gap(row)) is not None] for q in x}
    known = [q for q in x if gaps[q]]
    right.plot(known, [max(gaps[q]) for q in known], label="worst", **style(1))
    right.plot(known, [fmean(gaps[q]) for q in known], label="mean", **style(0))
    right.set(ylabel="DP: excess over the shortest, where known [%]")
    right.set_ylim(-0.05, max(1.0, 1.1 * right.get_ylim()[1]))
    right.legend(frameon=False)
    for one in (left, middle, right):
        one.set(xlabel="capacity Q (tasks to take)", xlim=(0.3, max(CAPACITIES) + 0.7))
        plain_ticks(one, range(2, 19, 2))
    return figure


def _times(axes: Axes, rows: Sequence[Row], name: str, index: int) -> None:
    part = grouped(rows, "capacity")
    x = sorted(q for (q,) in part)
    times = [[row["seconds"] for row in part[(q,)]] for q in x]
    look = style(index)
    axes.plot(x, [median(t) for t in times], label=name, **look)
    low, high = [min(t) for t in times], [max(t) for t in times]
    axes.fill_between(x, low, high, color=look["color"], alpha=0.2, linewidth=0)
    stuck = [row for row in rows if row["hit_limit"]]
    if stuck:
        axes.scatter(
            [row["capacity"] for row in stuck],
            [row["seconds"] for row in stuck],
            s=70,
            color="black",
            marker="x",
            label="hit its limit",
            zorder=3,
        )


def finding(rows: Sequence[Row]) -> str:
    """Say whether the aims are met, what is proven, and where the program ends."""
    ours = [row for row in rows if row["method"] == "dp"]
    parts = []
    for until, seconds in FIGURES:
        up_to = [row for row in ours if row["capacity"] <= until]
        if not up_to:
            continue
        worst = max(up_to, key=lambda row: row["seconds"])
        by_capacity = grouped(up_to, "capacity").values()
        middle = max(median(row["seconds"] for row in group) for group in by_capacity)
        parts.append(
            f"Up to Q = {until} the worst of {len(up_to)} selections took "
            f"{1e3 * worst['seconds']:.1f} ms (Q = {worst['capacity']}), the highest median is "
            f"{1e3 * middle:.1f} ms; the aim of {1e3 * seconds:.0f} ms is "
            f"{'met' if worst['seconds'] <= seconds else 'missed'}."
        )
    parts += [_quality(ours), _program([row for row in rows if row["method"] == "milp"])]
    return " ".join(part for part in parts if part)


def _quality(rows: Sequence[Row]) -> str:
    by_capacity = grouped(rows, "capacity")
    proven = [q for (q,), group in by_capacity.items() if all(row["proven"] for row in group)]
    gaps = [gap for row in rows if not row["proven"] and (gap := _gap(row)) is not None]
    if not proven:
        return ""
    text = f"Every path is proven to be the shortest up to Q = {_run(proven)}."
    if gaps:
        text += (
            f" Of those that are not, the shortest is known for {len(gaps)}: they are "
            f"{fmean(gaps):.2f} % longer on average, {max(gaps):.2f} % at most."
        )
    return text


def _run(numbers: Sequence[int]) -> int:
    """The end of the run of numbers that begins with the least."""
    found = set(numbers)
    last = min(found)
    while last + 1 in found:
        last += 1
    return last


def _program(rows: Sequence[Row]) -> str:
    if not rows:
        return ""
    stuck = [row["capacity"] for row in rows if row["hit_limit"]]
    solved = max((row["capacity"] for row in rows if not row["hit_limit"]), default=0)
    text = f"The paper's program was solved up to Q = {solved}"
    return text + (
        f"; the first to hit the limit of {rows[0]['limit_seconds']:g} s was Q = {min(stuck)}."
        if stuck
        else " in time."
    )


STUDY = Study(
    name="selection",
    title="Selection: time against capacity",
    asked=(
        "How long does one selection take for capacities Q = 1 to 18 with Q + 2 candidate "
        f"deliveries in the maze (best of {REPEATS} runs), by our dynamic program and by the "
        "paper's mixed-integer program, and how near to the shortest are the paths? We aim at "
        "30 ms up to Q = 12 and at the paper's worst, 0.7 s, up to 18."
    ),
    paper=(
        "The worst selection time in the paper is 0.7 s; its allocation time grows by "
        f"{paper.SENSITIVITY['Q']:g} s per unit of capacity."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
    timed=True,
)
