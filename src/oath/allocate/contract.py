"""The seam behind which allocators stand, and the check of what they return."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from oath.allocate.problem import WAITING, Problem
from oath.errors import ProviderError
from oath.model import Assignment, Route, RouteStop, StopName


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """How long an allocator may improve its answer; None = as it likes.

    Iterations make a run reproducible, seconds of wall clock suit a mission.
    """

    seconds: float | None = None
    iterations: int | None = None


class Allocator(Protocol):
    """Gives routes to robots.

    One that `reconsiders` is asked again whenever something changes, and may change all of a route
    but its next stop; of one that does not, idle robots get tasks, and busy ones keep theirs.

    Law: every task of the problem stands in one route or in `unassigned`, never in both; every
    robot has a route, ``()`` if it does nothing; what a robot carries stays with it; the same
    problem, iterations and seed give the same assignment.
    """

    @property
    def reconsiders(self) -> bool:
        """Whether routes that are under way may change."""
        ...

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Return the new routes of all robots, which replace the old ones."""
        ...


def stop_names(problem: Problem, task: int) -> tuple[StopName, ...]:
    """Return the names of a task's stops in order."""
    return ("visit",) if problem.visit[task] else ("pickup", "delivery")


def stop_location(problem: Problem, task: int, stop: str) -> int:
    """Return the location of a task's stop."""
    return int(problem.delivery[task] if stop == "delivery" else problem.pickup[task])


def with_routes(problem: Problem, routes: Sequence[Route]) -> Problem:
    """Return the problem with `max_tasks` lower by what new routes, one per robot, give."""
    given = [len({stop.task for stop in route}) for route in routes]
    most = np.maximum(problem.max_tasks - np.array(given, dtype=np.int32), 0)
    return replace(problem, max_tasks=most.astype(np.int32))


def reasons(problem: Problem, tasks: Iterable[int]) -> dict[str, str]:
    """Say why tasks are in no route: the first condition that no robot meets, else `WAITING`.

    Parameters
    ----------
    tasks
        Indices of the tasks.
    """
    feasible: NDArray[np.bool_] = np.any(problem.feasible(), axis=0)
    return {
        problem.tasks[task]: WAITING if feasible[task] else _why_not(problem, task)
        for task in tasks
    }


def _why_not(problem: Problem, task: int) -> str:
    type_ = int(problem.type[task])
    name = problem.types[type_] if problem.types else str(type_)
    able = np.flatnonzero(problem.capability[:, type_] > 0)
    if not able.size:
        return f"no robot can do type '{name}'"
    pickup, delivery = problem.pickup[task], problem.delivery[task]
    able = able[np.isfinite(problem.cost[problem.mode[able], problem.start[able], pickup])]
    if not able.size:
        return "no capable robot reaches its pickup"
    able = able[np.isfinite(problem.cost[problem.mode[able], pickup, delivery])]
    if not able.size:
        return "no capable robot reaches its delivery"
    able = able[(problem.capacity[able] > 0) | problem.visit[task]]
    if not able.size:
        return "no room: the robots that could take it are full"
    able = able[problem.max_tasks[able] > 0]
    if not able.size:
        return "every robot that could take it has as many tasks as it may be given (max_tasks)"
    return "every robot that could take it would break a rule"


def checked(
    allocator: Allocator, problem: Problem, budget: Budget, rng: np.random.Generator
) -> Assignment:
    """Allocate, and check what came back against the contract.

    Raises
    ------
    ProviderError
        A robot without a route, an unknown robot, task or stop; a task lost, doubled, or both
        assigned and not; a last stop before the first; a load above capacity; a robot that cannot
        do the type or reach a stop; more new tasks than `max_tasks`; a carried task dropped or
        moved. A route that is the same as before is taken as it is.
    """
    answer = allocator.allocate(problem, budget, rng)
    _Check(problem, type(allocator).__name__).assignment(answer)
    return answer


