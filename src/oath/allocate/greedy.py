"""Baseline: always the cheapest insertion of any task into any robot's route.

Source: cheapest insertion as in Rosenkrantz, Stearns, Lewis, "An analysis of several heuristics for
the traveling salesman problem" (1977), over all routes in parallel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from oath.allocate.contract import Budget
from oath.allocate.insertion import GrowingPath
from oath.allocate.problem import Problem
from oath.allocate.stages import assignment, open_to, quota
from oath.model import Assignment


@dataclass(frozen=True, slots=True)
class Greedy:
    """One round: idle robots get tasks, at most as many as they can carry.

    Next is always the pair of robot and task whose best insertion adds the least length; the two
    stops may go to different places of the route. Ties go to the lower robot, then to the lower
    task. Deterministic: it uses neither the budget nor the random numbers.
    """

    reconsiders: ClassVar[bool] = False

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        """Give routes to idle robots; busy ones keep theirs."""
        able = open_to(problem)
        most = quota(problem)
        growing = [GrowingPath(problem, robot) for robot in range(len(problem.robots))]
        price = np.array([each.prices for each in growing]).reshape(able.shape)
        price[~able] = np.inf
        while np.isfinite(price).any():
            robot, task = divmod(int(np.argmin(price)), len(problem.tasks))
            growing[robot].insert(task)
            able[:, task] = False
            price[:, task] = np.inf
            open_ = able[robot] & (len(growing[robot].tasks) < most[robot])
            price[robot] = np.where(open_, growing[robot].prices, np.inf)
        return assignment(
            problem, {r: each.picks() for r, each in enumerate(growing) if each.tasks}
        )
