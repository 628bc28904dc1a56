"""The obstacles: exact clearance, visibility, and what driving a straight line touches."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString
from shapely.geometry import Polygon as ShapelyPolygon

from oath import _core
from oath.model import Map, Motion, Obstacle, OccupancyGrid, Point, Polygon

Array = NDArray[np.float64]

_MAP = 0
"""Index of the kind that the map's own walls and cells have; no motion ignores it."""


@dataclass(frozen=True, slots=True)
class Mode:
    """A way of travelling: a motion and a radius [m]; robots that share it share travel costs."""

    motion: Motion
    radius: float

    def __hash__(self) -> int:
        return hash((self.motion.name, self.radius))


class Workspace:
    """The obstacles of a map, which may come and go, each of some kind.

    Parameters
    ----------
    map
        Its walls and cells block every motion. Its obstacles are added if they are known;
        the others have to be found and added then.
    """

    def __init__(self, map: Map) -> None:
        self.bounds = map.bounds
        self._kinds: dict[str, int] = {}
        self._shapes: dict[str, int] = {}
        self.obstacles: dict[str, Obstacle] = {}
        boundary = _boundary(map.grid) if map.grid is not None else np.empty((0, 2))
        segments = sum(len(wall) for wall in map.walls) + len(boundary) // 2
        self._core = _core.Workspace(*map.bounds, _cell_size(map.bounds, segments))
        for wall in map.walls:
            self._core.add_wall(_points(wall), map.wall_thickness / 2, _MAP)
        if map.grid is not None:
            grid = map.grid
            self._core.set_cells(
                np.ascontiguousarray(grid.occupied, dtype=np.uint8),
                grid.resolution, *grid.origin, _MAP, boundary,
            )  # fmt: skip
        for obstacle in map.obstacles:
            if obstacle.known:
                self.add(obstacle)

    @property
    def core(self) -> _core.Workspace:
        """The compiled workspace."""
        return self._core

    def add(self, obstacle: Obstacle) -> None:
        """Put an obstacle in; its id must be new."""
        kind = self._kinds.setdefault(obstacle.kind, len(self._kinds) + 1)
        self._shapes[obstacle.id] = self._core.add_polygon(_points(obstacle.polygon), kind)
        self.obstacles[obstacle.id] = obstacle

    def remove(self, id: str) -> Obstacle:
        """Take an obstacle out and return it."""
        self._core.remove(self._shapes.pop(id))
        return self.obstacles.pop(id)

    def blocked(self, motion: Motion | None) -> list[int]:
        """Flag the kinds that block a motion (None: everything there is blocks)."""
        return [1] + [int(motion is None or motion.blocked_by(kind)) for kind in self._kinds]

    def costly(self, motion: Motion) -> list[int]:
        """Flag the kinds inside which a motion pays extra."""
        return [0] + [int(kind in motion.cost) for kind in self._kinds]

    def permanent(self) -> list[int]:
        """Flag what can never go away: the map's own walls and cells."""
        return [1] + [0] * len(self._kinds)

    def clearance(self, points: Array, motion: Motion | None, limit: float = math.inf) -> Array:
        """Distance [m] of points (n, 2) to the nearest surface that blocks; 0 inside.

        Examples
        --------
        >>> wall = ((0.0, 2.0), (3.0, 2.0))
        >>> hall = Workspace(Map(bounds=(0, 0, 4, 4), walls=(wall,), wall_thickness=0.2))
        >>> hall.clearance(np.array([[1.0, 1.0], [1.0, 2.05]]), None).tolist()
        [0.9, 0.0]
        """
        distance: Array = self._core.clearance(
            np.ascontiguousarray(points), self.blocked(motion), limit
        )
        return distance

    def free(self, a: Array, b: Array, mode: Mode) -> NDArray[np.bool_]:
        """Whether a robot fits along each segment a[i]-b[i], (n, 2) each [m]."""
        flags = self._core.free(a, b, mode.radius, self.blocked(mode.motion))
        return flags.astype(np.bool_)

    def length(self, a: Array, b: Array, motion: Motion) -> Array:
        """Length of each segment, times the motion's factor where it pays extra [m]."""
        length: Array = np.hypot(b[:, 0] - a[:, 0], b[:, 1] - a[:, 1])
        costly = self.costly(motion)
        if any(costly):
            touched = ~self._core.free(a, b, 0.0, costly).astype(np.bool_)
            for i in np.flatnonzero(touched):
                length[i] += self._surcharge(a[i], b[i], motion, costly)
        return length

    def _surcharge(self, a: Array, b: Array, motion: Motion, costly: list[int]) -> float:
        line = LineString([a, b])
        near = set(self._core.shapes_near(a[0], a[1], b[0], b[1], 0.0, costly))
        extra = 0.0
        for id, shape in self._shapes.items():
            if shape in near:
                obstacle = self.obstacles[id]
                inside = line.intersection(ShapelyPolygon(obstacle.polygon)).length
                extra += (motion.cost[obstacle.kind] - 1.0) * inside
        return extra


