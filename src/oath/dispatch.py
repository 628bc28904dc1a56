"""The mission's state machine: what an event means and what must happen next.

Pure: `advance` changes nothing, reads no clock and does no geometry. What it asks for comes back
as events, so the events alone rebuild every state.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from oath.events import (
    Allocated,
    AnyEvent,
    Commanded,
    MissionFinished,
    MissionStarted,
    Moved,
    ObstacleAdded,
    ObstacleFound,
    ObstacleRemoved,
    Planned,
    PlanReason,
    PriorityChanged,
    RobotFailed,
    RobotPaused,
    RobotResumed,
    StopServed,
    TaskAdded,
    TaskCancelled,
)
from oath.model import Obstacle, Point, Priority, Route, RouteStop, Stop
from oath.state import State

RECONSIDER = 0.05
"""Share by which a way must grow for an obstacle to ask for another assignment."""


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
    """Put an obstacle on the map, or take it off if the state knows it no more."""

    obstacle: str


Action = Allocate | Plan | Repair | Drive | UpdateMap


def advance(state: State, event: AnyEvent) -> tuple[State, tuple[Action, ...]]:
    """Apply an event; return the next state and the actions it calls for.

    Laws: `state` is not changed; equal arguments give equal results; no task is ever lost
    (completed, carried, stranded, routed and waiting partition the tasks).
    """
    if isinstance(event, Moved):  # most events are: they cost one copy of the state, not three
        return _moved(state, [event]), ()
    state = _record(replace(state, t=max(state.t, event.t)), event)
    match event:
        case MissionStarted():
            return _allocate(state)
        case Allocated():
            return _allocated(state, event)
        case Planned():
            return _planned(state, event)
        case StopServed():
            return _stop_served(state, event)
        case ObstacleFound():
            told = state.hidden.get(event.obstacle)
            kind = told.kind if told is not None else "obstacle"
            known = Obstacle(id=event.obstacle, kind=kind, polygon=event.polygon)
            return _obstacle_added(state, known)
        case ObstacleAdded():
            known = Obstacle(id=event.obstacle, kind=event.kind, polygon=event.polygon)
            return _obstacle_added(state, known)
        case ObstacleRemoved():
            return _obstacle_removed(state, event)
        case TaskAdded():
            added = {**state.tasks, event.task.id: event.task}
            return _allocate(replace(state, tasks=added, labels=state.labels | {event.task.id}))
        case TaskCancelled():
            return _task_cancelled(state, event)
        case PriorityChanged():
            changed = replace(state.tasks[event.task], priority=event.priority)
            return _allocate(replace(state, tasks={**state.tasks, event.task: changed}))
        case RobotFailed():
            return _robot_failed(state, event)
        case RobotPaused():
            return _robot_paused(state, event)
        case RobotResumed():
            return _robot_resumed(state, event)
        case MissionFinished():
            return replace(state, finished=True), ()
        case Commanded():
            return state, ()


def fold(
    state: State, events: Iterable[AnyEvent]
) -> Iterator[tuple[list[AnyEvent], State, tuple[Action, ...]]]:
    """Apply events in order: yield the next of them, the state after these and what it calls for.

    Moves that follow each other come together: one copy of the state does for all of them.
    """
    for are_moves, run in groupby(events, lambda event: isinstance(event, Moved)):
        if are_moves:
            moves = list(run)
            state = _moved(state, moves)  # type: ignore[arg-type]
            yield moves, state, ()
        else:
            for event in run:
                state, actions = advance(state, event)
                yield [event], state, actions


def failure(state: State, robot: str, at: Point) -> tuple[AnyEvent, ...]:
    """What happens when a robot fails at a point [m]: what it carries is to be fetched there.

    Each carried task is taken out of the mission and comes back with its pickup where it stands.
    """
    events: list[AnyEvent] = [RobotFailed(t=state.t, robot=robot)]
    for id in state.robots[robot].carrying:
        if id in state.tasks:
            task = state.tasks[id]
            stops = (Stop(name="pickup", at=at), *task.stops[1:])
            events.append(TaskCancelled(t=state.t, task=id))
            events.append(TaskAdded(t=state.t, task=replace(task, stops=stops)))
    return tuple(events)


CHANGES = (
    TaskAdded,
    TaskCancelled,
    PriorityChanged,
    ObstacleFound,
    ObstacleAdded,
    ObstacleRemoved,
    RobotFailed,
    RobotPaused,
    RobotResumed,
)


def _record(state: State, event: AnyEvent) -> State:
    """Count what changes the mission, and note what takes a command's changes back."""
    if isinstance(event, CHANGES):
        state = replace(state, changes=state.changes + 1)
    if isinstance(event, Commanded):
        if event.command.get("intent") == "undo":
            return replace(state, undo=state.undo[:-1], recording=False)
        return replace(state, undo=(*state.undo, ()), recording=True)
    if not state.recording:
        return state
    opposite = _opposite(state, event)
    if opposite is None:
        return replace(state, recording=False)
    return replace(state, undo=(*state.undo[:-1], (opposite, *state.undo[-1])))


