"""How far every method is from the proven optimum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from oath.allocate import Allocator, Budget, Lns, Problem, allocator, checked, plan_all
from oath.allocate.lns import Params as LnsParams
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
from oath.bench.paper import TASK_SETS, VERSUS_MILP, maze
from oath.bench.study import Case, Row, Study
from oath.model import Assignment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CAPACITY = 2
TASKS: dict[int, tuple[str, ...]] = {n: TASK_SETS[n] for n in (9, 12, 15, 18)}
TASKS[21] = (*TASK_SETS[20], "gb")
"""The paper's sets; of its 21 tasks no list is at hand, so one more is added to its 20."""

LITERAL, SINGLE = "literal", "single-round"
FAST, SLOW, BALANCED = "lns 50 ms", "lns 200 ms", "lns default"
VARIANTS: dict[str, Look] = {
    **{name: LOOKS[name] for name in ("cbba", "kan", "kam", "oath")},
    BALANCED: Look("LNS default (sum + makespan)", "#F0E442", "v", ""),
    FAST: Look("LNS 50 ms", "#D55E00", "*", ""),
    SLOW: Look("LNS 200 ms", "#000000", "P", ""),
    "exact": LOOKS["exact"],
}


def cases(quick: bool, seeds: int) -> list[Case]:
    """One case per variant, size and roadmap; the exact solver's time is limited."""
    limit = 4.0 if quick else 600.0
    return [
        Case(
            key=f"{variant} {tasks} seed={seed} limit={limit:g}",
            arguments={"variant": variant, "tasks": tasks, "seed": seed, "limit": limit},
        )
        for variant in (LITERAL, SINGLE)
        for tasks in TASKS
        for seed in range(1 if quick else seeds)
    ]


