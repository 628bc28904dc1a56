"""Baseline: k-means on coordinates, auction, optimal selection on travel costs.

Source: the second baseline of Li, Ren, Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task
Assignment and Planning for Heterogeneous Robot Teaming" (2025). What separates it from `Oath` is
that its clusters do not know of obstacles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from oath.allocate.auction import scores
from oath.allocate.clustering import kmeans
from oath.allocate.contract import Budget
from oath.allocate.problem import Problem
from oath.allocate.selection import Method, select
from oath.allocate.stages import three_stages
from oath.model import Assignment


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """What can be tuned; the defaults are those of `Oath`."""

    clusters: int | None = None
    """Number of clusters K; None = min(n, max(4, R + 1)) for n tasks and R robots."""
    theta: float = 1.0
    """Weight of specialisation in the bids; 0 = travel cost only."""
    method: Method = "dp"
    """How tasks are selected: dynamic programming, or the paper's MILP."""


@dataclass(frozen=True, slots=True)
class Kam:
    """One round: each idle robot gets at most one cluster, and of it as much as it can carry.

    A centroid may lie inside a wall, where nobody can travel, so robots bid their travel cost to
    the task nearest to it. The random numbers choose where k-means begins; the budget is not used.
    """

    params: Params = Params()
    reconsiders: ClassVar[bool] = False

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to idle robots; busy ones keep theirs."""
        params = self.params
        return three_stages(
            problem,
            group=lambda tasks: kmeans(problem, tasks, rng, clusters=params.clusters),
            score=lambda clusters, able: scores(problem, clusters, able, params.theta),
            choose=lambda robot, tasks: select(problem, robot, tasks, method=params.method),
        )
