"""How allocation time grows with tasks, robots and capacity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from oath.allocate import Allocator, Budget, Problem, allocator, plan_all
from oath.allocate.lns import Params as LnsParams
from oath.bench.methods import (
    INK,
    LOOKS,
    available,
    grouped,
    listed,
    mean,
    posed,
    present,
    sheet,
    tidy,
)
from oath.bench.paper import SENSITIVITY, random_maze
from oath.bench.study import Case, Row, Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BASE = {"P": 25, "R": 4, "Q": 3}
SWEEPS = {"P": (10, 15, 20, 25, 30), "R": (2, 4, 6, 8, 10), "Q": (1, 2, 3, 4, 5, 6)}
"""One at a time, the others as in `BASE`."""
NAMES = {"P": "tasks P", "R": "robots R", "Q": "capacity Q"}
TARGET = 0.1
"""Share of the paper's growth below which the paper's own method is to stay here."""


def cases(quick: bool, seeds: int) -> list[Case]:
    """One case per size and seed."""
    repeats = 3 if quick else 7
    return [
        Case(
            key=f"{swept}={value} seed={seed} repeats={repeats}",
            arguments={"swept": swept, "value": value, "seed": seed, "repeats": repeats},
        )
        for swept, values in SWEEPS.items()
        for value in (values[::2] if quick and swept != "Q" else values)
        for seed in range(min(seeds, 2) if quick else seeds)
    ]


def measure(swept: str, value: int, seed: int, repeats: int) -> list[Row]:
    """Time every method on one problem; the travel costs are ready before the clock starts."""
    size = BASE | {swept: value}
    mission = random_maze(size["P"], size["R"], capacity=size["Q"], seed=seed)
    problem = posed(mission, seed=seed)
    rows: list[Row] = []
    for name in available("cbba", "kan", "kam", "oath", "lns"):
        one, every = _seconds(problem, allocator(name), seed, repeats)
        rows.append(
            {"swept": swept, "value": value, **size, "seed": seed, "method": name}
            | {"round_seconds": one, "all_seconds": every}
        )
    return rows


def _seconds(problem: Problem, method: Allocator, seed: int, repeats: int) -> tuple[float, float]:
    """Median times [s] of one round and of all tasks, round by round."""

    def one() -> object:
        return method.allocate(problem, Budget(), np.random.default_rng(seed))

    def every() -> object:
        return plan_all(problem, method, Budget(), np.random.default_rng(seed))

    one()  # imports what is needed only now
    return _median(one, repeats), _median(every, repeats)


def _median(call: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        begin = perf_counter()
        call()
        times.append(perf_counter() - begin)
    return median(times)


def growth(rows: Sequence[Row], method: str, swept: str, column: str) -> float:
    """Slope of a time over a swept quantity by least squares [s per unit]."""
    chosen = [row for row in rows if row["method"] == method and row["swept"] == swept]
    sizes = [float(row["value"]) for row in chosen]
    times = [float(row[column]) for row in chosen]
    if len(set(sizes)) < 2:
        return float("nan")
    return float(np.polyfit(sizes, times, 1)[0])


def table(rows: Sequence[Row]) -> list[Row]:
    """The sensitivity index by method, and the times at the base size; milliseconds."""
    found: list[Row] = []
    for method in present(rows):
        base = [
            row
            for row in rows
            if row["method"] == method and all(row[k] == v for k, v in BASE.items())
        ]
        line: Row = {
            "method": LOOKS[method].label,
            "one round [ms]": 1e3 * mean(base, "round_seconds"),
            "all tasks [ms]": 1e3 * mean(base, "all_seconds"),
        }
        for swept in SWEEPS:
            line[f"per {swept}, all tasks [ms]"] = 1e3 * growth(rows, method, swept, "all_seconds")
        for swept in SWEEPS:
            line[f"per {swept}, one round [ms]"] = 1e3 * growth(
                rows, method, swept, "round_seconds"
            )
        found.append(line)
    paper = {f"per {swept}, all tasks [ms]": 1e3 * index for swept, index in SENSITIVITY.items()}
    return [*found, {"method": "the paper's OATH", **paper}]


def plot(rows: Sequence[Row]) -> Figure:
    """T_alloc over each quantity: all tasks solid, one round dotted; the paper's growth dashed."""
    figure = sheet(12.5, 4.4)
    panels = figure.subplots(1, 3)
    for axes, swept in zip(panels, SWEEPS, strict=True):
        some = [row for row in rows if row["swept"] == swept]
        for method in present(some):
            look = LOOKS[method]
            sizes = grouped((r for r in some if r["method"] == method), lambda r: r["value"])
            for column, line, fill in (("all_seconds", "-", None), ("round_seconds", ":", "white")):
                axes.plot(
                    list(sizes),
                    [1e3 * mean(group, column) for group in sizes.values()],
                    line,
                    color=look.colour,
                    marker=look.marker,
                    markerfacecolor=fill or look.colour,
                    markersize=9 if look.marker == "*" else 6,
                    label=f"{look.label}, {'all tasks' if fill is None else 'one round'}",
                )
        _papers_growth(axes, some, swept)
        fixed = ", ".join(f"{k} = {v}" for k, v in BASE.items() if k != swept)
        tidy(axes, NAMES[swept], "allocation time [ms]", fixed)
        axes.set_yscale("log")
        axes.grid(axis="y", which="major", color="#DDDDDD", linewidth=0.7)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(6, len(labels)))
    return figure


