"""The exact shortest paths that roadmaps are measured against, from a visibility graph.

Lozano-Pérez and Wesley, "An algorithm for planning collision-free paths among polyhedral
obstacles", 1979; round corners are circumscribed so finely that no path is 0.2 % too long.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from oath.model import Map, Mission
from oath.world.roadmap import World
from oath.world.workspace import Mode, Workspace, corners

Array = NDArray[np.float64]

TURN = math.radians(8)
"""Turn of a path at one node of a circumscribed corner, at most [rad]."""


def stop_points(mission: Mission) -> Array:
    """The points (n, 2) [m] of all stops, each once."""
    return np.array(sorted({stop.at for task in mission.tasks for stop in task.stops}))


def exact_lengths(map: Map, stops: Array, mode: Mode) -> Array:
    """Shortest lengths (n, n) [m] between stops (n, 2) [m] for a disc; inf = unreachable."""
    workspace = Workspace(map)
    around = corners(map, (), mode.radius + 1e-6, 1.0, turn=TURN)
    inside = np.all((around >= map.bounds[:2]) & (around <= map.bounds[2:]), axis=1)
    around = around[inside]
    around = around[workspace.clearance(around, mode.motion) >= mode.radius]
    nodes = np.concatenate([stops, around])
    i, j = np.triu_indices(len(nodes), 1)
    seen = workspace.free(nodes[i], nodes[j], mode)
    i, j = i[seen], j[seen]
    length = np.hypot(*(nodes[i] - nodes[j]).T)
    graph = csr_array((length, (i, j)), shape=(len(nodes), len(nodes)))
    found: Array = dijkstra(graph, directed=False, indices=np.arange(len(stops)))
    return found[:, : len(stops)]


def quality(world: World, stops: Array, exact: Array) -> tuple[float, float]:
    """How good a roadmap is between stops: mean excess, and share of pairs connected, both [%].

    The excess over the shortest lengths is that of the pairs that are connected; NaN without any.
    """
    nodes = [world.stops[(float(x), float(y))] for x, y in stops]
    lengths = world.roadmap.travel(0, nodes, nodes)
    apart = ~np.eye(len(stops), dtype=np.bool_) & np.isfinite(exact)
    joined = apart & np.isfinite(lengths)
    if not joined.any():
        return math.nan, 0.0
    excess = float((lengths[joined] / exact[joined] - 1.0).mean())
    return 100.0 * excess, 100.0 * float(joined.sum() / apart.sum())
