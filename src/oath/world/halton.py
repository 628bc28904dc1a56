"""Adaptive Halton sampling: quasi-random points, denser near obstacles.

Halton, "On the efficiency of certain quasi-random sequences of points", 1960; the acceptance
function is that of Li et al., "Adaptive Obstacle-Aware Task Assignment and Planning for
Heterogeneous Robot Teaming", 2025.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oath.model import Motion
from oath.world.workspace import Workspace

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Density:
    """How likely a point at distance d [m] from the nearest obstacle is kept.

    p(d) = 0 for d < d_min, else max(beta, exp(-(d - d_opt)^2 / (2 sigma^2))).
    """

    d_min: float = 0.3
    d_opt: float = 0.4
    sigma: float = 0.5
    beta: float = 0.2

    def __call__(self, distance: Array) -> Array:
        """Acceptance probability (n,) for distances (n,) [m].

        Examples
        --------
        >>> Density()(np.array([0.2, 0.4, 5.0])).tolist()
        [0.0, 1.0, 0.2]
        """
        near = np.exp(-((distance - self.d_opt) ** 2) / (2 * self.sigma**2))
        return np.where(distance < self.d_min, 0.0, np.maximum(self.beta, near))


def radical_inverse(base: int, first: int, count: int) -> Array:
    """Van der Corput's sequence: the digits of first .. first + count - 1, mirrored at the point.

    Examples
    --------
    >>> radical_inverse(2, 1, 4).tolist()
    [0.5, 0.25, 0.75, 0.125]
    """
    rest = np.arange(first, first + count)
    value = np.zeros(count)
    scale = 1.0 / base
    while rest.any():
        rest, digit = np.divmod(rest, base)
        value += digit * scale
        scale /= base
    return value


class Halton:
    """The Halton sequence in bases 2 and 3 over a box, shifted modulo 1 by a seeded vector."""

    def __init__(self, bounds: tuple[float, float, float, float], rng: np.random.Generator) -> None:
        self._corner = np.array(bounds[:2], dtype=float)
        self._size = np.array(bounds[2:], dtype=float) - self._corner
        self._shift = rng.random(2)
        self._next = 1

    def take(self, count: int) -> Array:
        """The next points (count, 2) [m]."""
        points = np.stack([radical_inverse(b, self._next, count) for b in (2, 3)], axis=1)
        self._next += count
        taken: Array = self._corner + (points + self._shift) % 1.0 * self._size
        return taken


_MOST_TRIES = 100
"""Give up filling the map after this many candidates per point wanted: there is hardly room."""


def sample(
    workspace: Workspace,
    motions: Iterable[Motion],
    count: int,
    density: Density,
    rng: np.random.Generator,
) -> Array:
    """Sample up to `count` points (n, 2) [m] that some motion accepts.

    A motion sees only the obstacles that block it, so the inside of a bush is sampled for drones.
    Fewer points come back when hardly any of the map is free.
    """
    sequence = Halton(workspace.bounds, rng)
    # Motions that the same kinds block accept the same points.
    distinct = list({tuple(workspace.blocked(motion)): motion for motion in motions}.values())
    far = density.d_opt + 6 * density.sigma
    kept: list[Array] = []
    found = tried = 0
    while found < count and tried < _MOST_TRIES * count:
        batch = sequence.take(max(256, 2 * (count - found)))
        tried += len(batch)
        chance = np.zeros(len(batch))
        for motion in distinct:
            chance = np.maximum(chance, density(workspace.clearance(batch, motion, far)))
        batch = batch[rng.random(len(batch)) < chance]
        kept.append(batch)
        found += len(batch)
    return np.concatenate(kept)[:count] if kept else np.empty((0, 2))