def _papers_growth(axes: object, rows: Sequence[Row], swept: str) -> None:
    """A line of the paper's slope through our first mean of its method: it gave no intercepts."""
    sizes = grouped((r for r in rows if r["method"] == "oath"), lambda r: r["value"])
    if not sizes:
        return
    first = min(sizes)
    begin = mean(sizes[first], "all_seconds")
    at = np.linspace(first, max(sizes), 50)
    axes.plot(  # type: ignore[attr-defined]
        at,
        1e3 * (begin + SENSITIVITY[swept] * (at - first)),
        "--",
        color=INK,
        linewidth=1.2,
        label="OATH if it grew as in the paper",
    )


def finding(rows: Sequence[Row]) -> str:
    """How the paper's method grows here, beside the paper's index."""
    parts, missed = [], []
    for swept, theirs in SENSITIVITY.items():
        every, one = (
            growth(rows, "oath", swept, column) for column in ("all_seconds", "round_seconds")
        )
        share = max(every, one) / theirs
        parts.append(
            f"{1e3 * every:.2f} and {1e3 * one:.3f} ms per unit of {swept} (the paper: "
            f"{1e3 * theirs:.0f} ms; the greater is {share:.2%} of it)"
        )
        if not share <= TARGET:
            missed.append(swept)
    verdict = "above" if missed else "at most"
    where = f" for {listed(missed)}" if missed else " for each"
    text = (
        "The time for all tasks, round by round, and that of the first round of OATH grow by "
        f"{listed(parts)}: the greater of both is {verdict} {TARGET:.0%} of the paper's{where}."
    )
    if growth(rows, "oath", "R", "all_seconds") < 0:
        text += " With more robots, all tasks take fewer rounds, hence less time in all."
    if "lns" in present(rows):
        text += (
            f" LNS makes {LnsParams().iterations} iterations at every size, far more than it needs "
            "to get ahead of the others."
        )
    return text


STUDY = Study(
    name="efficiency",
    title="Allocation time over tasks, robots and capacity",
    asked=(
        "How does the allocation time grow with tasks P, robots R and capacity Q, one at a time "
        f"from P = {BASE['P']}, R = {BASE['R']}, Q = {BASE['Q']}?"
    ),
    paper=(
        "Sensitivity index of its own method: "
        + ", ".join(f"{value:g} s per unit of {name}" for name, value in SENSITIVITY.items())
        + "."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
    timed=True,
)