class Zones:
    """The atoms that a straight move makes true: the zones it touches, the places it crosses.

    Only atoms that the rules speak of are told apart. Each set of atoms that occurs is a label
    class, numbered from 0 = none.
    """

    def __init__(
        self,
        bounds: tuple[float, float, float, float],
        zones: Mapping[str, Polygon],
        places: Mapping[str, Point],
        relevant: Iterable[str],
    ) -> None:
        self._core = _core.Workspace(*bounds, _cell_size(bounds, 64))
        self.atoms: list[str] = []
        for name in sorted(set(relevant)):
            if name in zones:
                self._core.add_polygon(_points(zones[name]), len(self.atoms))
                self.atoms.append(name)
            elif name in places:
                at = np.array([places[name]] * 2)
                self._core.add_wall(at, 1e-6, len(self.atoms))
                self.atoms.append(name)
        self.classes: list[frozenset[str]] = [frozenset()]
        self._numbers = {self.classes[0]: 0}

    @property
    def core(self) -> _core.Workspace:
        """The compiled zones; every kind in it is an atom."""
        return self._core

    @property
    def all(self) -> list[int]:
        """Flag every atom."""
        return [1] * len(self.atoms)

    def labels(self, a: Array, b: Array) -> NDArray[np.int32]:
        """Label class of each segment a[i]-b[i]."""
        labels = np.zeros(len(a), dtype=np.int32)
        if self.atoms:
            touched = ~self._core.free(a, b, 0.0, self.all).astype(np.bool_)
            for i in np.flatnonzero(touched):
                (ax, ay), (bx, by) = a[i], b[i]
                shapes = self._core.shapes_near(ax, ay, bx, by, 0.0, self.all)
                labels[i] = self._number(frozenset(self.atoms[s] for s in shapes))
        return labels

    def at(self, point: Point) -> frozenset[str]:
        """Atoms that hold at a point."""
        here = np.array([point])
        return self.classes[int(self.labels(here, here)[0])]

    def _number(self, atoms: frozenset[str]) -> int:
        if atoms not in self._numbers:
            self._numbers[atoms] = len(self.classes)
            self.classes.append(atoms)
        return self._numbers[atoms]


TURN = math.radians(45)
"""Largest turn at one corner node [rad]."""


def corners(
    map: Map, obstacles: Iterable[Obstacle], offset: float, spacing: float, turn: float = TURN
) -> Array:
    """Points around which shortest paths turn: corners and wall ends, pushed out by `offset` [m].

    The points circumscribe the circle that a disc's centre describes around a corner; the smaller
    `turn` [rad], the more of them and the nearer to the circle. Those of a raster are thinned to
    one in a square of side `spacing` [m]. They may lie in obstacles.
    """
    half = map.wall_thickness / 2
    found: list[Point] = []
    for wall in map.walls:
        for i, at in enumerate(wall):
            found += _around(at, wall[i - 1 : i] + wall[i + 1 : i + 2], half + offset, turn)
    for obstacle in obstacles:
        found += polygon_corners(obstacle.polygon, offset, turn)
    points = np.array(found, dtype=float).reshape(-1, 2)
    if map.grid is not None:
        points = np.concatenate([points, _grid_corners(map.grid, offset, spacing)])
    return points


