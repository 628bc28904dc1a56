"""Which nodes lie side by side: Delaunay edges, pairs each once, and an order along a curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError

Array = NDArray[np.float64]


def delaunay_edges(nodes: Array) -> NDArray[np.int64]:
    """Every edge (m, 2) of the Delaunay triangulation once, hull edges included."""
    try:
        triangles = Delaunay(nodes).simplices.astype(np.int64)
    except (QhullError, ValueError):  # fewer than three points, or all on a line
        order = np.lexsort(nodes.T)
        return np.stack([order[:-1], order[1:]], axis=1)
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return unique(pairs, len(nodes))


def unique(pairs: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Undirected pairs (m, 2) of n nodes, each once and sorted."""
    codes = np.unique(pairs.min(axis=1) * n + pairs.max(axis=1))
    return np.stack(np.divmod(codes, n), axis=1)


def along_curve(nodes: Array) -> NDArray[np.intp]:
    """Order nodes along a Z-curve, so that neighbours on the map are neighbours in memory."""
    if not len(nodes):
        return np.empty(0, dtype=np.intp)
    low = nodes.min(axis=0)
    size = max(float((nodes.max(axis=0) - low).max()), 1e-9)
    cells = ((nodes - low) / size * 0xFFFF).astype(np.uint64)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        cells = (cells | (cells << np.uint64(shift))) & np.uint64(mask)
    return np.argsort(cells[:, 0] | (cells[:, 1] << np.uint64(1)), kind="stable")
