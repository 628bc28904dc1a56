"""The values of the domain: frozen, without behaviour beyond what they say of themselves.

Lengths are metres and times seconds; points are (x, y) in the world frame of the mission's map.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float]
Polygon = tuple[Point, ...]
"""The corners of a simple polygon in order, the first not repeated at the end."""

Priority = Literal["low", "normal", "high"]
StopName = Literal["pickup", "delivery", "visit"]

WALL = "wall"
"""The kind of the map's own walls and occupied cells; they block every motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Where a robot must go for a task, and which of the task's stops it is."""

    name: StopName
    at: Point
    place: str | None = None
    """Name of the place that `at` was given by, if any."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """An ordered list of stops: a delivery has pickup then delivery, an inspection one visit."""

    id: str
    type: str
    stops: tuple[Stop, ...]
    priority: Priority = "normal"
    service_time: float = 0.0
    """Time spent at each stop [s]."""

    def stop(self, name: str) -> Stop:
        """Return the stop with this name."""
        return next(stop for stop in self.stops if stop.name == name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A class of movement: which kinds of obstacle it ignores, which only cost it extra."""

    name: str
    ignores: frozenset[str] = frozenset()
    cost: Mapping[str, float] = field(default_factory=dict)
    """Factor (>= 1) on the distance travelled inside obstacles of a kind; these do not block."""

    def blocked_by(self, kind: str) -> bool:
        """Whether obstacles of this kind (other than the map's own walls) stop this motion."""
        return kind not in self.ignores and kind not in self.cost


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """One robot: start [m], capacity (tasks at once), speed [m/s], radius and sensing range [m]."""

    id: str
    start: Point
    motion: str
    can: Mapping[str, float]
    """How well it does each task type, in (0, 1]; a type that is missing it cannot do."""
    capacity: int
    speed: float
    radius: float
    sensing: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A polygon of some kind; unknown ones exist from the start but must be found."""

    id: str
    kind: str
    polygon: Polygon
    known: bool = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OccupancyGrid:
    """Cells of a raster map.

    `occupied` is (rows, columns) bool with row 0 at the lowest y; `origin` is the lower left corner
    of cell (0, 0) and `resolution` the cell size [m].
    """

    occupied: NDArray[np.bool_]
    resolution: float
    origin: Point


@dataclass(frozen=True, slots=True, kw_only=True)
class Map:
    """What is known of the world: bounds of the robots' centres, walls, cells, obstacles."""

    bounds: tuple[float, float, float, float]
    """x_min, y_min, x_max, y_max."""
    walls: tuple[tuple[Point, ...], ...] = ()
    """Polylines; a wall is every point within half of `wall_thickness` of its polyline."""
    wall_thickness: float = 0.0
    grid: OccupancyGrid | None = None
    obstacles: tuple[Obstacle, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """Map, places, robots, tasks and rules: all that a run needs."""

    name: str
    map: Map
    motions: Mapping[str, Motion]
    places: Mapping[str, Point]
    task_types: tuple[str, ...]
    robots: tuple[Robot, ...]
    tasks: tuple[Task, ...]
    zones: Mapping[str, Polygon]
    rules: tuple[str, ...]
    source: str | None = None
    """Path of the file it was read from."""

    def robot(self, id: str) -> Robot:
        """Return the robot with this id."""
        return next(robot for robot in self.robots if robot.id == id)

    def task(self, id: str) -> Task:
        """Return the task with this id."""
        return next(task for task in self.tasks if task.id == id)


@dataclass(frozen=True, slots=True, kw_only=True)
class RouteStop:
    """One entry of a route: a task's id and which of its stops."""

    task: str
    stop: StopName


Route = tuple[RouteStop, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """The routes of all robots, and why each task outside of them is unassigned.

    A solver that proves something says so: no assignment of the same tasks has an objective below
    `lower_bound`, and `optimal` ones reach it.
    """

    routes: Mapping[str, Route]
    unassigned: Mapping[str, str]
    lower_bound: float | None = None
    optimal: bool = False
