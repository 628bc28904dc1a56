"""The mission's state machine: what an event means and what must happen next.

Pure: `advance` changes nothing, reads no clock and does no geometry. What it asks for comes back
as events, so the events alone rebuild every state.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from oath.events import (
    Allocated,
    AnyEvent,
    MissionFinished,
    MissionStarted,
    Moved,
    ObstacleFound,
    Planned,
    PlanReason,
    StopServed,
)
from oath.model import Mission, Point, Route, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """Where a robot was last seen [m], what remains of its route, and the tasks it carries."""

    position: Point
    route: Route = ()
    carrying: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Everything that the events so far say."""

    t: float
    """Mission clock [s]."""
    tasks: Mapping[str, Task]
    robots: Mapping[str, RobotState]
    completed: frozenset[str] = frozenset()
    stranded: Mapping[str, str] = field(default_factory=dict)
    """Carried tasks that cannot be delivered, and why."""
    refused: frozenset[tuple[str, str]] = frozenset()
    """(robot, task) pairs that turned out to have no plan."""
    unassigned: Mapping[str, str] = field(default_factory=dict)
    """Why tasks were left out of the last round."""
    rounds: int = 0
    allocating: bool = False
    dirty: bool = False
    """Something changed while an allocation was in flight."""
    finished: bool = False

    @classmethod
    def of(cls, mission: Mission) -> State:
        """The state before anything happened."""
        robots = {robot.id: RobotState(position=robot.start) for robot in mission.robots}
        return cls(t=0.0, tasks={task.id: task for task in mission.tasks}, robots=robots)

    def carried(self) -> frozenset[str]:
        """Tasks that some robot has picked up and not delivered."""
        return frozenset(task for robot in self.robots.values() for task in robot.carrying)

    def open_tasks(self) -> tuple[str, ...]:
        """Tasks that nobody has picked up, in their given order."""
        begun = self.completed | self.carried() | self.stranded.keys()
        return tuple(task for task in self.tasks if task not in begun)

    def waiting(self) -> tuple[str, ...]:
        """Open tasks that are in no robot's route."""
        routed = {stop.task for robot in self.robots.values() for stop in robot.route}
        return tuple(task for task in self.open_tasks() if task not in routed)

    def unserved(self) -> dict[str, str]:
        """Every task that is not done, and why."""
        reasons = {**self.unassigned, **self.stranded}
        return {
            task: reasons.get(task, "not finished")
            for task in self.tasks
            if task not in self.completed
        }


@dataclass(frozen=True, slots=True)
class Allocate:
    """Assign the open tasks; answer with `Allocated`."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Plan a robot's new route from where its current move ends; answer with `Planned`."""

    robot: str
    reason: PlanReason


@dataclass(frozen=True, slots=True)
class Repair:
    """Repair a robot's plan if the obstacle touches it; then answer with `Planned`."""

    robot: str
    obstacle: str


@dataclass(frozen=True, slots=True)
class Drive:
    """Send a robot along its plan to its next stop, to serve it."""

    robot: str


@dataclass(frozen=True, slots=True)
class UpdateMap:
    """Put an obstacle on the map."""

    obstacle: str


@dataclass(frozen=True, slots=True)
class Finish:
    """Nothing is left to do; answer with `MissionFinished`."""


Action = Allocate | Plan | Repair | Drive | UpdateMap | Finish


def advance(state: State, event: AnyEvent) -> tuple[State, tuple[Action, ...]]:
    """Apply an event; return the next state and the actions it calls for.

    Laws: `state` is not changed; equal arguments give equal results; no task is ever lost
    (completed, carried, stranded, routed and waiting partition the tasks).
    """
    state = replace(state, t=max(state.t, event.t))
    match event:
        case MissionStarted():
            return _allocate(state)
        case Allocated():
            return _allocated(state, event)
        case Planned():
            return _planned(state, event)
        case Moved():
            return _with(state, event.robot, position=event.to), ()
        case StopServed():
            return _stop_served(state, event)
        case ObstacleFound():
            busy = [id for id, robot in state.robots.items() if robot.route]
            return state, (
                UpdateMap(event.obstacle),
                *(Repair(robot, event.obstacle) for robot in busy),
            )
        case MissionFinished():
            return replace(state, finished=True), ()
        case _:
            return state, ()


def _with(state: State, robot: str, **changes: object) -> State:
    changed = replace(state.robots[robot], **changes)  # type: ignore[arg-type]
    return replace(state, robots={**state.robots, robot: changed})


def _allocate(state: State) -> tuple[State, tuple[Action, ...]]:
    """Ask for a round; at most one is in flight, and what changes meanwhile asks for another."""
    if state.allocating:
        return replace(state, dirty=True), ()
    return replace(state, allocating=True, dirty=False), (Allocate(),)


def _allocated(state: State, event: Allocated) -> tuple[State, tuple[Action, ...]]:
    changed = [robot for robot, route in event.routes.items() if route != state.robots[robot].route]
    for robot in changed:
        state = _with(state, robot, route=event.routes[robot])
    state = replace(state, allocating=False, rounds=event.round, unassigned=dict(event.unassigned))
    actions: tuple[Action, ...] = tuple(
        Plan(robot, "allocated") for robot in changed if state.robots[robot].route
    )
    if state.dirty:
        state, more = _allocate(state)
        return state, actions + more
    return state, actions + _finish_if_still(state)


def _planned(state: State, event: Planned) -> tuple[State, tuple[Action, ...]]:
    if event.length is not None:
        return state, (Drive(event.robot),)
    robot, task = state.robots[event.robot], event.unreachable
    # Without that task the rest may still be possible: what is carried stays, the rest goes back.
    carrying = tuple(id for id in robot.carrying if id != task)
    if task in robot.carrying:
        why = f"carried by {event.robot}, which has no way to its delivery"
        state = replace(state, stranded={**state.stranded, task: why})
    elif task is not None:
        state = replace(state, refused=state.refused | {(event.robot, task)})
    route = tuple(stop for stop in robot.route if stop.task in carrying)
    state = _with(state, event.robot, route=route, carrying=carrying)
    actions: tuple[Action, ...] = (Plan(event.robot, event.reason),) if route else ()
    state, more = _allocate(state)
    return state, actions + more


def _stop_served(state: State, event: StopServed) -> tuple[State, tuple[Action, ...]]:
    robot, task = state.robots[event.robot], state.tasks[event.task]
    carrying = tuple(id for id in robot.carrying if id != event.task)
    if event.stop != task.stops[-1].name:
        carrying = (*carrying, event.task)
    else:
        state = replace(state, completed=state.completed | {event.task})
    route = robot.route[1:]
    state = _with(state, event.robot, position=event.at, route=route, carrying=carrying)
    if route:
        return state, (Drive(event.robot),)
    if state.waiting():
        return _allocate(state)
    return state, _finish_if_still(state)


def _finish_if_still(state: State) -> tuple[Action, ...]:
    still = not any(robot.route for robot in state.robots.values())
    return (Finish(),) if still and not state.allocating else ()
