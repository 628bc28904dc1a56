"""The optimum, proven, for up to 32 tasks; beyond them a lower bound.

Bounded dynamic programming over (taken set, carried set, place, robot), see `core/exact.cpp`. The
upper bound is a short neighbourhood search, whose routes are also the answer where nothing better
exists or is found in time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar

import numpy as np

from oath import _core
from oath.allocate.contract import Budget
from oath.allocate.lns import Routes, Stops, search
from oath.allocate.problem import Problem
from oath.model import Assignment

MOST_TASKS = 32
"""Tasks that the compiled search takes; for more of them it returns a lower bound only."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """What is minimised, sum of lengths [m] + `makespan_weight` [m/s] * makespan [s], and limits.

    With weight 0 it is the paper's problem 1 to the letter.
    """

    makespan_weight: float = 1.0
    seconds: float = 60.0
    """Wall clock if the budget names none [s]."""
    states: int = 20_000_000
    """States kept at once; 24 bytes each, 40 with a makespan, some three times that in all."""
    iterations: int = 3000
    """Of the neighbourhood search, if the budget names none."""


@dataclass(frozen=True, slots=True)
class Exact:
    """Serves as many tasks as can be served together, at the least objective there is.

    `Assignment.lower_bound` and `optimal` say what is proven. Values that differ by less than a
    billionth count as equal. Deterministic as long as it ends before its time.
    """

    params: Params = Params()
    reconsiders: ClassVar[bool] = False

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to all robots; what they already do stays in front."""
        begin = perf_counter()
        params, stops = self.params, Stops(problem)
        seconds = params.seconds if budget.seconds is None else budget.seconds
        nothing: Routes = [[] for _ in problem.robots]
        if not stops.ids:
            return replace(stops.assignment(nothing), lower_bound=0.0, optimal=True)
        share, seed = self._share(budget, len(stops.ids)), int(rng.integers(2**63))
        known = search(stops, nothing, params.makespan_weight, share, seed)
        found, lower, optimal = self._prove(stops, known, begin + seconds)
        if params.makespan_weight and problem.ready.any():
            lower, optimal = None, False  # the proof has all robots begin now
        return replace(stops.assignment(found), lower_bound=lower, optimal=optimal)

    def _share(self, budget: Budget, tasks: int) -> Budget:
        """Return what the search may use of the budget; with many tasks there is no proof to come.

        Without seconds it counts iterations only, since the clock would make it irreproducible.
        """
        seconds, iterations = budget.seconds, budget.iterations
        many = tasks > MOST_TASKS
        if iterations is None and not (many and seconds is not None):
            iterations = self.params.iterations
        if seconds is not None:
            seconds *= 0.9 if many else 0.2
        return Budget(seconds=seconds, iterations=iterations)

    def _prove(
        self, stops: Stops, known: Routes, deadline: float
    ) -> tuple[Routes, float | None, bool]:
        """Look for fewer missing tasks, then for a better objective than the known routes have."""
        n = len(stops.ids)
        value = stops.value(known, self.params.makespan_weight)[1]
        missing = n - len({code % n for route in known for code in route})
        for skip in range(_least_missing(stops), missing + 1):
            upper = value if skip == missing else np.inf
            routes, least, lower, complete = self._solve(stops, skip, upper, deadline)
            if routes:
                # A longer search may have found it in another order, with another rounding error.
                return routes, least if complete else lower, complete
            if not complete:
                return known, min(lower, value) if skip == missing else None, False
        return known, value, True

    def _solve(
        self, stops: Stops, skip: int, upper: float, deadline: float
    ) -> tuple[Routes, float, float, bool]:
        problem, able, weight = stops.problem, stops.able, self.params.makespan_weight
        # Whoever can do little goes first: fewer sets of tasks are then reachable at all.
        order = np.argsort(able.sum(axis=0), kind="stable")
        routes, _, lower, complete, _ = _core.solve_exact(
            cost=np.ascontiguousarray(problem.cost),
            first=stops.first,
            last=stops.last,
            visit=stops.kind.astype(np.uint8),
            service=stops.service,
            able=np.ascontiguousarray(able[:, order]),
            mode=problem.mode[order],
            start=problem.start[order],
            capacity=problem.capacity[order],
            most=problem.max_tasks[order],
            speed=problem.speed[order],
            makespan_weight=weight,
            skip=skip,
            upper=upper,
            seconds=max(0.0, deadline - perf_counter()),
            states=self.params.states,
        )
        if not routes:
            return [], np.inf, lower, complete
        found: Routes = [[] for _ in problem.robots]
        for robot, codes in zip(order.tolist(), routes, strict=True):
            found[robot] = list(codes)
        return found, stops.value(found, weight)[1], lower, complete


def _least_missing(stops: Stops) -> int:
    """Return how many tasks must stay out since robots may be given only `max_tasks` each.

    Tasks are matched to robots along augmenting paths: one that is full passes a task on.
    """
    able, most = stops.able, stops.problem.max_tasks
    given: list[list[int]] = [[] for _ in most]

    def place(task: int, tried: set[int]) -> bool:
        for robot in np.flatnonzero(able[task]).tolist():
            if robot in tried:
                continue
            tried.add(robot)
            mine = given[robot]
            if len(mine) < most[robot]:
                mine.append(task)
                return True
            for k, other in enumerate(mine):
                if place(other, tried):
                    mine[k] = task
                    return True
        return False

    return sum(not place(task, set()) for task in range(len(stops.ids)))
