"""Assignments beyond one round: all tasks at once, and tasks that cannot wait."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from oath.allocate.contract import (
    Allocator,
    Budget,
    checked,
    reasons,
    stop_location,
    stop_names,
    to_route,
    with_routes,
)
from oath.allocate.problem import Aboard, Problem
from oath.model import Assignment, Route, RouteStop

TIE = 1e-6
"""Robots that complete a task within this time of each other are equally soon [s]."""


@dataclass(slots=True)
class _Fleet:
    """Where and when each robot will be free, as a plan grows."""

    problem: Problem
    at: NDArray[np.int32]
    """(R,) location."""
    time: NDArray[np.float64]
    """(R,) [s] from now."""

    @staticmethod
    def now(problem: Problem) -> _Fleet:
        return _Fleet(problem, problem.start.copy(), problem.ready.copy())

    def serve(self, robot: int, task: int, stop: str) -> None:
        """Send a robot to a stop of a task and let it work there."""
        self.go(robot, stop_location(self.problem, task, stop), self.problem.service_time[task])

    def go(self, robot: int, there: int, service: float) -> None:
        """Send a robot to a location and let it work there for some time [s]."""
        problem = self.problem
        travel = problem.cost[problem.mode[robot], self.at[robot], there]
        self.time[robot] += travel / problem.speed[robot] + service
        self.at[robot] = there


def plan_all(
    problem: Problem, allocator: Allocator, budget: Budget, rng: np.random.Generator
) -> Assignment:
    """Assign all tasks, round by round as a mission would: whenever a robot becomes idle.

    Travel takes cost / speed, each stop its service time. Every round sees all robots, from where
    their routes end; those still under way are busy. An allocator that assigns everything at once
    needs one round only. Robots that are busy from the start keep their routes and get nothing.

    Returns
    -------
    Assignment
        The concatenated routes. A task stays unassigned only if no robot that was idle at the start
        can do it, or may be given one more. What the allocator proves stands if one round did all.

    Raises
    ------
    ProviderError
        The allocator broke its contract in some round.
    """
    index = {task: i for i, task in enumerate(problem.tasks)}
    fleet = _Fleet.now(problem)
    fleet.time[problem.busy] = np.inf
    kept = {stop.task for route in problem.routes for stop in route}
    left = [i for i, task in enumerate(problem.tasks) if task not in kept]
    total: list[list[RouteStop]] = [list(route) for route in problem.routes]
    latest: list[Route] = list(problem.routes)
    proof, waiting = Assignment(routes={}, unassigned={}), len(left)
    clock = 0.0
    while left:
        busy = fleet.time > clock
        fleet.time = np.maximum(fleet.time, clock)  # the idle ones begin now
        latest = [route if on else () for route, on in zip(latest, busy, strict=True)]
        answer = checked(allocator, _rest(problem, left, fleet, busy, latest), budget, rng)
        new = [_new(answer.routes[robot], index, left) for robot in problem.robots]
        if len(left) == waiting:
            proof = answer
        elif any(new):
            proof = replace(proof, lower_bound=None, optimal=False)
        problem = with_routes(problem, new)
        for robot, route in enumerate(new):
            for stop in route:
                fleet.serve(robot, index[stop.task], stop.stop)
            total[robot] += route
            latest[robot] += route
        taken = {index[stop.task] for route in new for stop in route}
        left = [task for task in left if task not in taken]
        # A robot that stood at its stops already is idle again now, hence not only later times.
        served = np.array([bool(route) for route in new], dtype=np.bool_)
        ends = fleet.time[((fleet.time > clock) | served) & np.isfinite(fleet.time)]
        if ends.size:
            clock = float(ends.min())
        elif not taken:
            break  # everyone is idle, and nobody can do what is left
    routes = {robot: tuple(total[r]) for r, robot in enumerate(problem.robots)}
    return replace(proof, routes=routes, unassigned=reasons(problem, left))


def _rest(
    problem: Problem, left: list[int], fleet: _Fleet, busy: NDArray[np.bool_], routes: list[Route]
) -> Problem:
    """Return what is left to assign; tasks in routes count as carried, so they stay there."""
    return replace(problem.only(left), start=fleet.at.copy(), busy=busy, routes=tuple(routes))


def _new(route: Route, index: dict[str, int], left: list[int]) -> Route:
    open_ = set(left)
    return tuple(stop for stop in route if index.get(stop.task) in open_)


def urgent(problem: Problem, tasks: list[int]) -> Assignment:
    """Give each task to the robot that completes it soonest, before anything else that it does.

    Tasks are handled in the order of their indices; a robot that got one is free again where and
    when that one ends. Each is done on its own, so a robot needs room for one: if it has none, it
    delivers first what lets it begin soonest. Of robots that are equally soon, the one that is to
    do the task already keeps it.

    Parameters
    ----------
    tasks
        Indices of the tasks that cannot wait.

    Returns
    -------
    Assignment
        Routes to put before those of the other tasks, and why a task could not be given to anyone.
        Tasks that are not asked for are in neither.
    """
    fleet = _Fleet.now(problem)
    aboard = [list(loads) for loads in problem.aboard]
    able = problem.feasible()
    routes: dict[str, Route] = dict.fromkeys(problem.robots, ())
    missed = []
    given = np.zeros(len(problem.robots), dtype=np.int32)
    for task in sorted(tasks):
        able[given >= problem.max_tasks] = False
        ends = np.full(len(problem.robots), np.inf)
        unload: dict[int, Aboard | None] = {}
        for robot in np.flatnonzero(able[:, task]).tolist():
            ends[robot], unload[robot] = _soonest(fleet, robot, aboard[robot], task)
        best = float(ends.min()) if ends.size else np.inf
        if not np.isfinite(best):
            missed.append(task)
            continue
        soon = np.flatnonzero(ends <= best + TIE).tolist()
        robot = next((r for r in soon if _holds(problem, r, task)), soon[0])
        if load := unload[robot]:
            fleet.go(robot, load.delivery, load.service_time)
            aboard[robot].remove(load)
            routes[problem.robots[robot]] += (RouteStop(task=load.task, stop="delivery"),)
        names = stop_names(problem, task)
        for name in names:
            fleet.serve(robot, task, name)
        given[robot] += 1
        routes[problem.robots[robot]] += to_route(problem, [(task, name) for name in names])
    left = replace(problem, max_tasks=problem.max_tasks - given)
    return Assignment(routes=routes, unassigned=reasons(left, missed))


def _soonest(
    fleet: _Fleet, robot: int, aboard: list[Aboard], task: int
) -> tuple[float, Aboard | None]:
    """When a robot can complete a task [s from now], and what it must deliver before, if any."""
    problem, at = fleet.problem, int(fleet.at[robot])
    cost, speed = problem.cost[problem.mode[robot]], float(problem.speed[robot])
    pickup, delivery = int(problem.pickup[task]), int(problem.delivery[task])
    then = float(fleet.time[robot] + cost[pickup, delivery] * (not problem.visit[task]) / speed)
    if problem.visit[task] or len(aboard) < problem.capacity[robot]:
        return then + float(cost[at, pickup]) / speed, None
    ends = [
        float(cost[at, load.delivery] + cost[load.delivery, pickup]) / speed + load.service_time
        for load in aboard
    ]
    first = int(np.argmin(ends))
    return then + ends[first], aboard[first]


def _holds(problem: Problem, robot: int, task: int) -> bool:
    return any(stop.task == problem.tasks[task] for stop in problem.previous[robot])


def follow(problem: Problem, robot: int, stops: Route) -> tuple[float, float, int]:
    """Follow stops from where a robot is free: length [m], time at the stops [s], last location."""
    index = {task: p for p, task in enumerate(problem.tasks)}
    aboard = {load.task: load for load in problem.aboard[robot]}
    at, length, service = int(problem.start[robot]), 0.0, 0.0
    for stop in stops:
        if stop.task in index:
            task = index[stop.task]
            there = stop_location(problem, task, stop.stop)
            service += float(problem.service_time[task])
        else:
            there = aboard[stop.task].delivery
            service += aboard[stop.task].service_time
        length += float(problem.cost[problem.mode[robot], at, there])
        at = there
    return length, service, at
