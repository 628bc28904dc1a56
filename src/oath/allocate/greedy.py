"""Baseline: always the cheapest insertion of any task into any robot's route.

Source: cheapest insertion as in Rosenkrantz, Stearns, Lewis, "An analysis of several heuristics for
the traveling salesman problem" (1977), over all routes in parallel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from oath.allocate.contract import Budget
from oath.allocate.insertion import best_places
from oath.allocate.problem import Problem
from oath.allocate.selection import Picks
from oath.allocate.stages import assignment, open_to, quota
from oath.model import Assignment, StopName


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
        growing = [_Growing(problem, robot) for robot in range(len(problem.robots))]
        price = np.array([each.prices() for each in growing]).reshape(able.shape)
        price[~able] = np.inf
        while np.isfinite(price).any():
            robot, task = divmod(int(np.argmin(price)), len(problem.tasks))
            growing[robot].insert(task)
            able[:, task] = False
            price[:, task] = np.inf
            open_ = able[robot] & (len(growing[robot].tasks) < most[robot])
            price[robot] = np.where(open_, growing[robot].prices(), np.inf)
        return assignment(
            problem, {r: each.picks() for r, each in enumerate(growing) if each.tasks}
        )


class _Growing:
    """The new route of one robot."""

    def __init__(self, problem: Problem, robot: int) -> None:
        self.problem = problem
        self.cost = problem.cost[problem.mode[robot]]
        self.path = [int(problem.start[robot])]
        self.stops: list[int] = []
        self.tasks: set[int] = set()

    def prices(self) -> NDArray[np.float64]:
        """Return (P,) how much longer the route gets by each task [m]; remembers where they go."""
        problem = self.problem
        price, self.i, self.j = best_places(
            self.cost, np.array(self.path), problem.pickup, problem.delivery, problem.visit
        )
        return price

    def insert(self, task: int) -> None:
        """Put a task where the last prices were for."""
        problem, i, j = self.problem, int(self.i[task]), int(self.j[task])
        self.tasks.add(task)
        if not problem.visit[task]:
            self.path.insert(j + 1, int(problem.delivery[task]))
            self.stops.insert(j, task)
        self.path.insert(i + 1, int(problem.pickup[task]))
        self.stops.insert(i, task)

    def picks(self) -> Picks:
        """Return the stops in order."""
        picks: list[tuple[int, StopName]] = []
        seen: set[int] = set()
        for task in self.stops:
            name: StopName = "delivery" if task in seen else "pickup"
            picks.append((task, "visit" if self.problem.visit[task] else name))
            seen.add(task)
        return tuple(picks)
