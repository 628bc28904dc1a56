"""What a roadmap misses: free regions without nodes, and passages that it does not go through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from oath.model import Point
from oath.world.roadmap import Roadmap

_MOST_CELLS = 400
"""Cells of the raster along the longer side of the map, at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Missed:
    """Free room that the roadmap does not reach, though the robot would fit."""

    mode: int
    at: Point
    """Somewhere in the passage or region [m]."""
    area: float
    """Area of the smaller part that is cut off [m^2]."""


def missed(roadmap: Roadmap, mode: int) -> list[Missed]:
    """Compare a mode's free space, rastered, with the roadmap's components; largest first.

    A cell is free if a robot fits at its centre. Parts smaller than the robot's own square are left
    out: they are raster noise or of no use.
    """
    from scipy.ndimage import label  # a quarter of a second to import

    cells, corner, size = _free_cells(roadmap, mode)
    regions, count = label(cells)
    nodes = roadmap.nodes()
    parts = roadmap.components(mode)
    columns, rows = ((nodes - corner) / size).astype(int).T
    inside = (rows < cells.shape[0]) & (columns < cells.shape[1])
    region_of = np.zeros(len(nodes), dtype=int)
    region_of[inside] = regions[rows[inside], columns[inside]]
    least = max((2 * roadmap.modes[mode].radius) ** 2, 4 * size * size)
    areas = np.bincount(regions.ravel(), minlength=count + 1) * size * size
    found = []
    for region in range(1, count + 1):
        if areas[region] < least:
            continue
        members = np.flatnonzero(region_of == region)
        if not len(members):
            row, column = np.argwhere(regions == region)[0]
            at = corner + (np.array([column, row]) + 0.5) * size
            found.append(Missed(mode=mode, at=_point(at), area=float(areas[region])))
        else:
            found += _cuts(nodes, parts, members, float(areas[region]), mode, least)
    return sorted(found, key=lambda gap: -gap.area)


def _free_cells(
    roadmap: Roadmap, mode: int
) -> tuple[NDArray[np.bool_], NDArray[np.float64], float]:
    """Raster (rows, columns) of where a robot fits, its lower left corner and cell size [m]."""
    x0, y0, x1, y1 = roadmap.workspace.bounds
    radius = roadmap.modes[mode].radius
    size = max(radius / 2, max(x1 - x0, y1 - y0) / _MOST_CELLS)
    xs, ys = np.arange(x0 + size / 2, x1, size), np.arange(y0 + size / 2, y1, size)
    grid = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    clearance = roadmap.workspace.clearance(grid, roadmap.modes[mode].motion, 2 * radius)
    return (clearance >= radius).reshape(len(ys), len(xs)), np.array([x0, y0]), size


def _cuts(
    nodes: NDArray[np.float64],
    parts: NDArray[np.int32],
    members: NDArray[np.intp],
    area: float,
    mode: int,
    least: float,
) -> list[Missed]:
    """Where the roadmap falls apart within one free region: between its largest part and others."""
    names, sizes = np.unique(parts[members], return_counts=True)
    if len(names) == 1:
        return []
    main = members[parts[members] == names[np.argmax(sizes)]]
    tree = cKDTree(nodes[main])
    found = []
    for name, count in zip(names, sizes, strict=True):
        share = area * count / len(members)
        if name == names[np.argmax(sizes)] or share < least:
            continue
        others = members[parts[members] == name]
        gaps, nearest = tree.query(nodes[others])
        k = int(np.argmin(gaps))
        other = main[np.asarray(nearest)[k]]
        at = (nodes[others[k]] + nodes[other]) / 2
        found.append(Missed(mode=mode, at=_point(at), area=share))
    return found


def _point(at: NDArray[np.float64]) -> Point:
    return (round(float(at[0]), 2), round(float(at[1]), 2))
