"""The first stage: group tasks that lie near each other along paths that robots can travel.

Source: Li, Ren, Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task Assignment and Planning
for Heterogeneous Robot Teaming" (2025). Where the paper is silent: the distance of two tasks is
from pickup to pickup, and the centre of a cluster is its medoid, which unlike a mean is a place
that robots can be sent to.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from oath.allocate.problem import Problem

Linkage = Literal["single", "complete", "average", "weighted"]
"""The methods that need nothing but distances."""

FEWEST = 4
"""Clusters made even for very few robots, if there are as many tasks."""

APART = 10.0
"""Distance of tasks between which no robot can travel, in multiples of the greatest other."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cluster:
    """Tasks that lie near each other."""

    tasks: NDArray[np.intp]
    """(n,) task indices, rising."""
    medoid: int
    """The task that stands for all: with the least sum of distances to the others, or the nearest
    to their mean."""
    share: NDArray[np.float64]
    """(T,) part of each task type; sums to 1."""


def distances(problem: Problem, tasks: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return (n, n) symmetric distances [m] from pickup to pickup: the mean over modes and ways.

    Only modes and directions in which the other pickup can be reached count; with none the distance
    is `APART` times the greatest of the others.
    """
    at = problem.pickup[tasks]
    ways = problem.cost[np.ix_(np.unique(problem.mode), at, at)]
    ways = np.concatenate([ways, ways.transpose(0, 2, 1)])
    reached = np.isfinite(ways)
    count = reached.sum(axis=0)
    sums = np.where(reached, ways, 0.0).sum(axis=0)
    mean: NDArray[np.float64] = sums / np.maximum(count, 1)
    mean[count == 0] = APART * max(1.0, float(mean.max(initial=0.0)))
    np.fill_diagonal(mean, 0.0)
    return mean


def cluster(
    problem: Problem,
    tasks: NDArray[np.intp],
    *,
    clusters: int | None = None,
    elbow: bool = False,
    linkage: Linkage = "average",
) -> list[Cluster]:
    """Group tasks by agglomerative clustering.

    Parameters
    ----------
    tasks
        (n,) indices of the tasks to group.
    clusters
        How many clusters; None = min(n, max(`FEWEST`, R + 1)). With fewer tasks than robots every
        task is a cluster of its own, so that every robot can get one.
    elbow
        Choose the number at the elbow of the merge distances instead.
    linkage
        Method of `scipy.cluster.hierarchy.linkage`.

    Returns
    -------
    list[Cluster]
        In the order of their first tasks; empty for no tasks.
    """
    n, robots = len(tasks), len(problem.robots)
    if n == 0:
        return []
    wanted = count(n, robots, clusters)
    distance = distances(problem, tasks)
    if n < robots or (wanted == n and not elbow):
        groups = [[i] for i in range(n)]
    else:
        groups = _merge(distance, wanted, elbow, linkage)
    found = []
    for group in groups:
        nearest = int(np.argmin(distance[np.ix_(group, group)].sum(axis=1)))
        found.append(_describe(problem, tasks[group], nearest))
    return found


def count(tasks: int, robots: int, clusters: int | None = None) -> int:
    """Return how many clusters to make, see `cluster`."""
    if tasks < robots:
        return tasks
    wanted = max(FEWEST, robots + 1) if clusters is None else max(1, clusters)
    return min(tasks, wanted)


def kmeans(
    problem: Problem,
    tasks: NDArray[np.intp],
    rng: np.random.Generator,
    *,
    clusters: int | None = None,
) -> list[Cluster]:
    """Group tasks by where their pickups are on the map, whatever stands in between.

    Source: Lloyd, "Least squares quantization in PCM" (1982), begun as in Arthur, Vassilvitskii,
    "k-means++: The advantages of careful seeding" (2007).

    Parameters
    ----------
    tasks, clusters
        As in `cluster`. Fewer clusters come out where fewer pickups differ.

    Returns
    -------
    list[Cluster]
        In the order of their first tasks. `medoid` is the task nearest to the centroid.
    """
    if not len(tasks):
        return []
    points = problem.points[problem.pickup[tasks]]
    _, places = np.unique(points, axis=0, return_inverse=True)
    wanted = min(count(len(tasks), len(problem.robots), clusters), int(places.max()) + 1)
    labels = _lloyd(points, wanted, rng)
    found = []
    for group in sorted(np.flatnonzero(labels == k).tolist() for k in np.unique(labels)):
        off = points[group] - points[group].mean(axis=0)
        nearest = int(np.argmin(np.hypot(off[:, 0], off[:, 1])))
        found.append(_describe(problem, tasks[group], nearest))
    return found


def _lloyd(points: NDArray[np.float64], wanted: int, rng: np.random.Generator) -> NDArray[np.int32]:
    from scipy.cluster.vq import kmeans2  # a third of a second to import

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a cluster that lost its tasks is left out
        _, labels = kmeans2(points, wanted, iter=50, minit="++", seed=rng)
    return labels


def _merge(
    distance: NDArray[np.float64], wanted: int, elbow: bool, method: Linkage
) -> list[list[int]]:
    # A third of a second to import, and needed only where something is to be merged.
    from scipy.cluster.hierarchy import linkage
    from scipy.spatial.distance import squareform

    n = len(distance)
    if n == 1:
        return [[0]]
    merges = linkage(squareform(distance, checks=False), method=method)
    if elbow:
        wanted = elbow_count(merges[:, 2])
    # Cut after n - K merges: a cut by distance gives fewer clusters where distances are tied.
    groups = {i: [i] for i in range(n)}
    for step, (a, b) in enumerate(merges[: n - wanted, :2].astype(int).tolist()):
        groups[n + step] = groups.pop(a) + groups.pop(b)
    return sorted(sorted(group) for group in groups.values())


def elbow_count(heights: NDArray[np.float64]) -> int:
    """Return the number of clusters at the elbow of the merge distances.

    That is the count whose point (count, distance of the merge that ends it) lies farthest below
    the chord from the first to the last, with both axes scaled to [0, 1].

    Parameters
    ----------
    heights
        (n - 1,) rising distances of the merges of n things.

    Examples
    --------
    Three tight groups:

    >>> elbow_count(np.array([0.1, 0.1, 0.2, 0.2, 9.0, 10.0]))
    3
    >>> elbow_count(np.array([1.0]))
    1
    """
    falling = heights[::-1]  # entry k: the merge that makes k + 1 clusters of k + 2
    span = falling[0] - falling[-1]
    if len(falling) < 3 or span <= 0:
        return 1
    x = np.linspace(0.0, 1.0, len(falling))
    below = 1.0 - x - (falling - falling[-1]) / span
    return int(np.argmax(below)) + 1


def _describe(problem: Problem, tasks: NDArray[np.intp], medoid: int) -> Cluster:
    counts = np.bincount(problem.type[tasks], minlength=problem.capability.shape[1])
    return Cluster(tasks=tasks, medoid=int(tasks[medoid]), share=counts / len(tasks))
