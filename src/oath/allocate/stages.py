"""What allocators that work round by round have in common, first of all the paper's three stages.

Source: Li, Ren, Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task Assignment and Planning
for Heterogeneous Robot Teaming" (2025). The paper's baselines differ from its own method only in
how they cluster, in what a bid costs and in how the winner chooses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from oath.allocate.auction import auction
from oath.allocate.clustering import Cluster
from oath.allocate.contract import reasons, to_route
from oath.allocate.problem import Problem
from oath.allocate.selection import Picks
from oath.model import Assignment

Group = Callable[[NDArray[np.intp]], list[Cluster]]
"""Cluster tasks."""
Score = Callable[[list[Cluster], NDArray[np.bool_]], NDArray[np.float64]]
"""(R, K) scores, lower is better, from the clusters and (R, P) who can do what."""
Choose = Callable[[int, list[int]], Picks]
"""What a robot takes of some tasks, and in which order."""


def three_stages(problem: Problem, group: Group, score: Score, choose: Choose) -> Assignment:
    """Cluster the open tasks, auction the clusters, let each winner choose.

    Each idle robot gets at most one cluster; at least one task is taken if an idle robot can do
    any.
    """
    able = open_to(problem)
    won: dict[int, Picks] = {}
    if able.any():
        doable = in_no_route(problem) & problem.feasible().any(axis=0)
        clusters = group(np.flatnonzero(doable))
        outcome = auction(score(clusters, able))
        won = {
            robot: choose(robot, clusters[k].tasks.tolist())
            for robot, k in enumerate(outcome.won.tolist())
            if k >= 0
        }
    return assignment(problem, won or _cheapest(problem, able, choose))


def _cheapest(problem: Problem, able: NDArray[np.bool_], choose: Choose) -> dict[int, Picks]:
    """Give the nearest task to its robot: a medoid can be out of reach where its tasks are not."""
    if not able.any():
        return {}
    travel = problem.cost[problem.mode[:, None], problem.start[:, None], problem.pickup]
    robot, task = divmod(int(np.argmin(np.where(able, travel, np.inf))), len(problem.tasks))
    return {robot: choose(robot, [task])}


def in_no_route(problem: Problem) -> NDArray[np.bool_]:
    """Return (P,): the task stands in no robot's route."""
    taken = {stop.task for route in problem.routes for stop in route}
    return np.array([task not in taken for task in problem.tasks], dtype=np.bool_)


def open_to(problem: Problem) -> NDArray[np.bool_]:
    """Return (R, P): the robot is idle, and can do the task, which nobody has yet."""
    able: NDArray[np.bool_] = problem.feasible() & ~problem.busy[:, None] & in_no_route(problem)
    return able


def quota(problem: Problem) -> NDArray[np.intp]:
    """Return (R,) tasks that a robot takes in one round at most.

    As many as it can carry, a visit counting as one too; one without room still takes one visit.
    Within it no order of the stops overloads a robot.
    """
    most: NDArray[np.intp] = np.minimum(np.maximum(problem.capacity, 1), problem.max_tasks)
    return most


def assignment(problem: Problem, won: Mapping[int, Picks]) -> Assignment:
    """Return everyone's routes: some robots got new ones, the others keep theirs."""
    routes = dict(zip(problem.robots, problem.routes, strict=True))
    left = in_no_route(problem)
    for robot, picks in won.items():
        routes[problem.robots[robot]] = to_route(problem, picks)
        left[[task for task, _ in picks]] = False
    return Assignment(routes=routes, unassigned=reasons(problem, np.flatnonzero(left).tolist()))
