"""What tasks and robots of a state are about, in one word each."""

from __future__ import annotations

from typing import Literal

from oath.state import State

TaskStatus = Literal["waiting", "assigned", "carried", "done", "stranded"]
RobotStatus = Literal["working", "idle", "paused", "failed"]


def task_statuses(state: State) -> dict[str, TaskStatus]:
    """Return how far every task is."""
    assigned = {stop.task for robot in state.robots.values() for stop in robot.route}
    carried = state.carried()

    def status(task: str) -> TaskStatus:
        if task in state.completed:
            return "done"
        if task in state.stranded:
            return "stranded"
        if task in carried:
            return "carried"
        return "assigned" if task in assigned else "waiting"

    return {task: status(task) for task in state.tasks}


def robot_statuses(state: State) -> dict[str, RobotStatus]:
    """Return what every robot does."""

    def status(robot: str) -> RobotStatus:
        if robot in state.failed:
            return "failed"
        if robot in state.paused:
            return "paused"
        return "working" if state.robots[robot].route else "idle"

    return {robot: status(robot) for robot in state.robots}
