"""The second stage: robots bid for clusters, weighted by how well they suit them.

Source: Li, Ren, Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task Assignment and Planning
for Heterogeneous Robot Teaming" (2025); the bidding follows Choi, Brunet, How, "Consensus-Based
Decentralized Auctions for Robust Task Allocation" (2009).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oath.allocate.clustering import Cluster
from oath.allocate.problem import Problem


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """Who won which cluster."""

    won: NDArray[np.intp]
    """(R,) index of the robot's cluster, -1 = none."""
    bids: int
    """Bids made; at most R times K, since nobody bids twice for the same cluster."""


def specialisation(problem: Problem, clusters: Sequence[Cluster]) -> NDArray[np.float64]:
    """Return gamma, (R, K): how well a robot suits a cluster.

    gamma[r, k] = sum over types t of share[k, t] * c[r, t] / n[r], where c are the robot's
    capabilities and n how many types it can do: one that can do little else is preferred for what
    it can do, and half the capability doubles the bid.
    """
    types = (problem.capability > 0).sum(axis=1, keepdims=True)
    scaled = problem.capability / np.maximum(types, 1)
    shares = np.array([cluster.share for cluster in clusters]).reshape(-1, scaled.shape[1])
    gamma: NDArray[np.float64] = scaled @ shares.T
    return gamma


def scores(
    problem: Problem,
    clusters: Sequence[Cluster],
    feasible: NDArray[np.bool_],
    theta: float = 1.0,
    travel: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return (R, K) scores, lower is better: travel[r, k] / gamma[r, k] ** theta.

    A robot that does not suit a cluster (gamma = 0), has nothing to do in it or cannot travel to it
    has the score inf. That mask comes before theta: with theta = 0 the power would be 1.

    Parameters
    ----------
    feasible
        (R, P) which robot can do which task.
    theta
        Weight of the specialisation; 0 = travel cost only.
    travel
        (R, K) how far each robot is from each cluster [m], inf = out of reach; None = its travel
        cost to the medoid's pickup.
    """
    if travel is None:
        medoids = problem.pickup[np.array([cluster.medoid for cluster in clusters], dtype=np.intp)]
        travel = problem.cost[problem.mode[:, None], problem.start[:, None], medoids]
    gamma = specialisation(problem, clusters)
    open_ = (gamma > 0) & np.isfinite(travel)
    for k, cluster in enumerate(clusters):
        open_[:, k] &= feasible[:, cluster.tasks].any(axis=1)
    score = np.full(gamma.shape, np.inf)
    score[open_] = travel[open_] / gamma[open_] ** theta
    return score


def auction(score: NDArray[np.float64]) -> Outcome:
    """Let each robot bid for its best cluster until nobody is outbid.

    A cluster accepts a bid only if (score, robot index) is strictly lower than what it holds; the
    outbid robot bids again. Held bids only fall, so a cluster that refused a robot once refuses it
    for ever: the auction ends after at most R * K bids, with one robot a cluster at most, and the
    result does not depend on the order of the bids.

    Parameters
    ----------
    score
        (R, K), inf = this robot may not have this cluster.

    Examples
    --------
    Both want cluster 0; the second is nearer, the first goes elsewhere:

    >>> auction(np.array([[2.0, 5.0], [1.0, 9.0]])).won.tolist()
    [1, 0]
    >>> auction(np.array([[2.0], [2.0]])).won.tolist()  # a tie goes to the lower index
    [0, -1]
    >>> auction(np.full((1, 2), np.inf)).won.tolist()  # idles
    [-1]
    """
    robots = len(score)
    ranking = np.argsort(score, axis=1, kind="stable").tolist()
    table = score.tolist()
    held: dict[int, tuple[float, int]] = {}
    tried = [0] * robots  # how far down its ranking a robot is
    waiting, bids = deque(range(robots)), 0
    while waiting:
        robot = waiting.popleft()
        while tried[robot] < score.shape[1]:
            k = ranking[robot][tried[robot]]
            bid = (table[robot][k], robot)
            if bid[0] == np.inf:
                break
            tried[robot] += 1
            bids += 1
            if k not in held or bid < held[k]:
                if k in held:
                    waiting.append(held[k][1])
                held[k] = bid
                break
    won = np.full(robots, -1, dtype=np.intp)
    for k, (_, robot) in held.items():
        won[robot] = k
    return Outcome(won=won, bids=bids)
