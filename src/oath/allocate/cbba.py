"""Baseline: the consensus-based bundle algorithm on travel costs.

Source: Choi, Brunet, How, "Consensus-based decentralized auctions for robust task allocation",
IEEE Transactions on Robotics 25 (2009). See `consensus` for the algorithm itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from oath.allocate.consensus import Agreement, Gain, agree, diameter
from oath.allocate.contract import Budget, stop_names
from oath.allocate.insertion import detours
from oath.allocate.problem import Problem
from oath.allocate.stages import assignment, open_to, quota
from oath.errors import BadInput, did_you_mean
from oath.model import Assignment

Network = Literal["complete", "line", "ring", "star"] | tuple[tuple[str, str], ...]
"""Who hears whom: by the robots' order, or as pairs of their ids. A star's centre is the first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """What can be tuned."""

    network: Network = "complete"
    rebuild: bool = True
    """Robots build their bundles anew each round, so that the network does not matter; False is the
    source's rule, see `agree`."""


@dataclass(frozen=True, slots=True)
class Cbba:
    """One round: idle robots win bundles of as many tasks as they can carry.

    A task is one unit, as in the source: its delivery follows its pickup. A bid is worth minus the
    length [m] by which the task's best insertion makes the robot's open path longer, plus a
    constant that makes any insertion better than none; so total worth falls as total length rises.
    Such gains need not diminish (a task may lie on the way to a later one), hence bids are warped.
    Busy robots pass on what they hear, but do not bid. Deterministic: it uses neither the budget
    nor the random numbers.
    """

    params: Params = Params()
    reconsiders: ClassVar[bool] = False

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to idle robots; busy ones keep theirs.

        Raises
        ------
        BadInput
            The network names an unknown robot or leaves some apart.
        """
        agreement = self.agreement(problem)
        won = {
            robot: tuple((task, name) for task in path for name in stop_names(problem, task))
            for robot, path in enumerate(agreement.paths)
            if path
        }
        return assignment(problem, won)

    def agreement(self, problem: Problem) -> Agreement:
        """Return who won what, and after how many rounds."""
        return agree(
            travel_gain(problem),
            len(problem.tasks),
            quota(problem).tolist(),
            links(self.params.network, problem.robots),
            rebuild=self.params.rebuild,
        )


def travel_gain(problem: Problem) -> Gain:
    """Return the gains of idle robots: how much less than a constant a task adds to a path [m].

    The constant is 1 m more than three of the longest ways, since an insertion adds three at most.
    """
    able = open_to(problem)
    constant = 1.0 + 3.0 * float(np.max(problem.cost, where=np.isfinite(problem.cost), initial=0.0))
    way = problem.cost[:, problem.pickup, problem.delivery]
    way[:, problem.visit] = 0.0

    def gain(robot: int, path: Sequence[int]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        mode, done = problem.mode[robot], np.array(path, dtype=np.intp)
        leave = np.append(problem.start[robot], problem.delivery[done])
        increase = detours(
            problem.cost[mode], leave, problem.pickup[done], problem.pickup, problem.delivery
        )
        gains = constant - (increase.min(axis=0) + way[mode])
        gains[~able[robot]] = 0.0
        return gains, np.argmin(increase, axis=0)

    return gain


def links(network: Network, robots: Sequence[str]) -> NDArray[np.bool_]:
    """Return (R, R) which robots hear each other.

    Raises
    ------
    BadInput
        A pair names an unknown robot, or some robots never hear of each other.

    Examples
    --------
    >>> links("line", ["a", "b", "c"]).astype(int).tolist()
    [[0, 1, 0], [1, 0, 1], [0, 1, 0]]
    """
    r = len(robots)
    linked = np.zeros((r, r), dtype=np.bool_)
    if network == "complete":
        linked[:] = ~np.eye(r, dtype=np.bool_)
    elif isinstance(network, str):
        others = np.arange(1, r)
        linked[others, others * 0 if network == "star" else others - 1] = True
        if network == "ring" and r > 2:
            linked[0, -1] = True
    else:
        for pair in network:
            a, b = (_index(robot, robots) for robot in pair)
            linked[a, b] = a != b
    linked |= linked.T
    try:
        diameter(linked)
    except ValueError:
        raise BadInput(
            "network: some robots never hear of each other", remedy="add the pairs that are missing"
        ) from None
    return linked


def _index(robot: str, robots: Sequence[str]) -> int:
    if robot not in robots:
        remedy = did_you_mean(robot, list(robots))
        raise BadInput(f"network: unknown robot '{robot}'", remedy=remedy)
    return robots.index(robot)
