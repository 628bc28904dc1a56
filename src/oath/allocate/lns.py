"""Our own allocator: near-optimal routes for all tasks at once by ruin and recreate.

Large neighbourhood search over heterogeneous, capacitated pickup and delivery with open routes; see
`core/search.cpp` for the moves and their sources. Deterministic for a given seed and number of
iterations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oath import _core
from oath.allocate.contract import Budget, reasons, stop_names, to_route, with_routes
from oath.allocate.oath import in_no_route
from oath.allocate.problem import Problem
from oath.allocate.selection import Picks
from oath.model import Assignment


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
        if budget.seconds is None and budget.iterations is None:
            budget = Budget(seconds=self.params.seconds)
        tasks = open_tasks(problem)
        found = search(problem, tasks, self.params.makespan_weight, budget, rng)
        return assignment(problem, found)


def open_tasks(problem: Problem) -> NDArray[np.intp]:
    """Return (n,) indices of the tasks that are in no route and that some robot can do."""
    return np.flatnonzero(in_no_route(problem) & problem.feasible().any(axis=0))


def search(
    problem: Problem,
    tasks: NDArray[np.intp],
    makespan_weight: float,
    budget: Budget,
    rng: np.random.Generator,
) -> list[Picks]:
    """Look for good routes over some tasks.

    Parameters
    ----------
    tasks
        (n,) indices of the tasks to serve.
    makespan_weight
        Weight of the makespan in the objective [m/s].

    Returns
    -------
    list[Picks]
        Per robot its stops in order; as few tasks as possible are missing. Costs must be symmetric,
        otherwise a leg may be infinite.
    """
    routes, _ = _core.search(
        cost=np.ascontiguousarray(problem.cost),
        first=problem.pickup[tasks],
        last=problem.delivery[tasks],
        kind=problem.visit[tasks].astype(np.int32),
        owner=np.full(len(tasks), -1, dtype=np.int32),
        service=problem.service_time[tasks],
        able=np.ascontiguousarray(problem.feasible()[:, tasks].T, dtype=np.uint8),
        mode=problem.mode,
        start=problem.start,
        capacity=problem.capacity,
        aboard=np.zeros(len(problem.robots), dtype=np.int32),
        most=problem.max_tasks,
        speed=problem.speed,
        ready=np.zeros(len(problem.robots)),
        makespan_weight=makespan_weight,
        routes=[[] for _ in problem.robots],
        seed=int(rng.integers(2**63)),
        seconds=-1.0 if budget.seconds is None else budget.seconds,
        iterations=-1 if budget.iterations is None else budget.iterations,
    )
    return [picks(problem, tasks, route) for route in routes]


def picks(problem: Problem, tasks: NDArray[np.intp], stops: list[int]) -> Picks:
    """Translate the core's stops: t is the first stop of ``tasks[t]``, n + t its last."""
    n = len(tasks)
    pairs = ((int(tasks[stop % n]), stop // n) for stop in stops)
    return tuple((task, stop_names(problem, task)[which]) for task, which in pairs)


def assignment(problem: Problem, found: list[Picks]) -> Assignment:
    """Put new routes behind what the robots already do; say why the other tasks are in none."""
    new = [to_route(problem, route) for route in found]
    routes = {robot: problem.routes[r] + new[r] for r, robot in enumerate(problem.robots)}
    done = {stop.task for route in routes.values() for stop in route}
    left = [p for p, task in enumerate(problem.tasks) if task not in done]
    return Assignment(routes=routes, unassigned=reasons(with_routes(problem, new), left))
