"""The only loop: runs what dispatch asks for and feeds back what happens."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from oath.allocate import Allocator, Budget, ByPriority, checked
from oath.allocate.problem import Problem
from oath.commands import Command, Live, admit
from oath.dispatch import (
    Action,
    Allocate,
    Drive,
    Plan,
    Repair,
    UpdateMap,
    advance,
    failure,
    fold,
)
from oath.events import (
    Allocated,
    AnyEvent,
    MissionFinished,
    MissionStarted,
    Moved,
    ObstacleFound,
    Planned,
    PlanReason,
    RobotFailed,
    RobotPaused,
    StopServed,
)
from oath.fleet import Fleet, Order, Pose
from oath.model import Mission, Obstacle, Point, Route, RouteStop, Task
from oath.motion.planner import Planner, Service
from oath.preview import preview
from oath.scene import Scene, UnderWay, pose
from oath.state import State


@dataclass(frozen=True, slots=True)
class Result:
    """What a run leaves behind: its summary, its events in order, and the scene as it was known."""

    summary: dict[str, Any]
    events: tuple[AnyEvent, ...]
    scene: Scene


class Runtime:
    """Runs one mission: `start` or `resume` it, `advance` its clock, `command`, `finish` it.

    Parameters
    ----------
    scene, fleet
        The mission made ready, and the robots.
    name, allocator, budget, seed
        How tasks are assigned.
    journal
        Called with the events that happen together, before any of them is applied.
    solver
        Works out assignments while the mission goes on; None lets the mission wait for them.
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
        journal: Callable[[Sequence[AnyEvent]], None] = lambda events: None,
        solver: Executor | None = None,
    ) -> None:
        self.scene = scene
        self._solver = solver
        self._solving: Future[Allocated] | None = None
        self._fleet, self._journal = fleet, journal
        self._name, self._allocator, self._budget, self._seed = name, allocator, budget, seed
        mission, world = scene.mission, scene.world
        self._planners = {
            robot.id: Planner(world.roadmap, scene.rules, world.mode_of[robot.id], robot.start)
            for robot in mission.robots
        }
        self.state = State.of(mission, reconsiders=allocator.reconsiders)
        self.events: list[AnyEvent] = []
        self.now = 0.0
        """Mission clock [s]: everything until then has happened."""
        self._rng = np.random.default_rng(seed)

    def run(self, script: Iterable[tuple[float, Callable[[], None]]] = ()) -> Result:
        """Run the mission to its end; every task is then done or has a reason why not.

        Parameters
        ----------
        script
            What else is to be done during the mission, and when [s]; in order.
        """
        self.start()
        for at, act in script:
            self.advance(at)
            act()
        self.advance()
        return self.finish()

    def start(self) -> None:
        """Begin the mission."""
        name = self.scene.mission.name
        self._apply([MissionStarted(t=0.0, mission=name, allocator=self._name, seed=self._seed)])

    def follow(self, events: Iterable[AnyEvent]) -> None:
        """Take up what happened before, and do nothing about it until `resume`."""
        for run, state, actions in fold(self.state, events):
            for event in run:
                self._track(event)
            self.events += run
            self.state = state
            for action in actions:
                if isinstance(action, UpdateMap):
                    self._perform(action)

    def resume(self, events: Iterable[AnyEvent] = ()) -> None:
        """Go on where events end; the fleet's robots must stand where they were last seen."""
        self.follow(events)
        self.now = self.state.t
        if self.state.finished or not self.events:
            return
        self._rng = np.random.default_rng((self._seed, self.state.rounds))
        due: list[Action] = [
            Plan(id, "command") for id, robot in self.state.robots.items() if robot.route
        ]
        self._work(deque([*due, *[Allocate()] * self.state.allocating]))

    def advance(self, until: float = math.inf) -> None:
        """Let everything happen that happens until some time [s]; by default, all there is."""
        while self.step(until):
            pass

    def step(self, until: float = math.inf) -> bool:
        """Let the next thing happen if it does until some time [s]; say whether it did."""
        self.collect()
        due = self._fleet.events(until)
        if not due and until == math.inf and self._solving is not None:
            self.collect(wait=True)
            return True
        self._apply(due)
        reached = until if not due and until < math.inf else 0.0
        self.now = max(self.now, self.state.t, reached)
        return bool(due)

    def collect(self, *, wait: bool = False) -> None:
        """Take up the answer of the solver if it has one, or wait for it."""
        if self._solving is not None and (wait or self._solving.done()):
            answer, self._solving = self._solving.result(), None
            if not self.state.finished:
                self._apply([replace(answer, t=max(self.now, self.state.t))])

    def poses(self) -> Mapping[str, Pose]:
        """Where every robot is now."""
        return self._fleet.poses()

    def ways(self) -> dict[str, list[Point]]:
        """What robots will drive to their next stops [m], from where they were last seen."""
        return {
            id: self._planners[id].way() for id, robot in self.state.robots.items() if robot.route
        }

    def live(self) -> Live:
        """The mission as it is now."""
        poses = {robot: pose.at for robot, pose in self._fleet.poses().items()}
        state = replace(self.state, t=max(self.now, self.state.t))
        return Live(self.scene, state, poses)

    def command(self, commands: Sequence[Command], source: str) -> tuple[AnyEvent, ...]:
        """Carry out commands, all or none; return what happened first of all.

        Parameters
        ----------
        commands
            Applied in order, each in the world that those before it make.
        source
            Who asks, for the journal.

        Raises
        ------
        BadInput
            If one of them is not possible; then nothing has changed.
        """
        self.advance(self.now)
        events = admit(self.live(), commands, source).events
        # Robots that must stand come to rest first: the log says where before it says why.
        for event in events:
            if isinstance(event, RobotPaused | RobotFailed):
                self._fleet.cancel(event.robot, at_once=True)
        self._apply(self._fleet.events(self.now))
        self._together(events)
        return events

    def preview(self, commands: Sequence[Command]) -> tuple[str, ...]:
        """Say what commands would do to the robots' routes; see `oath.preview.preview`."""
        return preview(self.live(), commands, self._under_way(), self._allocator, self._seed)

    def finish(self) -> Result:
        """End the mission; what is not done then has a reason."""
        summary = summarise(self.scene.mission, self.state, self.events)
        self._apply([MissionFinished(t=self.state.t, summary=summary)])
        return Result(summary, tuple(self.events), self.scene)

    def _apply(self, events: Sequence[AnyEvent]) -> None:
        """Apply events in order, each with all that follows from it before the next."""
        # What is computed for one state must not wait until another event has changed it.
        for event in events:
            if isinstance(event, RobotFailed):
                at = self.state.robots[event.robot].position
                self._together(failure(self.state, event.robot, at))
            else:
                self._together([event])

    def _together(self, events: Sequence[AnyEvent]) -> None:
        """Apply events that make one change, then all that follows from them."""
        self._work(deque([tuple(events)]))

    def _work(self, work: deque[tuple[AnyEvent, ...] | Action]) -> None:
        while work:
            item = work.popleft()
            if isinstance(item, tuple):
                work.extendleft(reversed(self._happen(item)))
            elif isinstance(item, Allocate) and work:
                work.append(item)  # a round should know all that has happened
            else:
                work.extendleft((event,) for event in reversed(self._perform(item)))

    def _happen(self, events: tuple[AnyEvent, ...]) -> list[Action]:
        self._journal(events)
        follow: list[Action] = []
        for event in events:
            self.events.append(event)
            self._track(event)
            self.state, actions = advance(self.state, event)
            follow += actions
        return follow

    def _track(self, event: AnyEvent) -> None:
        if isinstance(event, Moved):
            self._planners[event.robot].moved(event.to)
        elif isinstance(event, StopServed):
            self._planners[event.robot].served(self._service(event.task, event.stop).letter)

    def _perform(self, action: Action) -> list[AnyEvent]:
        match action:
            case Allocate():
                return self._allocate()
            case Plan(robot, reason):
                return [self._plan(robot, reason)]
            case Repair(robot, obstacle):
                return self._repair(robot, self.state.obstacles.get(obstacle))
            case Drive(robot):
                self._drive(robot)
            case UpdateMap(obstacle):
                self._update_map(obstacle)
        return []

    def _update_map(self, obstacle: str) -> None:
        """Bring an obstacle of the map in line with the state: it may have come and gone."""
        roadmap, known = self.scene.world.roadmap, self.state.obstacles.get(obstacle)
        if known == roadmap.workspace.obstacles.get(obstacle):
            return
        edges = roadmap.remove_obstacle(obstacle) if known is None else roadmap.add_obstacle(known)
        for planner in self._planners.values():
            planner.update(edges)

    def _allocate(self) -> list[AnyEvent]:
        begin = time.perf_counter()
        problem = pose(self.scene, self.state, self._under_way())
        solve = partial(self._solve, problem, self.state.rounds, begin)
        if self._solver is None:
            return [replace(solve(), t=self.state.t)]
        self._solving = self._solver.submit(solve)
        return []

    def _solve(self, problem: Problem, round: int, begin: float) -> Allocated:
        """Work an assignment out, maybe in another thread: at most one is in flight."""
        assignment = checked(ByPriority(self._allocator), problem, self._budget, self._rng)
        return Allocated(
            t=0.0,
            round=round,
            seconds=time.perf_counter() - begin,
            routes=assignment.routes,
            unassigned=assignment.unassigned,
        )

    def _under_way(self) -> dict[str, UnderWay]:
        found, poses = {}, self._fleet.poses()
        for id, robot in self.state.robots.items():
            if robot.route:
                at = poses[id].at
                rest, on = self._planners[id].ahead()
                at_work = self._at_work(id) and id not in self.state.paused
                found[id] = UnderWay(rest, math.dist(at, rest), on, at_work)
        return found

    def _at_work(self, robot: str) -> bool:
        """Whether a robot has come to its next stop."""
        route = self.state.robots[robot].route
        return bool(route) and self._planners[robot].at_stop() == _own(route[0])

    def _halt(self, robot: str, *, at_once: bool) -> Point:
        """Return where a robot comes to rest that gets a new plan; what it works at goes on."""
        if self._at_work(robot):
            return self.state.robots[robot].position
        return self._fleet.cancel(robot, at_once=at_once)

    def _plan(self, robot: str, reason: PlanReason) -> Planned:
        at = self._halt(robot, at_once=robot in self.state.failed)
        begin = time.perf_counter()
        plan = self._planners[robot].begin(at, self._services(robot))
        return self._planned(robot, reason, plan.length, plan.blocked, begin)

    def _repair(self, robot: str, obstacle: Obstacle | None) -> list[AnyEvent]:
        planner = self._planners[robot]
        if obstacle is None or not planner.touches(obstacle):
            return []
        at = self._halt(robot, at_once=True)
        begin = time.perf_counter()
        stale = self.state.robots[robot].stale
        plan = planner.begin(at, self._services(robot)) if stale else planner.replan(at)
        return [self._planned(robot, "obstacle", plan.length, plan.blocked, begin)]

    def _planned(
        self, robot: str, reason: PlanReason, length: float, blocked: int | None, begin: float
    ) -> Planned:
        seconds = time.perf_counter() - begin
        if blocked is not None:
            self._fleet.cancel(robot, at_once=False)  # what it works at may be in vain
        route = self.state.robots[robot].route
        return Planned(
            t=self.state.t,
            robot=robot,
            seconds=seconds,
            length=length if blocked is None else None,
            reason=reason,
            unreachable=route[blocked].task if blocked is not None and route else None,
        )

    def _services(self, robot: str) -> list[Service]:
        route: Route = self.state.robots[robot].route
        return [self._service(entry.task, entry.stop) for entry in route]

    def _service(self, task_id: str, name: str) -> Service:
        task: Task = self.state.tasks[task_id]
        stop = task.stop(name)
        letter = self.scene.world.roadmap.zones.at(stop.at)
        if stop is task.stops[-1]:
            letter |= {task.id}
        return Service(at=stop.at, own=_own(RouteStop(task=task.id, stop=stop.name)), letter=letter)

    def _drive(self, robot: str) -> None:
        entry = self.state.robots[robot].route[0]
        order = Order(
            path=tuple(self._planners[robot].leg()),
            task=entry.task,
            stop=entry.stop,
            service_time=self.state.tasks[entry.task].service_time,
        )
        self._fleet.send(robot, order)


def _own(stop: RouteStop) -> str:
    """The atom of a route's stop."""
    return f"{stop.task}@{stop.stop}"


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
                is_last = event.stop != "pickup"
                per_robot[event.robot]["tasks"] += int(is_last)
            case Allocated():
                rounds, allocation = rounds + 1, allocation + event.seconds
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
