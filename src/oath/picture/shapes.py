"""What a recording draws: the entities of Foxglove scenes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from oath.model import Mission, Obstacle, OccupancyGrid, Point, Robot, Stop, Task
from oath.picture import KIND_COLOURS, WALL_COLOUR
from oath.picture.statuses import RobotStatus, TaskStatus

if TYPE_CHECKING:
    from foxglove import messages as fox

WORLD = "map"
"""The frame of everything but the robots' bodies, whose frames bear their ids."""

Entity = tuple[str, dict[str, Any]]
"""A frame, and the shapes in it by their kind."""

TASK_COLOURS: dict[TaskStatus, str] = {
    "waiting": "#E69F00",
    "assigned": "#0072B2",
    "carried": "#CC79A7",
    "done": "#009E73",
    "stranded": "#D55E00",
}
_OBSTACLE, _GREY, _INK = KIND_COLOURS[1], "#999999", "#1A1A1A"


def ground(mission: Mission) -> dict[str, Entity]:
    """Bounds, walls, zones and places."""
    map = mission.map
    x0, y0, x1, y1 = map.bounds
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    walls = [_line(wall, WALL_COLOUR, map.wall_thickness) for wall in map.walls]
    entities: dict[str, Entity] = {
        "bounds": (WORLD, {"lines": [_line(corners, _GREY, closed=True)]}),
        "walls": (WORLD, {"lines": walls}),
    }
    for name, zone in mission.zones.items():
        label = _text(name, _centre(zone))
        outline = _line(zone, _GREY, closed=True)
        entities[f"zone {name}"] = (WORLD, {"lines": [outline], "texts": [label]})
    for name, at in mission.places.items():
        entities[f"place {name}"] = (WORLD, {"texts": [_text(name, at)]})
    return entities


def grid(grid: OccupancyGrid, stamp: fox.Timestamp) -> fox.Grid:
    """The cells of a raster map: 100 is occupied, 0 is free."""
    from foxglove import messages as fox

    columns = grid.occupied.shape[1]
    uint8 = fox.PackedElementFieldNumericType.Uint8
    return fox.Grid(
        timestamp=stamp,
        frame_id=WORLD,
        pose=_pose(*grid.origin, z=-0.01),
        column_count=columns,
        cell_size=fox.Vector2(x=grid.resolution, y=grid.resolution),
        row_stride=columns,
        cell_stride=1,
        fields=[fox.PackedElementField(name="occupied", offset=0, type=uint8)],
        data=(grid.occupied * np.uint8(100)).tobytes(),
    )


def obstacle(obstacle: Obstacle) -> Entity:
    """What stands in the way, with its id and kind."""
    from foxglove import messages as fox

    label = _text(f"{obstacle.id} ({obstacle.kind})", _centre(obstacle.polygon))
    shapes: dict[str, Any] = {
        "lines": [_line(obstacle.polygon, _OBSTACLE, closed=True)],
        "texts": [label],
    }
    shape = shapely.Polygon(obstacle.polygon)
    if shape.convex_hull.area <= shape.area * (1 + 1e-9):  # else its outline must do
        first, *others = (fox.Point3(x=x, y=y) for x, y in obstacle.polygon)
        fan = [corner for pair in pairwise(others) for corner in (first, *pair)]
        shapes["triangles"] = [
            fox.TriangleListPrimitive(pose=_pose(), points=fan, color=_colour(_OBSTACLE, 0.4))
        ]
    return WORLD, shapes


def stop(task: Task, stop: Stop, status: TaskStatus) -> Entity:
    """A stop of a task, coloured by how far the task is."""
    from foxglove import messages as fox

    sign = {"pickup": "▲", "delivery": "▼", "visit": "◆"}[stop.name]
    urgent = " !" if task.priority == "high" else ""
    disc = fox.CylinderPrimitive(
        pose=_pose(*stop.at),
        size=fox.Vector3(x=0.3, y=0.3, z=0.02),
        bottom_scale=1.0,
        top_scale=1.0,
        color=_colour(TASK_COLOURS[status]),
    )
    label = _text(f"{sign} {task.id}{urgent}", stop.at, 0.1)
    return WORLD, {"cylinders": [disc], "texts": [label]}


def body(robot: Robot, colour: str, status: RobotStatus, load: Sequence[str]) -> Entity:
    """A robot in its own frame: a disc of its size, where it heads, what it carries."""
    from foxglove import messages as fox

    size = robot.radius
    disc = fox.CylinderPrimitive(
        pose=_pose(z=size / 2),
        size=fox.Vector3(x=2 * size, y=2 * size, z=size),
        bottom_scale=1.0,
        top_scale=1.0,
        color=_colour(_GREY if status == "failed" else colour, 0.9),
    )
    arrow = fox.ArrowPrimitive(
        pose=_pose(z=size),
        shaft_length=size,
        shaft_diameter=0.3 * size,
        head_length=0.7 * size,
        head_diameter=0.7 * size,
        color=_colour(_INK),
    )
    words = [robot.id, *([status] if status in ("failed", "paused") else []), *load]
    label = _text(" ".join(words), (0.0, 0.0), 2.5 * size)
    return robot.id, {"cylinders": [disc], "arrows": [arrow], "texts": [label]}


def way(points: Sequence[Point], colour: str, *, ahead: bool = False) -> Entity:
    """Where a robot has driven, or the straight lines to the stops `ahead`."""
    thickness, alpha = (0.0, 0.5) if ahead else (0.05, 1.0)
    return WORLD, {"lines": [_line(points, colour, thickness, alpha=alpha)]}


def _colour(hex: str, alpha: float = 1.0) -> fox.Color:
    from foxglove import messages as fox

    r, g, b = (int(hex[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return fox.Color(r=r, g=g, b=b, a=alpha)


def _pose(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> fox.Pose:
    from foxglove import messages as fox

    return fox.Pose(position=fox.Vector3(x=x, y=y, z=z), orientation=fox.Quaternion(w=1.0))


def _line(
    points: Sequence[Point],
    colour: str,
    thickness: float = 0.0,
    *,
    closed: bool = False,
    alpha: float = 1.0,
) -> fox.LinePrimitive:
    """A line this thick [m]; 0 = two pixels."""
    from foxglove import messages as fox

    kinds = fox.LinePrimitiveLineType
    return fox.LinePrimitive(
        type=kinds.LineLoop if closed else kinds.LineStrip,
        pose=_pose(),
        thickness=thickness or 2.0,
        scale_invariant=thickness == 0.0,
        points=[fox.Point3(x=x, y=y) for x, y in points],
        color=_colour(colour, alpha),
    )


def _text(words: str, at: Point, height: float = 0.02) -> fox.TextPrimitive:
    from foxglove import messages as fox

    return fox.TextPrimitive(
        pose=_pose(*at, z=height),
        billboard=True,
        font_size=12.0,
        scale_invariant=True,
        color=_colour(_INK),
        text=words,
    )


def _centre(polygon: Sequence[Point]) -> Point:
    at = shapely.Polygon(polygon).representative_point()
    return at.x, at.y