def polygon_corners(polygon: Polygon, offset: float, turn: float = TURN) -> list[Point]:
    """The corners of a polygon, pushed out by `offset` [m]."""
    found: list[Point] = []
    for i, at in enumerate(polygon):
        found += _around(at, (polygon[i - 1], polygon[(i + 1) % len(polygon)]), offset, turn)
    return found


def _around(at: Point, neighbours: Sequence[Point], offset: float, turn: float) -> list[Point]:
    """Circumscribe the arc of radius `offset` around `at` that faces away from its neighbours."""
    angles = [math.atan2(y - at[1], x - at[0]) for x, y in neighbours if (x, y) != at]
    if not angles:
        return []
    spread = (angles[-1] - angles[0]) % math.tau
    if spread > math.pi:
        angles.reverse()
        spread = math.tau - spread
    arc = math.pi - spread
    if arc < math.radians(5):
        return []
    middle = angles[0] + spread / 2 + math.pi
    parts = max(1, math.ceil(arc / turn - 1e-9))
    reach = offset / math.cos(arc / parts / 2)
    angles = [middle + arc * ((k + 0.5) / parts - 0.5) for k in range(parts)]
    return [(at[0] + reach * math.cos(a), at[1] + reach * math.sin(a)) for a in angles]


def _grid_corners(grid: OccupancyGrid, offset: float, spacing: float) -> Array:
    occupied = np.pad(grid.occupied, 1).astype(np.int8)
    quads = [occupied[:-1, :-1], occupied[:-1, 1:], occupied[1:, :-1], occupied[1:, 1:]]
    alone = sum(quads) == 1
    parts = []
    for quad, (dx, dy) in zip(quads, [(1, 1), (-1, 1), (1, -1), (-1, -1)], strict=True):
        rows, columns = np.nonzero(alone & (quad == 1))
        parts.append(
            np.stack(
                [
                    grid.origin[0] + columns * grid.resolution + dx * offset,
                    grid.origin[1] + rows * grid.resolution + dy * offset,
                ],
                axis=1,
            )
        )
    points = np.concatenate(parts)
    _, first = np.unique(np.floor(points / spacing).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]


def _boundary(grid: OccupancyGrid) -> Array:
    """Ends (2 n, 2) of the maximal segments between free and occupied cells.

    What lies outside the raster counts as free: else an occupied cell would have no surface there,
    and a robot could drive along the edge of the map through it.
    """
    x, y, size = *grid.origin, grid.resolution
    occupied = np.pad(grid.occupied, 1)
    across = _runs(occupied[1:, 1:-1] != occupied[:-1, 1:-1])
    along = _runs((occupied[1:-1, 1:] != occupied[1:-1, :-1]).T)
    parts = []
    for line, first, last, turned in ((*across, False), (*along, True)):
        ends = np.stack([first, line, last, line], axis=1).reshape(-1, 2)
        parts.append(ends[:, ::-1] if turned else ends)
    lattice = np.concatenate(parts)
    return np.ascontiguousarray(lattice * size + np.array([x, y]))


def _runs(flags: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Row, first and one past the last column of every run of True in each row."""
    steps = np.diff(np.pad(flags, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, first = np.nonzero(steps == 1)
    return rows, first, np.nonzero(steps == -1)[1]


def _cell_size(bounds: tuple[float, float, float, float], segments: int) -> float:
    width, height = bounds[2] - bounds[0], bounds[3] - bounds[1]
    cells = min(max(8 * segments, 256), 1_000_000)
    # A thin map must not be cut into more columns than there are cells.
    return max(math.sqrt(width * height / cells), max(width, height) / cells)


def _points(points: Sequence[Point]) -> Array:
    return np.array(points, dtype=np.float64).reshape(-1, 2)
