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
    RobotFailed,
    StopServed,
    TaskAdded,
)
from oath.model import Mission, Point, Route, RouteStop, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """Where a robot was last seen [m], what remains of its route, and the tasks it carries.

    What it cannot deliver stays in its hands.
    """

    position: Point
    route: Route = ()
    carrying: tuple[str, ...] = ()
    stale: bool = False
    """The plan ends differently than the route; it is due anew after the next stop."""


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
    failed: frozenset[str] = frozenset()
    """Robots that are out of the mission."""
    reconsiders: bool = False
    """The allocator may change routes that are under way; else only idle robots get tasks."""
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
    def of(cls, mission: Mission, *, reconsiders: bool = False) -> State:
        """The state before anything happened."""
        robots = {robot.id: RobotState(position=robot.start) for robot in mission.robots}
        tasks = {task.id: task for task in mission.tasks}
        return cls(t=0.0, tasks=tasks, robots=robots, reconsiders=reconsiders)

    def carried(self) -> frozenset[str]:
        """Tasks that some robot has picked up and will deliver."""
        loads = frozenset(task for robot in self.robots.values() for task in robot.carrying)
        return loads - self.stranded.keys()

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
    """Stop a robot that an obstacle is in the way of, repair its plan; answer with `Planned`."""

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
    """Nothing is left to do; answer with `MissionFinished` once all robots stand."""


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
            # Even a robot without a route may still be on its last move.
            repairs = (Repair(robot, event.obstacle) for robot in state.robots)
            actions: tuple[Action, ...] = (UpdateMap(event.obstacle), *repairs)
            if state.reconsiders and any(robot.route for robot in state.robots.values()):
                state, more = _allocate(state)
                actions += more
            return state, actions
        case TaskAdded():
            return _allocate(replace(state, tasks={**state.tasks, event.task.id: event.task}))
        case RobotFailed():
            return _robot_failed(state, event)
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
    routes = _still_good(state, event.routes)
    changed = [robot for robot, route in routes.items() if route != state.robots[robot].route]
    # A robot whose next stop stays the same drives on, and is planned for when it is there.
    same = {robot for robot in changed if routes[robot][:1] == state.robots[robot].route[:1]}
    for robot in changed:
        state = _with(state, robot, route=routes[robot], stale=robot in same)
    state = replace(state, allocating=False, rounds=event.round, unassigned=dict(event.unassigned))
    # A route that was taken away is planned too: its robot must not drive on.
    actions: tuple[Action, ...] = tuple(
        Plan(robot, "allocated") for robot in changed if robot not in same
    )
    if state.dirty:
        state, more = _allocate(state)
        return state, actions + more
    return state, actions + _finish_if_still(state)


def _still_good(state: State, routes: Mapping[str, Route]) -> dict[str, Route]:
    """The routes of an answer less what happened while it was made.

    Stops served meanwhile are left out. A route that no longer fits its robot is passed over, and
    with it every route that takes a task which such a robot keeps; another round is due then.
    """
    good = {}
    for id, route in routes.items():
        left = tuple(stop for stop in route if not _is_served(state, id, stop))
        if _fits(state, id, left):
            good[id] = left
    while True:
        kept = {
            stop.task
            for id, robot in state.robots.items()
            if id not in good
            for stop in robot.route
        }
        clash = [id for id, route in good.items() if any(stop.task in kept for stop in route)]
        if not clash:
            return good
        for id in clash:
            del good[id]


def _is_served(state: State, robot: str, stop: RouteStop) -> bool:
    is_first = stop.stop == state.tasks[stop.task].stops[0].name
    carried = stop.task in state.robots[robot].carrying
    return stop.task in state.completed or (carried and is_first)


def _fits(state: State, robot: str, route: Route) -> bool:
    """Whether a route delivers all that its robot can, and takes up only what it may."""
    carrying = set(state.robots[robot].carrying) - state.stranded.keys()
    tasks = {stop.task for stop in route}
    may_begin = set(state.open_tasks()) if robot not in state.failed else set()
    return carrying <= tasks and all(
        task in may_begin and (robot, task) not in state.refused for task in tasks - carrying
    )


def _planned(state: State, event: Planned) -> tuple[State, tuple[Action, ...]]:
    robot, task = state.robots[event.robot], event.unreachable
    if not robot.route:
        return state, _finish_if_still(state)
    state = _with(state, event.robot, stale=False)
    if event.length is not None:
        return state, (Drive(event.robot),)
    # Without that task the rest may still be possible: what is carried stays, the rest goes back.
    if task in robot.carrying:
        why = f"carried by {event.robot}, which has no way to its delivery"
        state = replace(state, stranded={**state.stranded, task: why})
    elif task is not None:
        state = replace(state, refused=state.refused | {(event.robot, task)})
    kept = set(robot.carrying) - state.stranded.keys()
    route = tuple(stop for stop in robot.route if stop.task in kept)
    state = _with(state, event.robot, route=route)
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
    # What a rule forbade before may be allowed now.
    refused = frozenset(pair for pair in state.refused if pair[0] != event.robot)
    state = replace(state, refused=refused)
    route = robot.route[1:]
    state = _with(state, event.robot, position=event.at, route=route, carrying=carrying)
    if route:
        return state, (Plan(event.robot, "allocated") if robot.stale else Drive(event.robot),)
    if state.waiting() or (state.reconsiders and state.open_tasks()):
        return _allocate(state)
    return state, _finish_if_still(state)


def _robot_failed(state: State, event: RobotFailed) -> tuple[State, tuple[Action, ...]]:
    why = f"carried by {event.robot}, which failed"
    lost = {id: why for id in state.robots[event.robot].carrying if id not in state.stranded}
    state = replace(state, failed=state.failed | {event.robot}, stranded={**state.stranded, **lost})
    state = _with(state, event.robot, route=(), stale=False)
    state, more = _allocate(state)
    return state, (Plan(event.robot, "command"), *more)


def _finish_if_still(state: State) -> tuple[Action, ...]:
    still = not any(robot.route for robot in state.robots.values())
    return (Finish(),) if still and not state.allocating else ()
