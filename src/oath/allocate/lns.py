"""Our own allocator: near-optimal routes for all tasks at once by ruin and recreate.

Large neighbourhood search over heterogeneous, capacitated pickup and delivery with open routes; see
`core/search.cpp` for the moves and their sources. Deterministic for a given seed and number of
iterations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oath import _core
from oath.allocate.contract import Budget, reasons, to_route
from oath.allocate.oath import in_no_route
from oath.allocate.problem import Problem
from oath.model import Assignment, StopName


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """What is minimised: sum of lengths [m] + `makespan_weight` [m/s] * makespan [s]."""

    makespan_weight: float = 1.0
    seconds: float = 0.05
    """Wall clock if the budget names neither seconds nor iterations [s]."""


@dataclass(frozen=True, slots=True)
class Lns:
    """Anytime search; a budget of 0 still gives the feasible routes of a greedy construction."""

    params: Params = Params()

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to all robots; what they already do stays in front."""
        feasible = problem.feasible()
        open_ = np.flatnonzero(in_no_route(problem) & feasible.any(axis=0))
        seconds, iterations = budget.seconds, budget.iterations
        if seconds is None and iterations is None:
            seconds = self.params.seconds
        routes, _ = _core.search(
            cost=np.ascontiguousarray(problem.cost),
            first=problem.pickup[open_],
            last=problem.delivery[open_],
            kind=problem.visit[open_].astype(np.int32),
            owner=np.full(len(open_), -1, dtype=np.int32),
            service=problem.service_time[open_],
            able=np.ascontiguousarray(feasible[:, open_].T, dtype=np.uint8),
            mode=problem.mode,
            start=problem.start,
            capacity=problem.capacity,
            aboard=np.zeros(len(problem.robots), dtype=np.int32),
            speed=problem.speed,
            ready=np.zeros(len(problem.robots)),
            makespan_weight=self.params.makespan_weight,
            routes=[[] for _ in problem.robots],
            seed=int(rng.integers(2**63)),
            seconds=-1.0 if seconds is None else seconds,
            iterations=-1 if iterations is None else iterations,
        )
        n = len(open_)
        answer = {}
        for r, robot in enumerate(problem.robots):
            picks: list[tuple[int, StopName]] = []
            for stop in routes[r]:
                task = int(open_[stop % n])
                name: StopName = "delivery" if stop >= n else "pickup"
                picks.append((task, "visit" if problem.visit[task] else name))
            answer[robot] = problem.routes[r] + to_route(problem, picks)
        done = {stop.task for route in answer.values() for stop in route}
        left = [p for p, task in enumerate(problem.tasks) if task not in done]
        return Assignment(routes=answer, unassigned=reasons(problem, left))
