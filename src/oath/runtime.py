"""The only loop: runs what dispatch asks for and feeds back what happens."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from oath.allocate import Allocator, Budget, ByPriority, checked
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
from oath.model import Mission, Obstacle, Route, Task
from oath.motion.planner import Planner, Service
from oath.scene import Scene, pose


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
        self._state = State.of(mission, reconsiders=allocator.reconsiders)
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
            elif isinstance(item, Allocate) and work:
                work.append(item)  # a round should know all that has happened
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
        to_go = {id: planner.to_go() for id, planner in self._planners.items()}
        problem = pose(self._scene, self._state, to_go)
        assignment = checked(ByPriority(self._allocator), problem, self._budget, self._rng)
        return Allocated(
            t=self._state.t,
            round=self._state.rounds + 1,
            seconds=time.perf_counter() - begin,
            routes=assignment.routes,
            unassigned=assignment.unassigned,
        )

    def _plan(self, robot: str, reason: PlanReason) -> Planned:
        at = self._fleet.cancel(robot, at_once=robot in self._state.failed)
        begin = time.perf_counter()
        plan = self._planners[robot].begin(at, self._services(robot))
        return self._planned(robot, reason, plan.length, plan.blocked, begin)

    def _repair(self, robot: str, obstacle: Obstacle) -> list[AnyEvent]:
        planner = self._planners[robot]
        if not planner.touches(obstacle):
            return []
        at = self._fleet.cancel(robot, at_once=True)
        begin = time.perf_counter()
        stale = self._state.robots[robot].stale
        plan = planner.begin(at, self._services(robot)) if stale else planner.replan(at)
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
