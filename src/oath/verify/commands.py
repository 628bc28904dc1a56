"""Judge what was asked for: each command has its effect at once, and what is urgent comes first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import shapely

from oath.events import (
    Allocated,
    AnyEvent,
    Commanded,
    ObstacleAdded,
    ObstacleRemoved,
    PriorityChanged,
    RobotFailed,
    RobotPaused,
    RobotResumed,
    StopServed,
    TaskAdded,
    TaskCancelled,
)
from oath.model import Priority, Route
from oath.verify.record import TOLERANCE, Record, Violation, apart

CHANGES = (
    *(TaskAdded, TaskCancelled, PriorityChanged, ObstacleAdded, ObstacleRemoved),
    *(RobotFailed, RobotPaused, RobotResumed),
)
"""What a command may do to a mission."""


def judge_commands(record: Record) -> Iterator[Violation]:
    """Yield commands without their effect, and routes in which urgent tasks have to wait."""
    usable = record.usable
    for i, (seq, event) in enumerate(usable):
        if isinstance(event, Commanded):
            effect = []
            for _, later in usable[i + 1 :]:
                if not isinstance(later, CHANGES):
                    break
                effect.append(later)
            try:
                problem = _ineffective(event.command, effect)
            except (TypeError, ValueError):
                problem = f"{dict(event.command)} cannot be read"
            if problem:
                yield Violation(rule="command", seq=seq, message=problem)
    yield from _judge_urgency(record)


def _ineffective(command: Mapping[str, Any], effect: Sequence[AnyEvent]) -> str | None:
    """Why the changes that follow a command at once are not what it asks for, None if they are."""
    intent, asked = command.get("intent"), command.get("parameters", {})
    if not effect:
        return f"nothing follows from {intent!r}"
    match intent, effect[0]:
        case "add_task", TaskAdded(task=task):
            where = apart(task.stops[0].at, tuple(asked.get("location", task.stops[0].at)))
            done = asked.get("task_label", task.id) == task.id and where <= TOLERANCE
        case "cancel_task", TaskCancelled(task=id):
            done = asked.get("task_label") == id
        case "change_task_priority", PriorityChanged(task=id, priority=priority):
            done = (asked.get("task_label"), asked.get("priority", "high")) == (id, priority)
        case "obstacle_update", ObstacleAdded(polygon=polygon):
            told = shapely.points(asked.get("obstacle_location", []))
            gaps = shapely.distance(shapely.Polygon(polygon).exterior, told)
            done = bool((gaps <= TOLERANCE).all())
        case "remove_obstacle", ObstacleRemoved(obstacle=id):
            done = asked.get("obstacle") == id
        case "pause_robot", RobotPaused(robot=id):
            done = asked.get("robot") in (id, "all")
        case "resume_robot", RobotResumed(robot=id):
            done = asked.get("robot") in (id, "all")
        case "robot_failed", RobotFailed(robot=id):
            done = asked.get("robot") == id
        case "undo", _:
            done = True
        case _:
            done = False
    return None if done else f"{intent!r} asks for {dict(asked)}, but {effect[0].type} follows"


def _judge_urgency(record: Record) -> Iterator[Violation]:
    """In an answer of the allocator, no robot begins other work before its urgent tasks.

    Let off is the stop at which a robot is at work, and robots that are paused: they do nothing.
    An answer that comes later than a priority may have been under way before; the next may not.
    """
    priority: dict[str, Priority] = {task.id: task.priority for task in record.mission.tasks}
    stops = {task.id: task for task in record.mission.tasks}
    begun: set[str] = set()
    paused: set[str] = set()
    news: dict[str, float] = {}  # when priorities came that no answer has followed yet
    for seq, event in record.usable:
        match event:
            case TaskAdded(task=task):
                news[task.id] = event.t
                priority[task.id], stops[task.id] = task.priority, task
                begun.discard(task.id)
            case PriorityChanged(task=id):
                priority[id], news[id] = event.priority, event.t
            case StopServed(task=id):
                begun.add(id)
            case RobotPaused(robot=robot):
                paused.add(robot)
            case RobotResumed(robot=robot):
                paused.discard(robot)
            case Allocated(routes=routes):
                for robot, route in routes.items():
                    at = record.tracks[robot].at(event.t)
                    there = stops[route[0].task].stop(route[0].stop).at if route else at
                    rest = route[1:] if apart(at, there) <= TOLERANCE else route
                    waits = None if robot in paused else _waits(rest, priority, begun)
                    known = [news.get(task, event.t) >= event.t - TOLERANCE for task in waits or ()]
                    if waits and all(known):
                        text = f"its urgent task '{waits[0]}' has to wait for task '{waits[1]}'"
                        yield Violation(rule="priority", seq=seq, robot=robot, message=text)
                news.clear()
            case _:
                pass


def _waits(
    route: Route, priority: Mapping[str, Priority], begun: set[str]
) -> tuple[str, str] | None:
    """The first urgent task of a route that other work is begun before, and which."""
    other: str | None = None
    for stop in route:
        if stop.task in begun or stop.stop == "delivery":
            continue
        if priority[stop.task] == "high" and other is not None:
            return stop.task, other
        if priority[stop.task] != "high":
            other = other or stop.task
    return None
