"""The optimum, proven, for up to 32 tasks; beyond them a lower bound.

Bounded dynamic programming over (taken set, carried set, place, robot), see `core/exact.cpp`. The
upper bound is a short neighbourhood search, whose routes are also the answer where nothing better
exists or is found in time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from oath import _core
from oath.allocate.contract import Budget, stop_location
from oath.allocate.lns import assignment, open_tasks, picks, search
from oath.allocate.problem import Problem
from oath.allocate.selection import Picks
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

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to all robots; what they already do stays in front."""
        begin = perf_counter()
        params, tasks = self.params, open_tasks(problem)
        seconds = params.seconds if budget.seconds is None else budget.seconds
        if not tasks.size:
            nothing: list[Picks] = [() for _ in problem.robots]
            return replace(assignment(problem, nothing), lower_bound=0.0, optimal=True)
        first = self._share(budget, len(tasks))
        known = _sound(problem, search(problem, tasks, params.makespan_weight, first, rng))
        found, lower, optimal = self._prove(problem, tasks, known, begin + seconds)
        return replace(assignment(problem, found), lower_bound=lower, optimal=optimal)

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
        self, problem: Problem, tasks: NDArray[np.intp], known: list[Picks], deadline: float
    ) -> tuple[list[Picks], float | None, bool]:
        """Look for fewer missing tasks, then for a better objective than the known routes have."""
        value = objective(problem, known, self.params.makespan_weight)
        missing = len(tasks) - sum(len({task for task, _ in route}) for route in known)
        for skip in range(_least_missing(problem, tasks), missing + 1):
            upper = value if skip == missing else np.inf
            answer = self._solve(problem, tasks, skip, upper, deadline)
            routes, least, lower, complete = answer
            if routes:
                # A longer search may have found it in another order, with another rounding error.
                return routes, least if complete else lower, complete
            if not complete:
                return known, min(lower, value) if skip == missing else None, False
        return known, value, True

    def _solve(
        self, problem: Problem, tasks: NDArray[np.intp], skip: int, upper: float, deadline: float
    ) -> tuple[list[Picks], float, float, bool]:
        able = problem.feasible()[:, tasks]
        # Whoever can do little goes first: fewer sets of tasks are then reachable at all.
        order = np.argsort(able.sum(axis=1), kind="stable")
        weight = self.params.makespan_weight
        routes, _, lower, complete, _ = _core.solve_exact(
            cost=np.ascontiguousarray(problem.cost),
            first=problem.pickup[tasks],
            last=problem.delivery[tasks],
            visit=problem.visit[tasks].astype(np.uint8),
            service=problem.service_time[tasks],
            able=np.ascontiguousarray(able[order].T, dtype=np.uint8),
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
        found: list[Picks] = [() for _ in problem.robots]
        for robot, stops in zip(order.tolist(), routes, strict=True):
            found[robot] = picks(problem, tasks, stops)
        return found, objective(problem, found, weight), lower, complete


def objective(problem: Problem, routes: list[Picks], makespan_weight: float) -> float:
    """Return the sum of the routes' lengths [m] + `makespan_weight` [m/s] * their makespan [s].

    Parameters
    ----------
    routes
        Per robot its stops, from where it is free.
    """
    total = latest = 0.0
    for r, route in enumerate(routes):
        length, service = _length(problem, r, route)
        total += length
        latest = max(latest, length / float(problem.speed[r]) + service)
    return total + makespan_weight * latest if makespan_weight else total


def _length(problem: Problem, robot: int, route: Picks) -> tuple[float, float]:
    at, length, service = int(problem.start[robot]), 0.0, 0.0
    for task, stop in route:
        there = stop_location(problem, task, stop)
        length += float(problem.cost[problem.mode[robot], at, there])
        service += float(problem.service_time[task])
        at = there
    return length, service


def _sound(problem: Problem, routes: list[Picks]) -> list[Picks]:
    """Leave out routes with a leg that does not exist: the search takes costs for symmetric."""
    return [
        route if np.isfinite(_length(problem, r, route)[0]) else ()
        for r, route in enumerate(routes)
    ]


def _least_missing(problem: Problem, tasks: NDArray[np.intp]) -> int:
    """Return how many tasks must stay out since robots may be given only `max_tasks` each.

    Tasks are matched to robots along augmenting paths: one that is full passes a task on.
    """
    able = problem.feasible()[:, tasks]
    given: list[list[int]] = [[] for _ in problem.robots]

    def place(task: int, tried: set[int]) -> bool:
        for robot in np.flatnonzero(able[:, task]).tolist():
            if robot in tried:
                continue
            tried.add(robot)
            mine = given[robot]
            if len(mine) < problem.max_tasks[robot]:
                mine.append(task)
                return True
            for k, other in enumerate(mine):
                if place(other, tried):
                    mine[k] = task
                    return True
        return False

    return sum(not place(task, set()) for task in range(len(tasks)))
