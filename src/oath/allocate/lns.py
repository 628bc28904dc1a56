"""Our own allocator: near-optimal routes for all tasks at once by ruin and recreate.

Large neighbourhood search over heterogeneous, capacitated pickup and delivery with open routes; see
`core/search.cpp` for the moves and their sources. Deterministic for a given seed and number of
iterations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from oath import _core
from oath.allocate.contract import Budget, reasons, with_routes
from oath.allocate.problem import Problem
from oath.allocate.rounds import follow
from oath.allocate.stages import in_no_route
from oath.model import Assignment, Route, RouteStop, StopName

Routes = list[list[int]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """What is minimised: sum of lengths [m] + `makespan_weight` [m/s] * makespan [s]."""

    makespan_weight: float = 1.0
    iterations: int = 10_000
    """If the budget names neither seconds nor iterations; about 50 ms for 25 tasks."""
    switch_gain: float = 0.01
    """Share of the objective that changing routes under way must save."""


@dataclass(frozen=True, slots=True)
class Lns:
    """Anytime search; a budget of 0 still gives the feasible routes of a greedy construction."""

    params: Params = Params()
    reconsiders: ClassVar[bool] = True

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to all robots; what is fixed stays in front.

        Routes under way change only if that saves `switch_gain` of the objective, or serves more.
        """
        stops = Stops(problem)
        before = stops.kept(problem.previous)
        weight, seed = self.params.makespan_weight, int(rng.integers(2**63))
        if budget.seconds is None and budget.iterations is None:
            budget = Budget(iterations=self.params.iterations)
        chosen = search(stops, before, weight, budget, seed)
        if any(before):
            steady = search(stops, before, weight, Budget(iterations=0), seed)
            old, new = stops.value(steady, weight), stops.value(chosen, weight)
            if old[0] == new[0] and new[1] > old[1] * (1 - self.params.switch_gain):
                chosen = steady
        return stops.assignment(chosen)


def search(
    stops: Stops, routes: Routes, makespan_weight: float, budget: Budget, seed: int
) -> Routes:
    """Improve routes, and take up what is in none.

    Parameters
    ----------
    routes
        Where to begin; [] for every robot begins with a greedy construction.
    makespan_weight
        Weight of the makespan in the objective [m/s].

    Returns
    -------
    Routes
        As few tasks as possible are missing. Where costs differ by direction, the greater counts.
    """
    problem = stops.problem
    answer, _ = _core.search(
        cost=np.ascontiguousarray(np.maximum(problem.cost, problem.cost.transpose(0, 2, 1))),
        first=stops.first,
        last=stops.last,
        kind=stops.kind,
        owner=stops.owner,
        service=stops.service,
        able=stops.able,
        mode=problem.mode,
        start=problem.start,
        capacity=problem.capacity,
        aboard=np.array([len(loads) for loads in problem.aboard], dtype=np.int32),
        most=problem.max_tasks,
        speed=problem.speed,
        ready=problem.ready,
        makespan_weight=makespan_weight,
        routes=routes,
        seed=seed,
        seconds=-1.0 if budget.seconds is None else budget.seconds,
        iterations=-1 if budget.iterations is None else budget.iterations,
    )
    return answer


class Stops:
    """The stops to be routed, as the core numbers them: open tasks first, then what is aboard."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        feasible = problem.feasible()
        self.open = np.flatnonzero(in_no_route(problem) & feasible.any(axis=0))
        loads = [(r, load) for r, loads in enumerate(problem.aboard) for load in loads]
        aboard = [load.delivery for _, load in loads]
        self.ids = [problem.tasks[p] for p in self.open] + [load.task for _, load in loads]
        n, m = len(self.open), len(loads)
        self.first = _ints(*problem.pickup[self.open], *aboard)
        self.last = _ints(*problem.delivery[self.open], *aboard)
        self.kind = _ints(*problem.visit[self.open], *[2] * m)
        self.owner = _ints(*[-1] * n, *(r for r, _ in loads))
        service = [load.service_time for _, load in loads]
        self.service = np.array([*problem.service_time[self.open], *service], dtype=np.float64)
        self.able = np.ones((n + m, len(problem.robots)), dtype=np.uint8)
        self.able[:n] = feasible[:, self.open].T

    def kept(self, routes: Sequence[Route]) -> Routes:
        """What of these routes is not fixed, and can still be done; [] for a robot that cannot."""
        number = {id: t for t, id in enumerate(self.ids)}
        kept: Routes = []
        for r, (route, fixed) in enumerate(zip(routes, self.problem.routes, strict=True)):
            rest = route[len(fixed) :] if route[: len(fixed)] == fixed else ()
            rest = tuple(stop for stop in rest if stop.task in number)
            able = all(self.able[number[stop.task], r] for stop in rest)
            if not able or not np.isfinite(follow(self.problem, r, rest)[0]):
                rest = ()
            kept.append([self._code(number[stop.task], stop.stop) for stop in rest])
        return kept

    def _code(self, task: int, stop: StopName) -> int:
        is_last = stop == "delivery" and self.kind[task] == 0
        return task + len(self.ids) if is_last else task

    def new(self, routes: Routes) -> list[Route]:
        """Every robot's stops after what is fixed."""
        return [tuple(self._stop(code) for code in route) for route in routes]

    def assignment(self, routes: Routes) -> Assignment:
        """Put these stops behind what is fixed; say why the other tasks are in no route."""
        problem, new = self.problem, self.new(routes)
        whole = {robot: problem.routes[r] + new[r] for r, robot in enumerate(problem.robots)}
        done = {stop.task for route in whole.values() for stop in route}
        left = [p for p, task in enumerate(problem.tasks) if task not in done]
        return Assignment(routes=whole, unassigned=reasons(with_routes(problem, new), left))

    def _stop(self, code: int) -> RouteStop:
        n = len(self.ids)
        names: tuple[StopName, ...] = ("pickup", "visit", "delivery")
        name = names[2] if code >= n else names[self.kind[code]]
        return RouteStop(task=self.ids[code % n], stop=name)

    def value(self, routes: Routes, makespan_weight: float) -> tuple[int, float]:
        """Stops served, and the objective: lengths [m] + weight [m/s] * makespan [s]."""
        problem, total, times = self.problem, 0.0, [0.0]
        for r, rest in enumerate(self.new(routes)):
            length, service, _ = follow(problem, r, rest)
            total += length
            times.append(float(problem.ready[r] + length / problem.speed[r] + service))
        return sum(map(len, routes)), total + makespan_weight * max(times)


def _ints(*values: int) -> NDArray[np.int32]:
    return np.array(values, dtype=np.int32)
