"""High priority first, low priority last, whoever allocates."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from oath.allocate.contract import Allocator, Budget, reasons, stop_location, with_routes
from oath.allocate.problem import WAITING, Problem
from oath.allocate.rounds import urgent
from oath.model import Assignment, Route


@dataclass(frozen=True, slots=True)
class ByPriority:
    """Allocates one priority after another with an allocator that knows of none.

    High: each task goes to the robot that can complete it soonest, before anything else. Low: only
    when every other task that can be done has a robot. Robots that got something are busy for the
    priorities after. What the inner allocator proves stands if all tasks are of one priority.
    """

    inner: Allocator

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to robots, see `Allocator`."""
        routes = dict(zip(problem.robots, problem.routes, strict=True))
        taken = {stop.task for route in problem.routes for stop in route}
        left = [p for p, task in enumerate(problem.tasks) if task not in taken]
        start, busy = problem.start.copy(), problem.busy.copy()
        proof = Assignment(routes=routes, unassigned={})
        alone = len({int(problem.priority[p]) for p in left}) == 1
        for priority in (1, 0, -1):
            chosen = [p for p in left if problem.priority[p] == priority]
            if not chosen:
                continue
            part = replace(
                problem.only(chosen),
                start=start.copy(),
                busy=busy.copy(),
                routes=tuple(routes[robot] for robot in problem.robots),
            )
            if priority == 1:
                first = urgent(part, list(range(len(chosen))))
                new = {robot: routes[robot] + first.routes[robot] for robot in problem.robots}
            else:
                answer = self.inner.allocate(part, budget, rng)
                new = dict(answer.routes)
                proof = answer if alone else proof
            problem = with_routes(problem, [new[robot][len(routes[robot]) :] for robot in new])
            for r, robot in enumerate(problem.robots):
                if new[robot] != routes[robot]:
                    start[r], busy[r] = _end(part, new[robot]), True
            routes = new
            done = {stop.task for route in routes.values() for stop in route}
            left = [p for p in left if problem.tasks[p] not in done]
            if WAITING in reasons(problem, set(chosen) & set(left)).values():
                break
        return replace(proof, routes=routes, unassigned=reasons(problem, left))


def _end(problem: Problem, route: Route) -> int:
    """Location where a route ends."""
    last = route[-1]
    return stop_location(problem, problem.tasks.index(last.task), last.stop)