def measure(variant: str, tasks: int, seed: int, limit: float) -> list[Row]:
    """Solve one problem with every method."""
    mission = maze(TASKS[tasks], capacity=CAPACITY)
    problem = posed(mission, seed=seed)
    if variant == SINGLE:
        share = np.full_like(problem.capacity, -(-tasks // len(problem.robots)))
        problem = replace(problem, capacity=share, max_tasks=share)
    rows = [_solve(problem, name, seed, limit) for name in VARIANTS if _there(name)]
    return [{"variant": variant, "tasks": tasks, "seed": seed} | row for row in rows]


def _there(name: str) -> bool:
    return bool(available(name.split()[0]))


def _solve(problem: Problem, name: str, seed: int, limit: float) -> Row:
    budget, rng = Budget(), np.random.default_rng(seed)
    method = allocator(name) if name in available(name) else Lns(LnsParams(makespan_weight=0.0))
    if name == BALANCED:
        method = Lns()
    if name != "exact":
        method.allocate(problem, Budget(iterations=0), np.random.default_rng(seed))  # imports
    begin = perf_counter()
    if name == "exact":
        answer = checked(method, problem, Budget(seconds=limit), rng)
    else:
        if name in (FAST, SLOW):
            budget = Budget(seconds=0.05 if name == FAST else 0.2)
        answer = plan_all(problem, _Quota(method), budget, rng)
    seconds = perf_counter() - begin
    distance, makespan = figures(problem, answer)
    return {
        "method": name,
        "distance": distance,
        "makespan": makespan,
        "seconds": seconds,
        "unassigned": len(answer.unassigned),
        "over": _over(problem, answer),
        "proven": answer.optimal,
        "bound": answer.lower_bound,
    }


def _over(problem: Problem, answer: Assignment) -> int:
    """Tasks given beyond the robots' `max_tasks`."""
    given = [len({stop.task for stop in answer.routes[robot]}) for robot in problem.robots]
    return int(np.maximum(np.array(given) - problem.max_tasks, 0).sum())


@dataclass(slots=True)
class _Quota:
    """Keeps count of the tasks that robots were given over the rounds of a plan."""

    inner: Allocator
    given: dict[str, set[str]] = field(default_factory=dict)

    @property
    def reconsiders(self) -> bool:
        return self.inner.reconsiders

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        given = [len(self.given.get(robot, ())) for robot in problem.robots]
        left = np.maximum(problem.max_tasks - np.array(given, dtype=np.int32), 0)
        rest = replace(
            problem,
            max_tasks=left,
            capacity=np.minimum(problem.capacity, left),
            refused=problem.refused | (left == 0)[:, None],
        )
        answer = self.inner.allocate(rest, budget, rng)
        for robot, route in answer.routes.items():
            self.given.setdefault(robot, set()).update(stop.task for stop in route)
        return answer


def valid(row: Row) -> bool:
    """Whether a row serves all tasks within its robots' limits."""
    return not row["unassigned"] and not row["over"]


def with_gaps(rows: Sequence[Row]) -> list[Row]:
    """Rows with `best`, `gap` = (distance - best) / best, and whether the best is proven.

    The best is the proven optimum, else the least distance that any method found.
    """
    found = []
    for group in grouped(rows, lambda r: (r["variant"], r["tasks"], r["seed"])).values():
        proofs = [row["distance"] for row in group if row["proven"]]
        tried = [row["distance"] for row in group if valid(row)]
        best = min(proofs or tried, default=float("nan"))
        for row in group:
            gap = (row["distance"] - best) / best if valid(row) else None
            found.append(row | {"best": best, "known": bool(proofs), "gap": gap})
    return found


def papers_gaps() -> list[float]:
    """The paper's gaps to its MILP by number of tasks; from 15 on that had run out of time."""
    return [
        (ours - best) / best
        for ours, best in zip(
            VERSUS_MILP["oath_distance"], VERSUS_MILP["milp_distance"], strict=True
        )
    ]


def table(rows: Sequence[Row]) -> list[Row]:
    """By variant, size and method; the paper's own gaps last."""
    found: list[Row] = []
    for (variant, tasks, method), group in grouped(
        with_gaps(rows), lambda r: (r["variant"], r["tasks"], r["method"])
    ).items():
        good = [row for row in group if valid(row)]
        found.append(
            {
                "variant": variant,
                "tasks": tasks,
                "method": VARIANTS[method].label,
                "total distance [m]": mean(good, "distance"),
                "gap [%]": 100 * mean(good, "gap"),
                "optimum proven": f"{sum(row['known'] for row in group)} of {len(group)}",
                "makespan [s]": mean(good, "makespan"),
                "seconds": mean(group, "seconds"),
                "valid": f"{len(good)} of {len(group)}",
            }
        )
    for tasks, gap, far, seconds in zip(
        VERSUS_MILP["tasks"],
        papers_gaps(),
        VERSUS_MILP["oath_distance"],
        VERSUS_MILP["oath_seconds"],
        strict=True,
    ):
        found.append(
            {
                "variant": "as published",
                "tasks": tasks,
                "method": "the paper's OATH",
                "total distance [m]": far,
                "gap [%]": 100 * gap,
                "seconds": seconds,
            }
        )
    return found


def plot(rows: Sequence[Row]) -> Figure:
    """Gap and seconds over the number of tasks, by variant; the paper's in black."""
    figure = sheet(12.5, 8.5)
    panels = figure.subplots(2, 2, sharex=True)
    gaps = with_gaps(rows)
    for column, variant in enumerate((LITERAL, SINGLE)):
        some = [row for row in gaps if row["variant"] == variant]
        for line, (key, scale) in zip(panels, (("gap", 100.0), ("seconds", 1.0)), strict=True):
            _lines(line[column], [row for row in some if valid(row)], key, scale)
        _published(panels[0][column], panels[1][column])
        tidy(panels[0][column], "", "gap to the best [%]", _title(variant))
        tidy(panels[1][column], "tasks", "time [s]")
        panels[0][column].set_ylim(bottom=-2)
        panels[1][column].set_yscale("log")
        panels[1][column].set_xticks(list(TASKS))
    handles = {
        label: handle
        for axes in panels.flat
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5)
    return figure


def _title(variant: str) -> str:
    if variant == LITERAL:
        return f"literal: {CAPACITY} tasks aboard at once"
    return "single-round: ⌈P/R⌉ tasks a robot in all"


def _lines(axes: Any, rows: Sequence[Row], key: str, scale: float) -> None:
    for method, group in grouped(rows, lambda r: r["method"]).items():
        look = VARIANTS[method]
        sizes = grouped(group, lambda r: r["tasks"])
        axes.plot(
            list(sizes),
            [scale * mean(some, key) for some in sizes.values()],
            "-",
            color=look.colour,
            marker=look.marker,
            markeredgecolor=INK,
            markeredgewidth=0.5,
            markersize=11 if look.marker == "*" else 7,
            label=look.label,
        )


def _published(gap: Any, seconds: Any) -> None:
    sizes = list(VERSUS_MILP["tasks"])
    style: dict[str, Any] = {"color": INK, "linewidth": 1.0, "markerfacecolor": "white"}
    gap.plot(sizes, [100 * g for g in papers_gaps()], "--o", label="OATH as published", **style)
    seconds.plot(sizes, VERSUS_MILP["oath_seconds"], "--o", label="OATH as published", **style)
    seconds.plot(sizes, VERSUS_MILP["milp_seconds"], ":X", label="MILP as published", **style)


def finding(rows: Sequence[Row]) -> str:
    """Mean and worst gap of every method, by variant, and what of it is proven."""
    gaps = with_gaps(rows)
    theirs = papers_gaps()
    parts = []
    for variant, some in grouped(gaps, lambda r: r["variant"]).items():
        problems = grouped(some, lambda r: (r["tasks"], r["seed"]))
        proven = sum(group[0]["known"] for group in problems.values())
        words = []
        for method, group in grouped(some, lambda r: r["method"]).items():
            good = [row for row in group if valid(row)]
            if not good:
                words.append(f"{VARIANTS[method].label} (kept within the limits on none)")
                continue
            worst = max(row["gap"] for row in good)
            kept = "" if len(good) == len(group) else f" on {len(good)} of {len(group)}"
            words.append(
                f"{VARIANTS[method].label} {mean(good, 'gap'):.1%} (worst {worst:.1%}{kept})"
            )
        parts.append(
            f"{variant.capitalize()}: the optimum is proven on {proven} of {len(problems)} "
            f"problems; mean gaps are {listed(words)}."
        )
    parts.append(
        f"The paper's gaps, divided by the better distance, are {min(theirs):.1%} to "
        f"{max(theirs):.1%}."
    )
    return " ".join(parts)


STUDY = Study(
    name="optimality",
    title="Distance to the optimum",
    asked=(
        "How far from the least possible total distance are the methods on 9 to 21 tasks, and how "
        f"long do they take? Literal: a robot has room for {CAPACITY} tasks at once and goes on as "
        "long as it likes; single-round: it has room for its share of the tasks, rounded up, and "
        "gets no more in all."
    ),
    paper=(
        "Its distances and seconds beside those of an exact MILP that may take 600 s, which it "
        "needed from 15 tasks on. Its distances to the first stops are straight lines, so only "
        "ratios compare; gaps here are (x - best) / best."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
    timed=True,
)
