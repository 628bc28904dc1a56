"""Travel costs between stops, kept until the roadmap changes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from oath.world.roadmap import Roadmap


class TravelCosts:
    """Shortest obstacle-aware distances per mode, without touching what is to be avoided.

    Law: `between` equals `Roadmap.travel` over the same nodes, whatever was asked before.

    Parameters
    ----------
    roadmap
        May change at any time.
    avoid
        Atoms that no path may touch.
    """

    def __init__(self, roadmap: Roadmap, avoid: frozenset[str]) -> None:
        self._roadmap, self._avoid = roadmap, avoid
        self._version = -1
        self._places: list[dict[int, int]] = []
        self._costs: list[NDArray[np.float64]] = []

    def between(self, mode: int, nodes: Sequence[int]) -> NDArray[np.float64]:
        """Costs (n, n) [m] between nodes, inf = unreachable. Only nodes not seen yet take time."""
        if self._version != self._roadmap.version:
            self._version = self._roadmap.version
            self._places = [{} for _ in self._roadmap.modes]
            self._costs = [np.empty((0, 0)) for _ in self._roadmap.modes]
        places = self._places[mode]
        new = [node for node in dict.fromkeys(nodes) if node not in places]
        if new:
            self._extend(mode, new)
        wanted = [places[node] for node in nodes]
        return self._costs[mode][np.ix_(wanted, wanted)]

    def _extend(self, mode: int, new: list[int]) -> None:
        places, old = self._places[mode], self._costs[mode]
        known = len(places)
        places.update((node, known + i) for i, node in enumerate(new))
        rows = self._roadmap.travel(mode, new, list(places), self._avoid)
        costs = np.empty((len(places), len(places)))
        costs[:known, :known] = old
        costs[known:] = rows
        costs[:known, known:] = rows[:, :known].T  # edges cost the same both ways
        self._costs[mode] = costs
