"""The paper's allocator: cluster the tasks, auction the clusters, select tasks within them.

Source: Li, Ren, Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task Assignment and Planning
for Heterogeneous Robot Teaming" (2025). Where the paper is silent, the choice and its reason stand
with the stage.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from oath.allocate.auction import auction, scores
from oath.allocate.clustering import Linkage, cluster
from oath.allocate.contract import Budget, reasons, to_route
from oath.allocate.problem import Problem
from oath.allocate.selection import Method, Picks, select
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
        feasible = problem.feasible()
        free = in_no_route(problem)
        doable = np.flatnonzero(free & feasible.any(axis=0))
        able = feasible & ~problem.busy[:, None] & free
        won = self._round(problem, doable, able) if able.any() else {}
        routes = dict(zip(problem.robots, problem.routes, strict=True))
        for robot, picks in won.items():
            routes[problem.robots[robot]] = to_route(problem, picks)
            free[[task for task, _ in picks]] = False
        return Assignment(routes=routes, unassigned=reasons(problem, np.flatnonzero(free).tolist()))

    def _round(
        self, problem: Problem, tasks: NDArray[np.intp], able: NDArray[np.bool_]
    ) -> dict[int, Picks]:
        params = self.params
        clusters = cluster(
            problem, tasks, clusters=params.clusters, elbow=params.elbow, linkage=params.linkage
        )
        outcome = auction(scores(problem, clusters, able, params.theta))
        won = {
            robot: select(problem, robot, clusters[k].tasks.tolist(), method=params.method)
            for robot, k in enumerate(outcome.won.tolist())
            if k >= 0
        }
        return won or _cheapest(problem, able, params.method)


def in_no_route(problem: Problem) -> NDArray[np.bool_]:
    """Return (P,): the task stands in no robot's route."""
    taken = {stop.task for route in problem.routes for stop in route}
    return np.array([task not in taken for task in problem.tasks], dtype=np.bool_)


def _cheapest(problem: Problem, able: NDArray[np.bool_], method: Method) -> dict[int, Picks]:
    """Give the nearest task to its robot: a medoid can be out of reach where its tasks are not."""
    travel = problem.cost[problem.mode[:, None], problem.start[:, None], problem.pickup]
    robot, task = divmod(int(np.argmin(np.where(able, travel, np.inf))), len(problem.tasks))
    return {robot: select(problem, robot, [task], method=method)}
