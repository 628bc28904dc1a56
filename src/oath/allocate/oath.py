"""The paper's allocator: cluster the tasks, auction the clusters, select tasks within them.

Source: Li, Ren, Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task Assignment and Planning
for Heterogeneous Robot Teaming" (2025). Where the paper is silent, the choice and its reason stand
with the stage.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from oath.allocate.auction import scores
from oath.allocate.clustering import Linkage, cluster
from oath.allocate.contract import Budget
from oath.allocate.problem import Problem
from oath.allocate.selection import Method, select
from oath.allocate.stages import three_stages
from oath.model import Assignment


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """What can be tuned; the defaults are the paper's."""

    clusters: int | None = None
    """Number of clusters K; None = min(n, max(4, R + 1)) for n tasks and R robots."""
    elbow: bool = False
    """Choose K at the elbow of the merge distances."""
    theta: float = 1.0
    """Weight of specialisation in the bids; 0 = travel cost only."""
    linkage: Linkage = "average"
    """Linkage of the clustering."""
    method: Method = "dp"
    """How tasks are selected: dynamic programming, or the paper's MILP."""


@dataclass(frozen=True, slots=True)
class Oath:
    """One round: each idle robot gets at most one cluster, and of it as much as it can carry.

    Deterministic: it uses neither the budget nor the random numbers.
    """

    params: Params = Params()
    reconsiders: ClassVar[bool] = False

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to idle robots; busy ones keep theirs.

        At least one task is taken if an idle robot can do any.
        """
        params = self.params
        return three_stages(
            problem,
            group=lambda tasks: cluster(
                problem,
                tasks,
                clusters=params.clusters,
                elbow=params.elbow,
                linkage=params.linkage,
            ),
            score=lambda clusters, able: scores(problem, clusters, able, params.theta),
            choose=lambda robot, tasks: select(problem, robot, tasks, method=params.method),
        )
