"""What a mission file must hold beyond its shape: names that exist, robots and stops that fit.

Whether a stop can be *reached* is not asked here: that needs a roadmap.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import shapely

from oath.errors import BadInput, did_you_mean
from oath.formats.mission_schema import MissionFile
from oath.formats.yaml_document import Document, FieldPath
from oath.model import Map, Mission, Motion, OccupancyGrid, Point, Robot, Stop, Task

SLACK = 1e-9
"""Clearance that may be missing to a radius [m]: rounding, not space."""


def check_names(
    document: Document, file: MissionFile, *, motions: Mapping[str, Motion], types: Sequence[str]
) -> None:
    """Check that ids are unique and that every name used is defined.

    Raises
    ------
    BadInput
        For the first name that is not.
    """
    tasks = [(("tasks", i, "id"), task.id) for i, task in enumerate(file.tasks)]
    robots = [(("robots", i, "id"), robot.id) for i, robot in enumerate(file.robots)]
    obstacles = [(("map", "obstacles", i, "id"), o.id) for i, o in enumerate(file.map.obstacles)]
    zones = [(("zones", zone), zone) for zone in file.zones]
    places = [(("places", place), place) for place in file.places]
    _distinct(document, [(("task_types", i), t) for i, t in enumerate(file.task_types or ())])
    _distinct(document, robots)
    _distinct(document, obstacles)
    # Rules name zones, places and tasks alike.
    _distinct(document, [*zones, *places, *tasks], "; zones, places and tasks share their names")
    for i, robot in enumerate(file.robots):
        about = f"robot {robot.id!r}"
        if robot.motion is not None:
            _known(document, ("robots", i, "motion"), about, "motion", robot.motion, motions)
        for type in robot.can or ():
            _known(document, ("robots", i, "can"), about, "task type", type, types)
    for i, task in enumerate(file.tasks):
        about = f"task {task.id!r}"
        if task.type is not None:
            _known(document, ("tasks", i, "type"), about, "task type", task.type, types)
        for stop, at in task.stops:
            if isinstance(at, str):
                _known(document, ("tasks", i, stop), about, "place", at, file.places)


def check_geometry(document: Document, mission: Mission) -> None:
    """Check that places, starts and stops lie in free space inside the bounds.

    A start must clear everything that blocks the robot; a task needs one robot of its type that
    clears walls and known obstacles at all of its stops.

    Raises
    ------
    BadInput
        For the first point that does not.
    """
    _check_bounds(document, mission)
    surroundings = _Surroundings(mission.map)
    for i, robot in enumerate(mission.robots):
        _check_start(document, ("robots", i, "start"), robot, mission, surroundings)
    for i, task in enumerate(mission.tasks):
        able = [robot for robot in mission.robots if task.type in robot.can]
        if not able:
            raise _nobody_can(document, ("tasks", i, "type"), task, mission)
        _check_stops(document, i, task, able, mission, surroundings)


def _distinct(document: Document, ids: Iterable[tuple[FieldPath, str]], why: str = "") -> None:
    seen: dict[str, FieldPath] = {}
    for path, id in ids:
        if id in seen:
            line = document.error(seen[id], "").file or ""
            raise document.error(
                path,
                f"the name {id!r} is taken already in line {line.rpartition(':')[2]}{why}",
                remedy="rename one of them",
            )
        seen[id] = path


def _known(
    document: Document, path: FieldPath, about: str, kind: str, name: str, known: Iterable[str]
) -> None:
    names = list(known)
    if name not in names:
        raise document.error(
            path, f"{about}: unknown {kind} {name!r}", remedy=did_you_mean(name, names)
        )


def _check_bounds(document: Document, mission: Mission) -> None:
    x_min, y_min, x_max, y_max = mission.map.bounds
    points: list[tuple[FieldPath, str, Point]] = [
        (("places", place), f"place {place!r}", at) for place, at in mission.places.items()
    ]
    for i, robot in enumerate(mission.robots):
        points.append((("robots", i, "start"), f"robot {robot.id!r}: start", robot.start))
    for i, task in enumerate(mission.tasks):
        for stop in task.stops:
            points.append((("tasks", i, stop.name), f"task {task.id!r}: {stop.name}", stop.at))
    for path, about, (x, y) in points:
        if not (x_min - SLACK <= x <= x_max + SLACK and y_min - SLACK <= y <= y_max + SLACK):
            raise document.error(
                path,
                f"{about} [{x:g}, {y:g}] lies outside the bounds "
                f"[{x_min:g}, {y_min:g}, {x_max:g}, {y_max:g}]",
                remedy="move it inside or widen map.bounds",
            )


class _Surroundings:
    """Distances from points to what is around them, looked up only as far as asked."""

    def __init__(self, map: Map) -> None:
        self.map = map
        self.walls = shapely.STRtree([shapely.LineString(wall) for wall in map.walls])
        self.obstacles = shapely.STRtree([shapely.Polygon(o.polygon) for o in map.obstacles])

    def nearest(
        self, point: Point, motion: Motion, reach: float, *, unknown: bool
    ) -> tuple[float, str] | None:
        """Return clearance [m] and name of the nearest blocking thing closer than `reach`.

        A clearance below 0 is inside a wall; `unknown` counts obstacles that robots must find.
        """
        at = shapely.Point(point)
        near: list[tuple[float, str]] = []
        half = self.map.wall_thickness / 2
        for i in self.walls.query(at, predicate="dwithin", distance=reach + half):
            near.append((self.walls.geometries[i].distance(at) - half, f"map.walls[{i}]"))
        for i in self.obstacles.query(at, predicate="dwithin", distance=reach):
            obstacle = self.map.obstacles[i]
            if motion.blocked_by(obstacle.kind) and (obstacle.known or unknown):
                distance = self.obstacles.geometries[i].distance(at)
                near.append((distance, f"obstacle {obstacle.id!r}"))
        if self.map.grid is not None:
            distance = cell_clearance(self.map.grid, point, reach)
            near.append((distance, "an occupied cell of the map file"))
        near = [item for item in near if item[0] < reach - SLACK]
        return min(near, default=None)


def cell_clearance(grid: OccupancyGrid, point: Point, reach: float) -> float:
    """Return the distance [m] from a point to the nearest occupied cell, infinite beyond `reach`.

    Only the window of cells within `reach` is looked at, so large maps cost nothing; 0 inside a
    cell. What lies outside the grid is free.
    """
    size = grid.resolution
    rows, columns = grid.occupied.shape
    low, high = [], []
    for axis, count in ((0, columns), (1, rows)):
        offset = point[axis] - grid.origin[axis]
        low.append(int(min(max((offset - reach) // size, 0), count)))
        high.append(int(min(max((offset + reach) // size + 1, 0), count)))
    found_rows, found_columns = np.nonzero(grid.occupied[low[1] : high[1], low[0] : high[0]])
    if found_rows.size == 0:
        return np.inf
    left = grid.origin[0] + (found_columns + low[0]) * size - point[0]
    below = grid.origin[1] + (found_rows + low[1]) * size - point[1]
    gap_x = np.maximum(0, np.maximum(left, -left - size))
    gap_y = np.maximum(0, np.maximum(below, -below - size))
    distance = float(np.hypot(gap_x, gap_y).min())
    return distance if distance <= reach else np.inf


def _check_start(
    document: Document,
    path: FieldPath,
    robot: Robot,
    mission: Mission,
    surroundings: _Surroundings,
) -> None:
    motion = mission.motions[robot.motion]
    hit = surroundings.nearest(robot.start, motion, robot.radius, unknown=True)
    if hit is not None:
        at = f"[{robot.start[0]:g}, {robot.start[1]:g}]"
        raise document.error(
            path,
            f"robot {robot.id!r}: start {at} {_tightness(hit, robot)}",
            remedy="move the start or the obstacle, or reduce the radius",
        )


def _nobody_can(document: Document, path: FieldPath, task: Task, mission: Mission) -> BadInput:
    doable = sorted({type for robot in mission.robots for type in robot.can})
    return document.error(
        path,
        f"task {task.id!r}: no robot can do the type {task.type!r}",
        remedy=f"add it to some robot's `can`, or give the task one of: {', '.join(doable)}",
    )


def _check_stops(
    document: Document,
    index: int,
    task: Task,
    able: Sequence[Robot],
    mission: Mission,
    surroundings: _Surroundings,
) -> None:
    """Check that one able robot fits at all stops: it is one robot that serves a task."""
    hits: list[tuple[Robot, Stop, tuple[float, str]]] = []
    for robot in _bodies(able):
        motion = mission.motions[robot.motion]
        for stop in task.stops:
            hit = surroundings.nearest(stop.at, motion, robot.radius, unknown=False)
            if hit is not None:
                hits.append((robot, stop, hit))
                break
        else:
            return
    robot, stop, hit = min(hits, key=lambda item: item[0].radius)
    at = repr(stop.place) if stop.place else f"[{stop.at[0]:g}, {stop.at[1]:g}]"
    others = f", and no other robot that can do {task.type!r} fits" if len(able) > 1 else ""
    raise document.error(
        ("tasks", index, stop.name),
        f"task {task.id!r}: {stop.name} {at} {_tightness(hit, robot)}{others}",
        remedy="move the stop away from it, or give the task to a smaller robot",
    )


def _bodies(robots: Sequence[Robot]) -> list[Robot]:
    """Return the first robot of every motion and radius: the others fit where it fits."""
    first: dict[tuple[str, float], Robot] = {}
    for robot in robots:
        first.setdefault((robot.motion, robot.radius), robot)
    return list(first.values())


def _tightness(hit: tuple[float, str], robot: Robot) -> str:
    clearance, what = hit
    if clearance <= 0:
        return f"lies in {what} (clearance 0 m, needed {robot.radius:g} m for {robot.id!r})"
    return (
        f"is too close to {what}: "
        f"clearance {clearance:.6g} m is below the radius {robot.radius:g} m of robot {robot.id!r}"
    )