class _Check:
    def __init__(self, problem: Problem, name: str) -> None:
        self.problem, self.name = problem, name
        self.index = {task: i for i, task in enumerate(problem.tasks)}

    def fail(self, what: str) -> None:
        raise ProviderError(f"allocator {self.name}: {what}")

    def assignment(self, answer: Assignment) -> None:
        robots = self.problem.robots
        for robot in set(robots) ^ set(answer.routes):
            self.fail(f"robot '{robot}' " + ("has no route" if robot in robots else "is unknown"))
        for r, robot in enumerate(robots):
            route = answer.routes[robot]
            self._carried(r, route)
            if route != self.problem.routes[r]:
                self._route(r, route)
                self._count(r, route)
        self._tasks(answer)

    def _tasks(self, answer: Assignment) -> None:
        """Every open task stands in one place, with all of its stops in order."""
        stops: dict[str, list[StopName]] = {}
        owner: dict[str, str] = {}
        for robot, route in answer.routes.items():
            for stop in route:
                if stop.task not in self.index:
                    continue
                stops.setdefault(stop.task, []).append(stop.stop)
                if owner.setdefault(stop.task, robot) != robot:
                    self.fail(f"task '{stop.task}' is split among '{owner[stop.task]}', '{robot}'")
        for task in answer.unassigned.keys() - self.index.keys():
            self.fail(f"unassigned task '{task}' is unknown")
        for task, i in self.index.items():
            if (task in stops) == (task in answer.unassigned):
                where = "both in a route and unassigned" if task in stops else "lost"
                self.fail(f"task '{task}' is {where}")
            if task in stops and tuple(stops[task]) != stop_names(self.problem, i):
                self.fail(f"task '{task}' has the stops {stops[task]} in this order")

    def _carried(self, r: int, route: Route) -> None:
        """Stops of tasks that are no longer open stay with their robot."""
        robot, index = self.problem.robots[r], self.index
        before = [stop for stop in self.problem.routes[r] if stop.task not in index]
        before += [RouteStop(task=t.task, stop="delivery") for t in self.problem.aboard[r]]
        after = [stop for stop in route if stop.task not in index]
        for stop in set(before) - set(after):
            self.fail(f"robot '{robot}' drops the {stop.stop} of '{stop.task}', which it carries")
        for stop in set(after) - set(before):
            self.fail(f"robot '{robot}' is sent to the {stop.stop} of unknown task '{stop.task}'")
        if len(after) != len(before):
            self.fail(f"robot '{robot}' serves a stop twice")

    def _route(self, r: int, route: Route) -> None:
        """Load, capability and reach along a route that is new."""
        problem, robot = self.problem, self.problem.robots[r]
        cost = problem.cost[problem.mode[r]]
        load, at = int(problem.load[r]), int(problem.start[r])
        old = problem.routes[r]
        # The start is where the old route ends: what it led to was reachable from elsewhere.
        new_from = len(old) if route[: len(old)] == old else 0
        for i, stop in enumerate(route):
            load += {"pickup": 1, "delivery": -1}.get(stop.stop, 0)
            if load > problem.capacity[r]:
                self.fail(f"robot '{robot}' carries {load}, its room is {problem.capacity[r]}")
            task = self.index.get(stop.task)
            if task is None or i < new_from:
                continue
            if problem.capability[r, problem.type[task]] <= 0:
                self.fail(f"robot '{robot}' cannot do the type of task '{stop.task}'")
            there = stop_location(problem, task, stop.stop)
            if not np.isfinite(cost[at, there]):
                self.fail(f"robot '{robot}' cannot reach the {stop.stop} of task '{stop.task}'")
            at = there

    def _count(self, r: int, route: Route) -> None:
        before = {stop.task for stop in self.problem.routes[r]}
        before |= {load.task for load in self.problem.aboard[r]}
        new = len({stop.task for stop in route} - before)
        most = self.problem.max_tasks[r]
        if new > most:
            self.fail(f"robot '{self.problem.robots[r]}' is given {new} tasks, its limit is {most}")


def to_route(problem: Problem, picks: Iterable[tuple[int, StopName]]) -> Route:
    """Return (task index, stop) pairs as a route."""
    return tuple(RouteStop(task=problem.tasks[task], stop=stop) for task, stop in picks)
