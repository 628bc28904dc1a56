"""Baseline: k-means on coordinates, auction, nearest neighbour; straight lines throughout.

Source: the first baseline of Li, Ren, Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task
Assignment and Planning for Heterogeneous Robot Teaming" (2025). It knows of obstacles only that
some stops cannot be reached at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from oath.allocate.auction import scores
from oath.allocate.clustering import Cluster, kmeans
from oath.allocate.contract import Budget, stop_location, stop_names
from oath.allocate.problem import Problem
from oath.allocate.selection import Picks
from oath.allocate.stages import quota, three_stages
from oath.model import Assignment, StopName


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """What can be tuned; the defaults are those of `Oath`."""

    clusters: int | None = None
    """Number of clusters K; None = min(n, max(4, R + 1)) for n tasks and R robots."""
    theta: float = 1.0
    """Weight of specialisation in the bids; 0 = distance only."""


@dataclass(frozen=True, slots=True)
class Kan:
    """One round: each idle robot gets at most one cluster, and of it as much as it can carry.

    Robots bid their straight distance to the centroid. The random numbers choose where k-means
    begins; the budget is not used.
    """

    params: Params = Params()
    reconsiders: ClassVar[bool] = False

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to idle robots; busy ones keep theirs."""
        params = self.params
        return three_stages(
            problem,
            group=lambda tasks: kmeans(problem, tasks, rng, clusters=params.clusters),
            score=lambda clusters, able: scores(
                problem, clusters, able, params.theta, travel=to_centroids(problem, clusters)
            ),
            choose=lambda robot, tasks: nearest_neighbour(problem, robot, tasks),
        )


def to_centroids(problem: Problem, clusters: Sequence[Cluster]) -> NDArray[np.float64]:
    """Return (R, K) straight distances [m] from the robots to the means of the pickups."""
    centroids = [problem.points[problem.pickup[c.tasks]].mean(axis=0) for c in clusters]
    off = problem.points[problem.start][:, None] - np.array(centroids).reshape(-1, 2)
    distance: NDArray[np.float64] = np.hypot(off[..., 0], off[..., 1])
    return distance


def nearest_neighbour(problem: Problem, robot: int, candidates: Sequence[int]) -> Picks:
    """Go to the nearest stop, again and again, until all that was taken is delivered.

    A stop is a pickup or visit as long as the robot may take more tasks, or the delivery of
    something aboard. The nearest is that by straight distance, ties by candidate, among those that
    can be reached. Where one-sided costs strand a load, one task less is taken.

    Parameters
    ----------
    robot
        Index of the robot.
    candidates
        Indices of tasks; those that the robot cannot do are passed over.

    Returns
    -------
    Picks
        Empty only if no candidate is feasible.
    """
    feasible = problem.feasible()[robot]
    tasks = [task for task in candidates if feasible[task]]
    for most in range(min(int(quota(problem)[robot]), len(tasks)), 0, -1):
        picks = _walk(problem, robot, tasks, most)
        if picks is not None:
            return picks
    return ()


def _walk(problem: Problem, robot: int, tasks: Sequence[int], most: int) -> Picks | None:
    cost, at = problem.cost[problem.mode[robot]], int(problem.start[robot])
    waiting, aboard = list(tasks), list[int]()
    picks: list[tuple[int, StopName]] = []
    taken = 0
    while True:
        stops = [(task, stop_names(problem, task)[0]) for task in waiting if taken < most]
        stops += [(task, "delivery") for task in aboard]
        there = [stop_location(problem, task, name) for task, name in stops]
        off = problem.points[there] - problem.points[at]
        distance = np.where(np.isfinite(cost[at, there]), np.hypot(off[:, 0], off[:, 1]), np.inf)
        if not np.isfinite(distance).any():
            return None if aboard else tuple(picks)
        nearest = int(np.argmin(distance))
        at, (task, name) = there[nearest], stops[nearest]
        picks.append((task, name))
        if name == "delivery":
            aboard.remove(task)
        else:
            waiting.remove(task)
            taken += 1
            if name == "pickup":
                aboard.append(task)
