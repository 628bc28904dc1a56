"""Slow, obviously right versions of what the package computes fast.

Each section restates a definition as directly as it can, shares no code with the package beyond
its value types, and is what the tests of a room compare against.
"""

from __future__ import annotations

import math
from itertools import combinations, permutations

from oath.allocate.problem import Problem

# --- Selection --------------------------------------------------------------------------------


def path_length(problem: Problem, robot: int, picks: tuple[tuple[int, str], ...]) -> float:
    """Return the length of an open path from where the robot is; inf if it breaks a rule."""
    cost = problem.cost[problem.mode[robot]]
    at, load, length = problem.start[robot], 0, 0.0
    for place, (task, stop) in enumerate(picks):
        if stop == "delivery" and (task, "pickup") not in picks[:place]:
            return math.inf
        load += {"pickup": 1, "delivery": -1, "visit": 0}[stop]
        if load > problem.capacity[robot]:
            return math.inf
        there = problem.delivery[task] if stop == "delivery" else problem.pickup[task]
        length += cost[at, there]
        at = there
    return length


def shortest_selection(problem: Problem, robot: int, tasks: list[int], take: int) -> float:
    """Return the least length over all subsets of that size and all orders of their stops."""
    best = math.inf
    for subset in combinations(tasks, take):
        stops = [
            (task, stop)
            for task in subset
            for stop in (("visit",) if problem.visit[task] else ("pickup", "delivery"))
        ]
        lengths = (path_length(problem, robot, order) for order in permutations(stops))
        best = min(best, *lengths)
    return best
