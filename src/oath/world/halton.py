"""Adaptive Halton sampling: quasi-random points, denser near obstacles.

Halton, "On the efficiency of certain quasi-random sequences of points", 1960; the acceptance
function is that of Li et al., "Adaptive Obstacle-Aware Task Assignment and Planning for
Heterogeneous Robot Teaming", 2025.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from oath.model import Motion
from oath.world.workspace import Workspace

Array = NDArray[np.float64]
Sampling = Literal["adaptive", "uniform", "grid", "random"]
"""Halton denser near obstacles; Halton; a square grid; random as in a probabilistic roadmap."""


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


class Random:
    """Independent uniform points over a box, as probabilistic roadmaps take them.

    Kavraki, Švestka, Latombe, Overmars, "Probabilistic roadmaps for path planning in
    high-dimensional configuration spaces", 1996.
    """

    def __init__(self, bounds: tuple[float, float, float, float], rng: np.random.Generator) -> None:
        self._bounds, self._rng = bounds, rng

    def take(self, count: int) -> Array:
        """The next points (count, 2) [m]."""
        return self._rng.uniform(self._bounds[:2], self._bounds[2:], (count, 2))


_MOST_TRIES = 100
"""Give up filling the map after this many candidates per point wanted: there is hardly room."""


def sample(
    workspace: Workspace,
    motions: Iterable[Motion],
    count: int,
    density: Density,
    rng: np.random.Generator,
    sampling: Sampling = "adaptive",
) -> Array:
    """Sample up to `count` points (n, 2) [m] that some motion accepts.

    A motion sees only the obstacles that block it, so the inside of a bush is sampled for drones.
    Fewer points come back when hardly any of the map is free.

    All but ``adaptive`` are for comparison: they keep every point that is `d_min` from obstacles.
    """
    # Motions that the same kinds block accept the same points.
    distinct = list({tuple(workspace.blocked(motion)): motion for motion in motions}.values())
    far = density.d_opt + 6 * density.sigma
    if sampling != "adaptive":
        density = replace(density, beta=1.0)
    if sampling == "grid":
        return _grid(workspace, distinct, count, density, rng)
    sequence = (Random if sampling == "random" else Halton)(workspace.bounds, rng)
    kept: list[Array] = []
    found = tried = 0
    while found < count and tried < _MOST_TRIES * count:
        batch = sequence.take(max(256, 2 * (count - found)))
        tried += len(batch)
        chance = _chance(workspace, distinct, batch, density, far)
        batch = batch[rng.random(len(batch)) < chance]
        kept.append(batch)
        found += len(batch)
    return np.concatenate(kept)[:count] if kept else np.empty((0, 2))


def _chance(
    workspace: Workspace, motions: list[Motion], points: Array, density: Density, far: float
) -> Array:
    chance = np.zeros(len(points))
    for motion in motions:
        chance = np.maximum(chance, density(workspace.clearance(points, motion, far)))
    return chance


def _grid(
    workspace: Workspace,
    motions: list[Motion],
    count: int,
    density: Density,
    rng: np.random.Generator,
) -> Array:
    """Points (n, 2) of the finest square grid, shifted at random, of which at most `count` stay."""
    x0, y0, x1, y1 = workspace.bounds
    shift = rng.random(2)
    space = 2 * math.sqrt((x1 - x0) * (y1 - y0) / max(count, 1))
    kept = np.empty((0, 2))
    # How much room walls take is not known, so grids are tried from a coarse one on.
    for _ in range(_MOST_TRIES):
        x = np.arange(x0 + shift[0] * space, x1, space)
        y = np.arange(y0 + shift[1] * space, y1, space)
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        points = points[_chance(workspace, motions, points, density, 2 * density.d_min) > 0]
        if len(points) > 1.1 * count + 4:
            break
        if len(kept) < len(points) <= count:
            kept = points
        space *= 0.98
    return kept