def _opposite(state: State, event: AnyEvent) -> AnyEvent | None:
    """The event that takes a change back, seen from the state before it; None if none does."""
    t = event.t
    match event:
        case TaskAdded(task=task):
            return TaskCancelled(t=t, task=task.id)
        case TaskCancelled(task=id):
            return TaskAdded(t=t, task=state.tasks[id])
        case PriorityChanged(task=id):
            before: Priority = state.tasks[id].priority
            return PriorityChanged(t=t, task=id, priority=before)
        case ObstacleAdded(obstacle=id):
            return ObstacleRemoved(t=t, obstacle=id)
        case ObstacleRemoved(obstacle=id):
            gone = state.obstacles[id]
            return ObstacleAdded(t=t, obstacle=id, kind=gone.kind, polygon=gone.polygon)
        case RobotPaused(robot=robot):
            return RobotResumed(t=t, robot=robot)
        case RobotResumed(robot=robot):
            return RobotPaused(t=t, robot=robot)
    return None


def _moved(state: State, moves: Sequence[Moved]) -> State:
    at: dict[str, Point] = {}
    left: dict[str, float] = {}
    for move in moves:
        robot = move.robot
        before = left[robot] if robot in left else state.robots[robot].left
        left[robot] = max(before - math.dist(move.from_, move.to), 0.0)
        at[robot] = move.to
    drove = {id: replace(state.robots[id], position=at[id], left=left[id]) for id in at}
    t = max(state.t, max(move.t for move in moves))
    return replace(state, t=t, robots={**state.robots, **drove}, recording=False)


def _with(state: State, robot: str, **changes: object) -> State:
    changed = replace(state.robots[robot], **changes)  # type: ignore[arg-type]
    return replace(state, robots={**state.robots, robot: changed})


def _allocate(state: State) -> tuple[State, tuple[Action, ...]]:
    """Ask for a round; at most one is in flight, and what it does not know asks for another."""
    asked = replace(state, rounds=state.rounds + 1, allocating=True)
    return asked, () if state.allocating else (Allocate(),)


def _allocated(state: State, event: Allocated) -> tuple[State, tuple[Action, ...]]:
    routes = _still_good(state, event.routes)
    changed = [robot for robot, route in routes.items() if route != state.robots[robot].route]
    # A robot whose next stop stays the same drives on, and is planned for when it is there.
    same = {robot for robot in changed if routes[robot][:1] == state.robots[robot].route[:1]}
    for robot in changed:
        state = _with(state, robot, route=routes[robot], stale=robot in same)
    state = replace(state, allocating=False, unassigned=dict(event.unassigned))
    # A route that was taken away is planned too: its robot must not drive on.
    actions: tuple[Action, ...] = tuple(
        Plan(robot, "allocated") for robot in changed if robot not in same
    )
    if state.rounds > event.round:
        state, more = _allocate(state)
        return state, actions + more
    return state, actions


def _still_good(state: State, routes: Mapping[str, Route]) -> dict[str, Route]:
    """The routes of an answer less what happened while it was made.

    Stops served or cancelled meanwhile are left out. A route that no longer fits its robot is
    passed over, and with it every route that takes a task which such a robot keeps; another round
    is due then.
    """
    good, may_begin = {}, frozenset(state.open_tasks())
    for id, route in routes.items():
        left = tuple(stop for stop in route if not _is_past(state, id, stop))
        if _fits(state, id, left, may_begin):
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


def _is_past(state: State, robot: str, stop: RouteStop) -> bool:
    if stop.task not in state.tasks:
        return True  # it was cancelled
    is_first = stop.stop == state.tasks[stop.task].stops[0].name
    carried = stop.task in state.robots[robot].carrying
    return stop.task in state.completed or (carried and is_first)


def _fits(state: State, robot: str, route: Route, may_begin: frozenset[str]) -> bool:
    """Whether a route delivers all that its robot can, and takes up only what it may and can."""
    load = len(state.robots[robot].carrying)
    for stop in route:
        load += {"pickup": 1, "delivery": -1}.get(stop.stop, 0)
        if load > state.robots[robot].capacity:
            return False
    carrying = set(state.deliverable(robot))
    tasks = {stop.task for stop in route}
    if robot in state.failed:
        may_begin = frozenset()
    elif robot in state.paused:
        may_begin &= {stop.task for stop in state.robots[robot].route}
    return carrying <= tasks and all(
        task in may_begin and (robot, task) not in state.refused for task in tasks - carrying
    )


