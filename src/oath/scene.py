"""A mission made ready: its world and rules, and its states posed as allocation problems."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from oath.allocate import Allocator, Budget, ByPriority, follow, plan_all, urgent
from oath.allocate.problem import Aboard, Problem
from oath.errors import BadInput
from oath.model import Assignment, Mission, Point, Robot, Route, RouteStop, Stop
from oath.motion.mission_automaton import Rules, compile_rules
from oath.state import State
from oath.world.passages import missed
from oath.world.roadmap import Params, World, build
from oath.world.travel import TravelCosts


@dataclass(frozen=True, slots=True)
class Scene:
    """A mission made ready: its roadmap with every stop on it, its rules, its travel costs."""

    mission: Mission
    world: World
    rules: Rules
    travel: TravelCosts


def prepare(mission: Mission, params: Params | None = None, seed: int = 0) -> Scene:
    """Build a mission's world and compile its rules.

    Raises
    ------
    BadInput
        If a rule is wrong.
    """
    known = {*mission.zones, *mission.places, *(task.id for task in mission.tasks)}
    rules = compile_rules(mission.rules, known, file=mission.source)
    world = build(mission, params, seed, relevant=rules.relevant)
    return Scene(mission, world, rules, TravelCosts(world.roadmap, rules.avoid))


def unreachable(scene: Scene) -> dict[str, str]:
    """Tasks that no robot can serve from its start, and why."""
    mission = scene.mission
    problem = pose(scene, State.of(mission))
    cost = problem.cost[problem.mode]
    found = {}
    for p in np.flatnonzero(~problem.feasible().any(axis=0)):
        task = mission.tasks[p]
        can = np.flatnonzero(problem.capability[:, problem.type[p]] > 0)
        there = np.isfinite(cost[can, problem.start[can], problem.pickup[p]])
        stop = task.stops[-1] if there.any() else task.stops[0]
        names = ", ".join(problem.robots[r] for r in can)
        found[task.id] = f"{stop.name} ({stop.at[0]:g}, {stop.at[1]:g}) is out of reach of {names}"
    return found


def require_reachable(scene: Scene) -> None:
    """Refuse a mission with a stop that no capable robot reaches.

    Raises
    ------
    BadInput
        Naming the first such task.
    """
    for id, problem in unreachable(scene).items():
        ids = [task.id for task in scene.mission.tasks]
        raise BadInput(
            f"task '{id}': {problem}",
            file=scene.mission.source,
            field=f"tasks[{ids.index(id)}]",
            remedy="move the stop, open a passage wider than the robots, relax a rule, "
            "or raise --points",
        )


@dataclass(frozen=True, slots=True)
class UnderWay:
    """A robot on its way to its next stop.

    Attributes
    ----------
    rest, to_rest
        Where its current move ends [m], and how far that is [m]: there it can turn.
    on
        How far it is from there to the stop [m].
    at_work
        It is at the stop already.
    """

    rest: Point
    to_rest: float
    on: float
    at_work: bool


def pose(
    scene: Scene, state: State, under_way: Mapping[str, UnderWay] = MappingProxyType({})
) -> Problem:
    """Put the open tasks and the robots of a state as an allocation problem.

    What a robot does already is fixed; but urgent tasks come first. Each is given to the robot that
    completes it soonest if it turns where its current move ends, whatever else was its next stop.
    """
    first: dict[str, Route] = {}
    busy = {state.robots[id].route[0].task for id, way in under_way.items() if way.at_work}
    if under_way and (tasks := [id for id in state.urgent() if id not in busy]):
        free = {
            RouteStop(task=id, stop=stop.name) for id in tasks for stop in state.tasks[id].stops
        }
        turning = _Posed(scene, state, under_way, free, None).problem()
        index = {task: p for p, task in enumerate(turning.tasks)}
        first = dict(urgent(turning, [index[task] for task in tasks]).routes)
    given = {stop for route in first.values() for stop in route}
    return _Posed(scene, state, under_way, given, first).problem()


_RANK = {"high": 1, "normal": 0, "low": -1}


class _Posed:
    """A state on its way to arrays: locations are numbered as they occur.

    Parameters
    ----------
    urgent
        Stops that are in no route but those of `first`.
    first
        What robots do before anything else; None = every robot that can turn is free to.
    """

    def __init__(
        self,
        scene: Scene,
        state: State,
        under_way: Mapping[str, UnderWay],
        urgent: Collection[RouteStop],
        first: Mapping[str, Route] | None,
    ) -> None:
        self.scene, self.state, self.under_way = scene, state, under_way
        self.robots, self.urgent, self.first = scene.mission.robots, frozenset(urgent), first
        self.fixed = [self._fixed(robot.id) for robot in self.robots]
        begun = {stop.task for route in self.fixed for stop in route if state.reconsiders}
        self.tasks = [state.tasks[id] for id in state.open_tasks() if id not in begun]
        self.places: dict[int, int] = {}

    def problem(self) -> Problem:
        """The arrays."""
        state, robots, tasks = self.state, self.robots, self.tasks
        roadmap = self.scene.world.roadmap
        types = list(self.scene.mission.task_types)
        start = [self._start(robot, route) for robot, route in self._fixed_routes()]
        first = [self._location(task.stops[0].at) for task in tasks]
        last = [self._location(task.stops[-1].at) for task in tasks]
        aboard = tuple(self._aboard(robot, route) for robot, route in self._fixed_routes())
        for robot, route in self._fixed_routes():
            if self._turns(robot, route):
                self._location(self._here(robot))
            for stop in route:
                self._location(self._stop(stop).at)
        nodes = list(self.places)
        modes = range(len(roadmap.modes))
        cost = np.array([self.scene.travel.between(mode, nodes) for mode in modes])
        refused = [[(robot.id, task.id) in state.refused for task in tasks] for robot in robots]
        loads = [self.state.deliverable(robot.id) for robot in robots]
        room = [
            robot.capacity - len(state.robots[robot.id].carrying) + len(load)
            for robot, load in zip(robots, loads, strict=True)
        ]
        return Problem(
            robots=tuple(robot.id for robot in robots),
            tasks=tuple(task.id for task in tasks),
            start=np.array(start, dtype=np.int32),
            pickup=np.array(first, dtype=np.int32),
            delivery=np.array(last, dtype=np.int32),
            visit=np.array([len(task.stops) == 1 for task in tasks], dtype=np.bool_),
            service_time=np.array([task.service_time for task in tasks], dtype=np.float64),
            type=np.array([types.index(task.type) for task in tasks], dtype=np.int32),
            types=tuple(types),
            priority=np.array([_RANK[task.priority] for task in tasks], dtype=np.int8),
            capability=np.array([self._capability(robot, types) for robot in robots]),
            capacity=np.array(room, dtype=np.int32),
            load=np.array([len(load) for load in loads], dtype=np.int32),
            max_tasks=np.full(len(robots), max(1, len(tasks)), dtype=np.int32),
            refused=np.array(refused, dtype=np.bool_).reshape(len(robots), len(tasks)),
            speed=np.array([robot.speed for robot in robots]),
            cost=cost,
            points=roadmap.nodes()[nodes].astype(np.float64).reshape(-1, 2),
            mode=np.array([self._mode(robot) for robot in robots], dtype=np.int32),
            busy=np.array([bool(route) for route in self.fixed], dtype=np.bool_),
            ready=np.array([self._ready(*pair, cost) for pair in self._fixed_routes()]),
            aboard=aboard,
            routes=tuple(self.fixed),
            previous=tuple(
                self._previous(robot.id, route) for robot, route in self._fixed_routes()
            ),
        )

    def _fixed_routes(self) -> list[tuple[Robot, Route]]:
        return list(zip(self.robots, self.fixed, strict=True))

    def _rest(self, robot: str) -> Route:
        """A robot's route less what is urgent."""
        route = self.state.robots[robot].route
        return tuple(stop for stop in route if stop not in self.urgent)

    def _fixed(self, robot: str) -> Route:
        """What a robot does in any case: its route, or its next stop if routes may change."""
        state, rest = self.state, self._rest(robot)
        if robot in state.paused:
            return rest
        next_stop = rest[:1] if rest[:1] == state.robots[robot].route[:1] else ()
        at_work = robot in self.under_way and self.under_way[robot].at_work
        if self.first is None:
            return next_stop if at_work else ()
        first = (next_stop if at_work else ()) + self.first.get(robot, ())
        if not state.reconsiders:
            return first + tuple(stop for stop in rest if stop not in first)
        return first or next_stop

    def _previous(self, robot: str, fixed: Route) -> Route:
        rest = self.state.robots[robot].route if self.first is None else self._rest(robot)
        return fixed + tuple(stop for stop in rest if stop not in fixed)

    def _stop(self, stop: RouteStop) -> Stop:
        return self.state.tasks[stop.task].stop(stop.stop)

    def _capability(self, robot: Robot, types: Sequence[str]) -> list[float]:
        works = robot.id not in self.state.failed | self.state.paused
        return [robot.can.get(name, 0.0) * works for name in types]

    def _mode(self, robot: Robot) -> int:
        return self.scene.world.mode_of[robot.id]

    def _location(self, at: Point) -> int:
        return self.places.setdefault(self.scene.world.roadmap.insert(at), len(self.places))

    def _start(self, robot: Robot, route: Route) -> int:
        """Where a robot can begin something new: where what is fixed ends, or where it stands."""
        return self._location(self._stop(route[-1]).at if route else self._here(robot))

    def _turns(self, robot: Robot, route: Route) -> bool:
        """Whether what is fixed begins with another stop than the one the robot drives to."""
        return route[:1] != self.state.robots[robot.id].route[:1]

    def _here(self, robot: Robot) -> Point:
        """Where a robot can turn."""
        if robot.id in self.under_way:
            return self.under_way[robot.id].rest
        return self.state.robots[robot.id].position

    def _ready(self, robot: Robot, route: Route, cost: NDArray[np.float64]) -> float:
        """When a robot can begin something new [s from now]."""
        way = self.under_way.get(robot.id)
        places = [self._location(self._stop(stop).at) for stop in route]
        length = 0.0
        if way is not None and self._turns(robot, route):
            length = way.to_rest
            places = [self._location(way.rest), *places]
        elif way is not None:
            length = way.to_rest + way.on
        length += sum(cost[self._mode(robot), a, b] for a, b in pairwise(places))
        service = sum(self.state.tasks[stop.task].service_time for stop in route)
        return float(length / robot.speed + service)

    def _aboard(self, robot: Robot, route: Route) -> tuple[Aboard, ...]:
        """What a robot carries after the stops that are fixed, and must still deliver."""
        ids = list(self.state.deliverable(robot.id))
        for stop in route:
            if stop.stop == "pickup":
                ids.append(stop.task)
            elif stop.stop == "delivery":
                ids.remove(stop.task)
        tasks = [self.state.tasks[id] for id in ids]
        return tuple(
            Aboard(
                task=task.id,
                delivery=self._location(task.stops[-1].at),
                service_time=task.service_time,
            )
            for task in tasks
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Assigned:
    """One static assignment of all tasks, its wall clock [s], length [m] and makespan [s]."""

    assignment: Assignment
    seconds: float
    total_distance: float
    makespan: float


def assign(
    scene: Scene, allocator: Allocator, budget: Budget, seed: int, max_tasks: int | None = None
) -> Assigned:
    """Assign all tasks of a mission at once, without executing anything.

    Parameters
    ----------
    max_tasks
        Tasks that a robot may be given in all; None = any number.
    """
    begin = time.perf_counter()
    problem = pose(scene, State.of(scene.mission))
    if max_tasks is not None:
        most = np.minimum(problem.max_tasks, max_tasks)
        problem = replace(problem, max_tasks=most.astype(np.int32))
    rng = np.random.default_rng(seed)
    assignment = plan_all(problem, ByPriority(allocator), budget, rng)
    seconds = time.perf_counter() - begin
    lengths, times = [0.0], [0.0]
    for r, robot in enumerate(problem.robots):
        route = assignment.routes[robot]
        length, service, _ = follow(problem, r, route)
        lengths.append(length)
        times.append(length / problem.speed[r] + service)
    return Assigned(
        assignment=assignment,
        seconds=seconds,
        total_distance=sum(lengths),
        makespan=max(times),
    )


def lint(scene: Scene) -> list[str]:
    """What looks odd about a mission, in words."""
    mission, roadmap = scene.mission, scene.world.roadmap
    found = []
    needed = {task.type for task in mission.tasks}
    for robot in mission.robots:
        if not needed & robot.can.keys():
            found.append(f"robot '{robot.id}' can do none of the mission's tasks")
    for name in mission.task_types:
        if name not in needed:
            found.append(f"no task is of type '{name}'")
    automaton = scene.rules.automaton
    for robot in mission.robots:
        here = roadmap.zones.at(robot.start)
        if not any(automaton.settles(q, here) for q in automaton.initial):
            found.append(
                f"robot '{robot.id}' breaks the rules if it is given no task: they oblige it to do "
                "something (!x W y obliges nobody, !x U y and F y do)"
            )
    for m, mode in enumerate(roadmap.modes):
        who = f"{mode.motion.name} robots of radius {mode.radius:g} m"
        for gap in missed(roadmap, m):
            found.append(
                f"about {gap.area:.1f} m2 near ({gap.at[0]:g}, {gap.at[1]:g}) has room for {who}, "
                "but the roadmap has no way there; raise --points if a passage leads there"
            )
    return found
