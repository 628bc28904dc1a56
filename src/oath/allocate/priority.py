"""High priority first, low priority last, whoever allocates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from oath.allocate.contract import Allocator, Budget, reasons, with_routes
from oath.allocate.problem import WAITING, Problem
from oath.allocate.rounds import follow, urgent
from oath.model import Assignment, Route


@dataclass(frozen=True, slots=True)
class ByPriority:
    """Allocates one priority after another with an allocator that knows of none.

    High: each task goes to the robot that can complete it soonest, before anything else. Low: only
    when every other task that can be done has a robot. Robots that got something are busy for the
    priorities after.
    """

    inner: Allocator

    @property
    def reconsiders(self) -> bool:
        """As the allocator behind it."""
        return self.inner.reconsiders

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to robots, see `Allocator`."""
        rest = problem
        if budget.seconds is not None and (problem.priority < 0).any():
            budget = replace(budget, seconds=budget.seconds / 2)  # what is low is asked for apart
        proof = Assignment(routes={}, unassigned={})
        alone = len(set(problem.priority.tolist())) == 1
        for lowest in (1, 0, -1):
            taken = {stop.task for route in rest.routes for stop in route}
            chosen = [
                p
                for p, task in enumerate(problem.tasks)
                if task not in taken and problem.priority[p] >= lowest
            ]
            if not chosen and not (lowest == 0 and any(rest.aboard)):
                continue
            part = replace(
                problem.only(chosen),
                start=rest.start,
                ready=rest.ready,
                busy=rest.busy,
                routes=rest.routes,
                aboard=rest.aboard,
                max_tasks=rest.max_tasks,
            )
            if lowest == 1:
                first = urgent(part, list(range(len(chosen))))
                new = {robot: old + first.routes[robot] for robot, old in _by_robot(rest)}
            else:
                answer = self.inner.allocate(part, budget, rng)
                new = dict(answer.routes)
                proof = answer if alone else proof
            rest = _after(rest, new)
            done = {stop.task for route in rest.routes for stop in route}
            left = [p for p in chosen if problem.tasks[p] not in done]
            if lowest < 1 and WAITING in reasons(_bare(problem, rest), left).values():
                break
        done = {stop.task for route in rest.routes for stop in route}
        left = [p for p, task in enumerate(problem.tasks) if task not in done]
        why = reasons(_bare(problem, rest), left)
        return replace(proof, routes=dict(_by_robot(rest)), unassigned=why)


def _by_robot(problem: Problem) -> list[tuple[str, Route]]:
    return list(zip(problem.robots, problem.routes, strict=True))


def _after(problem: Problem, routes: Mapping[str, Route]) -> Problem:
    """The problem once these routes are fixed: robots are free where and when they end."""
    start, ready, busy = problem.start.copy(), problem.ready.copy(), problem.busy.copy()
    aboard, given = list(problem.aboard), []
    for r, (robot, old) in enumerate(_by_robot(problem)):
        new = routes[robot][len(old) :]
        loaded = {load.task for load in aboard[r]}
        given.append(tuple(stop for stop in new if stop.task not in loaded))
        if not new:
            continue
        length, service, start[r] = follow(problem, r, new)
        ready[r] += length / problem.speed[r] + service
        busy[r] = True
        delivered = {stop.task for stop in new}
        aboard[r] = tuple(load for load in aboard[r] if load.task not in delivered)
    fixed = tuple(routes[robot] for robot in problem.robots)
    rest = replace(problem, start=start, ready=ready, busy=busy, routes=fixed, aboard=tuple(aboard))
    return with_routes(rest, given)


def _bare(problem: Problem, rest: Problem) -> Problem:
    """The problem as it was, but for how many tasks robots may still be given."""
    return replace(problem, max_tasks=rest.max_tasks)