def _planned(state: State, event: Planned) -> tuple[State, tuple[Action, ...]]:
    robot, task = state.robots[event.robot], event.unreachable
    if not robot.route:
        return state, ()
    state = _with(state, event.robot, stale=False)
    if event.length is not None:
        state = _with(state, event.robot, left=event.length)
        drive: tuple[Action, ...] = (Drive(event.robot),) if event.robot not in state.paused else ()
        # What a stale plan was for says nothing about this one's length.
        longer = robot.stale or event.length > robot.left * (1 + RECONSIDER)
        if event.reason == "obstacle" and longer and state.reconsiders:
            state, more = _allocate(state)
            return state, drive + more
        return state, drive
    # Without that task the rest may still be possible: what is carried stays, the rest goes back.
    if task in robot.carrying:
        why = f"carried by {event.robot}, which has no way to its delivery"
        state = replace(state, stranded={**state.stranded, task: why})
    elif task is not None:
        state = replace(state, refused=state.refused | {(event.robot, task)})
    kept = set(state.deliverable(event.robot))
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
        on: tuple[Action, ...] = (
            (Plan(event.robot, "allocated") if robot.stale else Drive(event.robot),)
            if event.robot not in state.paused
            else ()
        )
        if set(state.urgent()) & set(state.waiting()):  # there was no room for it before
            state, more = _allocate(state)
            return state, on + more
        return state, on
    if state.waiting() or (state.reconsiders and state.open_tasks()):
        return _allocate(state)
    return state, ()


def _obstacle_added(state: State, obstacle: Obstacle) -> tuple[State, tuple[Action, ...]]:
    state = replace(
        state,
        obstacles={**state.obstacles, obstacle.id: obstacle},
        hidden={id: one for id, one in state.hidden.items() if id != obstacle.id},
        obstacle_ids=state.obstacle_ids | {obstacle.id},
    )
    # Even a robot without a route may still be on its last move.
    repairs = (Repair(robot, obstacle.id) for robot in state.robots)
    return state, (UpdateMap(obstacle.id), *repairs)


def _obstacle_removed(state: State, event: ObstacleRemoved) -> tuple[State, tuple[Action, ...]]:
    left = {id: one for id, one in state.obstacles.items() if id != event.obstacle}
    state = replace(state, obstacles=left, refused=frozenset())
    plans = (Plan(id, "command") for id, robot in state.robots.items() if robot.route)
    # Stops may be within reach again, and ways may be shorter.
    state, more = _allocate(state)
    return state, (UpdateMap(event.obstacle), *plans, *more)


def _task_cancelled(state: State, event: TaskCancelled) -> tuple[State, tuple[Action, ...]]:
    id = event.task
    plans: tuple[Action, ...] = ()
    state = replace(
        state,
        tasks={task: value for task, value in state.tasks.items() if task != id},
        stranded={task: why for task, why in state.stranded.items() if task != id},
        unassigned={task: why for task, why in state.unassigned.items() if task != id},
        refused=frozenset(pair for pair in state.refused if pair[1] != id),
        completed=state.completed - {id},
    )
    for name, robot in state.robots.items():
        if id in robot.carrying and name in state.failed:
            load = tuple(task for task in robot.carrying if task != id)
            state = _with(state, name, carrying=load)
        route = tuple(stop for stop in robot.route if stop.task != id)
        if id in robot.carrying:
            # It stays aboard, where it takes the room that pickups on the way counted on.
            route = tuple(stop for stop in route if stop.task in robot.carrying)
        if route != robot.route:
            state = _with(state, name, route=route, stale=True)
            if route[:1] != robot.route[:1]:
                plans = (*plans, Plan(name, "command"))
    state, more = _allocate(state)
    return state, plans + more


def _robot_failed(state: State, event: RobotFailed) -> tuple[State, tuple[Action, ...]]:
    why = f"carried by {event.robot}, which failed"
    lost = dict.fromkeys(state.deliverable(event.robot), why)
    state = replace(state, failed=state.failed | {event.robot}, stranded={**state.stranded, **lost})
    state = _with(state, event.robot, route=(), stale=False)
    state, more = _allocate(state)
    return state, (Plan(event.robot, "command"), *more)


def _robot_paused(state: State, event: RobotPaused) -> tuple[State, tuple[Action, ...]]:
    state = replace(state, paused=state.paused | {event.robot})
    held = {stop.task for stop in state.robots[event.robot].route}
    # It keeps its route, but what is urgent does not wait for it.
    return _allocate(state) if held.intersection(state.urgent()) else (state, ())


def _robot_resumed(state: State, event: RobotResumed) -> tuple[State, tuple[Action, ...]]:
    state, more = _allocate(replace(state, paused=state.paused - {event.robot}))
    on = (Plan(event.robot, "command"),) if state.robots[event.robot].route else ()
    return state, (*on, *more)
