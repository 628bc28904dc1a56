"""Random small maps, zones and points to test the world and the planner in."""

from __future__ import annotations

import math

import numpy as np

from oath.model import Map, Motion, Obstacle, OccupancyGrid, Point, Polygon
from oath.world.halton import Density
from oath.world.roadmap import Params, Roadmap
from oath.world.workspace import Mode, Workspace, Zones

BOX = (0.0, 0.0, 8.0, 8.0)
KINDS = ("bush", "crate", "water")
GROUND = Motion(name="ground")
FLYER = Motion(name="flyer", ignores=frozenset({"bush"}))
WADER = Motion(name="wader", cost={"water": 2.5, "bush": 1.0})


def random_polygon(rng: np.random.Generator, at: Point, size: float) -> Polygon:
    """A simple polygon around a point, star-shaped and often not convex."""
    angles = np.sort(rng.uniform(0, math.tau, rng.integers(3, 8)))
    reach = rng.uniform(0.2, 1.0, len(angles)) * size
    if np.diff(angles, append=angles[0] + math.tau).max() > 3.0:  # the centre must be inside
        angles = np.linspace(0, math.tau, len(angles), endpoint=False)
    corners = np.array(at) + reach[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return tuple((float(x), float(y)) for x, y in corners)


def random_point(
    rng: np.random.Generator, box: tuple[float, ...] = BOX, beyond: float = 0.0
) -> Point:
    """A point in a box, or up to `beyond` outside of it."""
    x, y = rng.uniform(np.array(box[:2]) - beyond, np.array(box[2:]) + beyond)
    return (float(x), float(y))


def random_obstacle(rng: np.random.Generator, id: str, at: Point, size: float = 1.0) -> Obstacle:
    """An obstacle of a random kind around a point."""
    kind = KINDS[rng.integers(len(KINDS))]
    return Obstacle(id=id, kind=kind, polygon=random_polygon(rng, at, size))


def random_map(
    rng: np.random.Generator,
    *,
    walls: int = 4,
    obstacles: int = 3,
    box: tuple[float, float, float, float] = BOX,
    beyond: float = 0.0,
    thickness: float | None = None,
) -> Map:
    """A map with polyline walls and overlapping obstacles, some of them `beyond` its bounds."""
    size = max(box[2] - box[0], box[3] - box[1]) / 8
    lines = []
    for _ in range(walls):
        x, y = random_point(rng, box, beyond)
        steps = rng.uniform(-2, 2, (rng.integers(1, 4), 2)) * size
        ends = np.cumsum([(x, y), *steps], axis=0)
        lines.append(tuple((float(x), float(y)) for x, y in ends))
    return Map(
        bounds=box,
        walls=tuple(lines),
        wall_thickness=float(rng.choice([0.0, 0.1, 0.4])) if thickness is None else thickness,
        obstacles=tuple(
            random_obstacle(rng, f"o{i}", random_point(rng, box, beyond), size)
            for i in range(obstacles)
        ),
    )


def random_grid(rng: np.random.Generator, rows: int, columns: int, share: float) -> OccupancyGrid:
    """A raster with a share of its cells occupied, not at the origin."""
    return OccupancyGrid(
        occupied=rng.random((rows, columns)) < share, resolution=0.25, origin=(-1.0, 2.0)
    )


def small_roadmap(
    map: Map,
    *,
    modes: tuple[Mode, ...] = (Mode(GROUND, 0.1),),
    points: int = 40,
    corners: bool = True,
    zones: dict[str, Polygon] | None = None,
    relevant: frozenset[str] = frozenset(),
    seed: int = 0,
) -> Roadmap:
    """A sparse roadmap through a map, without corners of what the map already holds."""
    return Roadmap(
        Workspace(map),
        Zones(map.bounds, zones or {}, {}, relevant),
        modes,
        Params(points=points, corners=corners, density=Density(d_min=0.15)),
        np.random.default_rng(seed),
        corner_points=np.empty((0, 2)),
    )
