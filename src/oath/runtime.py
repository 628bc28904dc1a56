"""The only loop: runs what dispatch asks for and feeds back what happens."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from oath.allocate import Allocator, Budget, ByPriority, checked, plan_all, route_length
from oath.allocate.problem import Problem
from oath.dispatch import (
    Action,
    Allocate,
    Drive,
    Finish,
    Plan,
    Repair,
    State,
    UpdateMap,
    advance,
)
from oath.errors import BadInput
from oath.events import (
    Allocated,
    AnyEvent,
    Event,
    MissionFinished,
    MissionStarted,
    Moved,
    ObstacleFound,
    Planned,
    PlanReason,
    StopServed,
)
from oath.fleet import Fleet, Order
from oath.model import Assignment, Mission, Obstacle, Point, Route, Task
from oath.motion.mission_automaton import Rules, compile_rules
from oath.motion.planner import Planner, Service
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


def pose(scene: Scene, state: State) -> Problem:
    """Put the open tasks and the robots of a state as an allocation problem."""
    mission, world = scene.mission, scene.world
    tasks = [state.tasks[id] for id in state.open_tasks()]
    robots = mission.robots
    types = list(mission.task_types)
    places: dict[int, int] = {}

    def location(at: Point) -> int:
        return places.setdefault(world.roadmap.insert(at), len(places))

    start = [location(_free_at(state, robot.id)) for robot in robots]
    first = [location(task.stops[0].at) for task in tasks]
    last = [location(task.stops[-1].at) for task in tasks]
    stranded = [sum(t in state.stranded for t in state.robots[r.id].carrying) for r in robots]
    routed = [state.robots[robot.id].route for robot in robots]
    nodes = list(places)
    cost = [scene.travel.between(mode, nodes) for mode in range(len(world.roadmap.modes))]
    return Problem(
        robots=tuple(robot.id for robot in robots),
        tasks=tuple(task.id for task in tasks),
        start=np.array(start, dtype=np.int32),
        pickup=np.array(first, dtype=np.int32),
        delivery=np.array(last, dtype=np.int32),
        visit=np.array([len(task.stops) == 1 for task in tasks], dtype=np.bool_),
        service_time=np.array([task.service_time for task in tasks], dtype=np.float64),
        type=np.array([types.index(task.type) for task in tasks], dtype=np.int32),
        capability=np.array([[robot.can.get(t, 0.0) for t in types] for robot in robots]),
        capacity=np.array(
            [robot.capacity - n for robot, n in zip(robots, stranded, strict=True)], dtype=np.int32
        ),
        speed=np.array([robot.speed for robot in robots]),
        cost=np.array(cost),
        mode=np.array([world.mode_of[robot.id] for robot in robots], dtype=np.int32),
        busy=np.array([bool(route) for route in routed], dtype=np.bool_),
        refused=np.array(
            [[(robot.id, task.id) in state.refused for task in tasks] for robot in robots],
            dtype=np.bool_,
        ).reshape(len(robots), len(tasks)),
        routes=tuple(routed),
        types=tuple(types),
        max_tasks=np.full(len(robots), max(1, len(tasks)), dtype=np.int32),
        priority=np.array([_RANK[task.priority] for task in tasks], dtype=np.int8),
    )


_RANK = {"high": 1, "normal": 0, "low": -1}


def _free_at(state: State, robot: str) -> Point:
    """Where a robot can begin something new: where it stands, or where its route ends."""
    here = state.robots[robot]
    if not here.route:
        return here.position
    last = here.route[-1]
    return state.tasks[last.task].stop(last.stop).at


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
        length, service = route_length(problem, r, route)
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
    for m, mode in enumerate(roadmap.modes):
        who = f"{mode.motion.name} robots of radius {mode.radius:g} m"
        for gap in missed(roadmap, m):
            found.append(
                f"about {gap.area:.1f} m2 near ({gap.at[0]:g}, {gap.at[1]:g}) has room for {who}, "
                "but the roadmap has no way there; raise --points if a passage leads there"
            )
    return found


@dataclass(frozen=True, slots=True)
class Result:
    """What a run leaves behind: its summary, its events in order, and the scene as it was known."""

    summary: dict[str, Any]
    events: tuple[AnyEvent, ...]
    scene: Scene


class Runtime:
    """Runs one mission.

    Parameters
    ----------
    scene, fleet
        The mission made ready, and the robots.
    name, allocator, budget, seed
        How tasks are assigned.
    on_event
        Called with every event before it is applied: the journal, the progress bar.
    """

    def __init__(
        self,
        scene: Scene,
        fleet: Fleet,
        *,
        name: str,
        allocator: Allocator,
        budget: Budget,
        seed: int,
        on_event: Callable[[AnyEvent], None] = lambda event: None,
    ) -> None:
        self._scene, self._fleet = scene, fleet
        self._name, self._allocator, self._budget, self._seed = name, allocator, budget, seed
        self._on_event = on_event
        mission, world = scene.mission, scene.world
        self._obstacles = {obstacle.id: obstacle for obstacle in mission.map.obstacles}
        self._planners = {
            robot.id: Planner(world.roadmap, scene.rules, world.mode_of[robot.id], robot.start)
            for robot in mission.robots
        }
        self._state = State.of(mission)
        self._events: list[AnyEvent] = []
        self._rng = np.random.default_rng(seed)

    def run(self) -> Result:
        """Run the mission to its end; every task is then done or has a reason why not."""
        started = MissionStarted(
            t=0.0, mission=self._scene.mission.name, allocator=self._name, seed=self._seed
        )
        self._apply([started])
        while not self._state.finished:
            due = self._fleet.events()
            self._apply(due if due else [self._finished()])
        last = self._events[-1]
        assert isinstance(last, MissionFinished)
        return Result(dict(last.summary), tuple(self._events), self._scene)

    def _apply(self, events: Sequence[AnyEvent]) -> None:
        """Apply events in order, each with all that follows from it before the next."""
        # What is computed for one state must not wait until another event has changed it.
        work: deque[AnyEvent | Action] = deque(events)
        while work:
            item = work.popleft()
            if isinstance(item, Event):
                self._on_event(item)
                self._events.append(item)
                self._track(item)
                self._state, actions = advance(self._state, item)
                work.extendleft(reversed(actions))
            else:
                work.extendleft(reversed(self._perform(item)))

    def _track(self, event: AnyEvent) -> None:
        if isinstance(event, Moved):
            self._planners[event.robot].moved(event.to)
        elif isinstance(event, StopServed):
            self._planners[event.robot].served()

    def _perform(self, action: Action) -> list[AnyEvent]:
        match action:
            case Allocate():
                return [self._allocate()]
            case Plan(robot, reason):
                return [self._plan(robot, reason)]
            case Repair(robot, obstacle):
                return self._repair(robot, self._obstacles[obstacle])
            case Drive(robot):
                self._drive(robot)
            case UpdateMap(obstacle):
                edges = self._scene.world.roadmap.add_obstacle(self._obstacles[obstacle])
                for planner in self._planners.values():
                    planner.update(edges)
            case Finish():
                pass  # `run` ends when no robot reports anything any more
        return []

    def _allocate(self) -> Allocated:
        begin = time.perf_counter()
        problem = pose(self._scene, self._state)
        assignment = checked(ByPriority(self._allocator), problem, self._budget, self._rng)
        return Allocated(
            t=self._state.t,
            round=self._state.rounds + 1,
            seconds=time.perf_counter() - begin,
            routes=assignment.routes,
            unassigned=assignment.unassigned,
        )

    def _plan(self, robot: str, reason: PlanReason) -> Planned:
        at = self._fleet.cancel(robot, at_once=False)
        begin = time.perf_counter()
        plan = self._planners[robot].begin(at, self._services(robot))
        return self._planned(robot, reason, plan.length, plan.blocked, begin)

    def _repair(self, robot: str, obstacle: Obstacle) -> list[AnyEvent]:
        planner = self._planners[robot]
        if not planner.touches(obstacle):
            return []
        at = self._fleet.cancel(robot, at_once=True)
        begin = time.perf_counter()
        plan = planner.replan(at)
        return [self._planned(robot, "obstacle", plan.length, plan.blocked, begin)]

    def _planned(
        self, robot: str, reason: PlanReason, length: float, blocked: int | None, begin: float
    ) -> Planned:
        seconds = time.perf_counter() - begin
        route = self._state.robots[robot].route
        return Planned(
            t=self._state.t,
            robot=robot,
            seconds=seconds,
            length=length if blocked is None else None,
            reason=reason,
            unreachable=route[blocked].task if blocked is not None and route else None,
        )

    def _services(self, robot: str) -> list[Service]:
        route: Route = self._state.robots[robot].route
        zones = self._scene.world.roadmap.zones
        services = []
        for entry in route:
            task: Task = self._state.tasks[entry.task]
            stop = task.stop(entry.stop)
            letter = zones.at(stop.at)
            if stop is task.stops[-1]:
                letter |= {task.id}
            services.append(Service(at=stop.at, own=f"{task.id}@{stop.name}", letter=letter))
        return services

    def _drive(self, robot: str) -> None:
        entry = self._state.robots[robot].route[0]
        order = Order(
            path=tuple(self._planners[robot].leg()),
            task=entry.task,
            stop=entry.stop,
            service_time=self._state.tasks[entry.task].service_time,
        )
        self._fleet.send(robot, order)

    def _finished(self) -> MissionFinished:
        summary = summarise(self._scene.mission, self._state, self._events)
        return MissionFinished(t=self._state.t, summary=summary)


def summarise(mission: Mission, state: State, events: Sequence[AnyEvent]) -> dict[str, Any]:
    """Sum up a run; lengths [m], times [s], `total_steps` counts moves."""
    started = next(event for event in events if isinstance(event, MissionStarted))
    per_robot = {robot.id: {"steps": 0, "distance": 0.0, "tasks": 0} for robot in mission.robots}
    makespan = allocation = planning = 0.0
    rounds = replans = 0
    for event in events:
        match event:
            case Moved():
                per_robot[event.robot]["steps"] += 1
                per_robot[event.robot]["distance"] += math.dist(event.from_, event.to)
            case StopServed():
                makespan = event.t
                is_last = event.stop == state.tasks[event.task].stops[-1].name
                per_robot[event.robot]["tasks"] += int(is_last)
            case Allocated():
                rounds, allocation = event.round, allocation + event.seconds
            case Planned():
                planning += event.seconds
                replans += int(event.reason != "allocated")
            case ObstacleFound() | _:
                pass
    return {
        "mission": mission.name,
        "allocator": started.allocator,
        "seed": started.seed,
        "robots": len(mission.robots),
        "tasks": len(state.tasks),
        "completed": len(state.completed),
        "unserved": state.unserved(),
        "total_steps": sum(robot["steps"] for robot in per_robot.values()),
        "total_distance": sum(robot["distance"] for robot in per_robot.values()),
        "makespan": makespan,
        "allocation_seconds": allocation,
        "planning_seconds": planning,
        "total_running_time": allocation + planning + makespan,
        "rounds": rounds,
        "replans": replans,
        "per_robot": per_robot,
    }
