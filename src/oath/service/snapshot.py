"""The mission as plain data: how it is made, and how it stands at some moment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from oath.commands import Live, Undo
from oath.errors import BadInput
from oath.fleet import Pose
from oath.model import Mission, OccupancyGrid, Point, Task
from oath.scene import Scene
from oath.service.history import Tally
from oath.state import State


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """How the mission stands after event `seq`.

    Attributes
    ----------
    seq
        Number of the last event; -1 = none yet.
    t
        Mission clock [s].
    state
        What the events say.
    speed, paused
        Of the mission clock.
    poses, ways
        Where robots are and which way they will drive to their next stop [m]; unknown in the past.
    """

    seq: int
    t: float
    state: State
    speed: float
    paused: bool
    poses: Mapping[str, Pose] = field(default_factory=dict)
    ways: Mapping[str, Sequence[Point]] = field(default_factory=dict)


def _xy(at: Sequence[float]) -> list[float]:
    return [round(at[0], 3), round(at[1], 3)]


def state_of(scene: Scene, moment: Moment, tally: Tally) -> dict[str, Any]:
    """Return a moment as plain data."""
    state = moment.state
    routed = {stop.task: id for id, robot in state.robots.items() for stop in reversed(robot.route)}
    carriers = {task: id for id, robot in state.robots.items() for task in robot.carrying}
    held = {stop.task: id for id in state.paused for stop in state.robots[id].route}
    return {
        "seq": moment.seq,
        "t": moment.t,
        "finished": state.finished,
        "clock": {"speed": moment.speed, "paused": moment.paused},
        "robots": [_robot(moment, tally, id) for id in state.robots],
        "tasks": [_task(state, task, routed, carriers, held) for task in state.tasks.values()],
        "obstacles": _obstacles(scene.mission, state),
        "undo": _undo(scene, state),
        "alerts": [{"t": alert.t, "text": alert.text} for alert in tally.alerts],
    }


def _robot(moment: Moment, tally: Tally, id: str) -> dict[str, Any]:
    state, trace = moment.state, tally.traces[id]
    robot = state.robots[id]
    pose = moment.poses.get(id) or Pose(robot.position, trace.heading)
    route = [
        {"task": stop.task, "stop": stop.stop, "at": _xy(state.tasks[stop.task].stop(stop.stop).at)}
        for stop in robot.route
    ]
    if id in state.failed:
        status = "failed"
    elif id in state.paused:
        status = "paused"
    elif not route:
        status = "idle"
    else:
        first = robot.route[0]
        there = state.tasks[first.task].stop(first.stop).at
        status = "serving" if there == robot.position else "driving"
    silent = id in state.failed or id not in moment.poses
    return {
        "id": id,
        "position": _xy(pose.at),
        "heading": round(pose.heading, 4),
        "status": status,
        "carrying": list(robot.carrying),
        "route": route,
        "path": [_xy(at) for at in moment.ways.get(id, ())],
        "seen": trace.seen if silent else moment.t,
        "driven": round(trace.driven, 3),
        "tasks": trace.tasks,
    }


def _task(
    state: State,
    task: Task,
    routed: Mapping[str, str],
    carriers: Mapping[str, str],
    held: Mapping[str, str],
) -> dict[str, Any]:
    id, reason = task.id, None
    carrier = carriers.get(id)
    if id in state.completed:
        status, robot = "done", None
    elif id in state.stranded:
        status, robot, reason = "stranded", carrier, state.stranded[id]
    elif carrier is not None:
        status, robot = "carried", carrier
    elif id in routed:
        status, robot = "assigned", routed[id]
    else:
        status, robot, reason = "waiting", None, state.unassigned.get(id)
    if id in held and reason is None:
        reason = f"given to {held[id]}, which is paused"
    served = {"done": len(task.stops), "carried": 1, "stranded": 1}.get(status, 0)
    return {
        "id": id,
        "type": task.type,
        "priority": task.priority,
        "status": status,
        "robot": robot,
        "stops": [
            {"name": stop.name, "at": _xy(stop.at), "place": stop.place, "served": n < served}
            for n, stop in enumerate(task.stops)
        ],
        "reason": reason,
    }


def _obstacles(mission: Mission, state: State) -> list[dict[str, Any]]:
    source = {
        obstacle.id: "map" if obstacle.known else "found" for obstacle in mission.map.obstacles
    }
    return [
        {
            "id": obstacle.id,
            "kind": obstacle.kind,
            "polygon": [_xy(corner) for corner in obstacle.polygon],
            "source": source.get(obstacle.id, "told"),
        }
        for obstacle in state.obstacles.values()
    ]


def _undo(scene: Scene, state: State) -> str | None:
    try:
        return Undo().says(Live(scene, state))
    except BadInput:
        return None


def mission_of(mission: Mission) -> dict[str, Any]:
    """Return a mission as plain data."""
    map = mission.map
    return {
        "name": mission.name,
        "bounds": list(map.bounds),
        "walls": [[_xy(at) for at in wall] for wall in map.walls],
        "wall_thickness": map.wall_thickness,
        "grid": None if map.grid is None else _grid(map.grid),
        "places": {name: _xy(at) for name, at in mission.places.items()},
        "zones": {name: [_xy(at) for at in zone] for name, zone in mission.zones.items()},
        "task_types": list(mission.task_types),
        "robots": [
            {
                "id": robot.id,
                "motion": robot.motion,
                "can": dict(robot.can),
                "capacity": robot.capacity,
                "speed": robot.speed,
                "radius": robot.radius,
                "sensing": robot.sensing,
            }
            for robot in mission.robots
        ],
        "motions": {
            name: {"ignores": sorted(motion.ignores), "cost": dict(motion.cost)}
            for name, motion in mission.motions.items()
        },
        "rules": list(mission.rules),
    }


def _grid(grid: OccupancyGrid) -> dict[str, Any]:
    """Return a raster as runs of occupied cells: row, first and last column."""
    rows, columns = grid.occupied.shape
    padded = np.zeros((rows, columns + 2), dtype=np.int8)
    padded[:, 1:-1] = grid.occupied
    change = np.diff(padded, axis=1)
    row, first = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    return {
        "rows": rows,
        "columns": columns,
        "resolution": grid.resolution,
        "origin": list(grid.origin),
        "runs": np.column_stack([row, first, end - 1]).tolist(),
    }
