"""Commands about the mission as a whole: how it stands, and taking back the last change."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from oath.commands.command import Command, Live, show_point
from oath.errors import BadInput
from oath.events import (
    AnyEvent,
    ObstacleAdded,
    ObstacleRemoved,
    PriorityChanged,
    RobotPaused,
    RobotResumed,
    TaskAdded,
    TaskCancelled,
)


class QueryStatus(Command):
    """Tell how the mission stands; changes nothing."""

    intent: ClassVar[str] = "query_status"
    immediate: ClassVar[bool] = True

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        return ()

    def says(self, live: Live) -> str:
        """See `Command`."""
        state = live.state
        lines = [
            f"{len(state.completed)} of {len(state.tasks)} tasks are done at {state.t:.1f} s; "
            f"{len(state.waiting())} wait for a robot"
        ]
        lines += [_robot_line(live, robot) for robot in state.robots]
        lines += [f"{task} cannot be done: {why}" for task, why in state.stranded.items()]
        return "\n".join(lines)


def _robot_line(live: Live, id: str) -> str:
    state, robot = live.state, live.state.robots[id]
    if id in state.failed:
        does = "failed"
    elif robot.route:
        does = f"goes to the {robot.route[0].stop} of {robot.route[0].task}"
    else:
        does = "idle"
    paused = ", paused" if id in state.paused and id not in state.failed else ""
    load = f", carries {', '.join(robot.carrying)}" if robot.carrying else ""
    return f"{id} at {show_point(_rounded(live.pose(id)))}: {does}{paused}{load}"


def _rounded(at: tuple[float, float]) -> tuple[float, float]:
    return round(at[0], 1), round(at[1], 1)


class Undo(Command):
    """Take back the last change that was asked for, by its opposite."""

    intent: ClassVar[str] = "undo"

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        if not live.state.undo:
            raise BadInput("there is nothing to undo", remedy="nothing is to be done")
        last = live.state.undo[-1]
        if not last:
            raise BadInput(
                "the last change cannot be undone: a robot that failed stays out",
                remedy="start a new mission with the robot",
            )
        return tuple(replace(event, t=live.state.t) for event in last)

    def says(self, live: Live) -> str:
        """See `Command`."""
        return "undoes the last change: " + ", ".join(map(_in_words, self.events(live)))


def _in_words(event: AnyEvent) -> str:
    match event:
        case TaskCancelled(task=task):
            return f"cancels task {task}"
        case TaskAdded(task=added):
            return f"adds task {added.id} again"
        case PriorityChanged(task=task, priority=priority):
            return f"task {task} has {priority} priority again"
        case ObstacleRemoved(obstacle=obstacle):
            return f"removes {obstacle}"
        case ObstacleAdded(obstacle=obstacle):
            return f"adds {obstacle} again"
        case RobotPaused(robot=robot):
            return f"pauses {robot} again"
        case RobotResumed(robot=robot):
            return f"lets {robot} go on"
    raise AssertionError(event)
