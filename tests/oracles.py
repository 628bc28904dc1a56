"""Slow, obviously right versions of what the package computes fast.

Each section restates a definition as directly as it can, shares no code with the package beyond
its value types, and is what the tests of a room compare against.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from itertools import combinations, permutations

from oath.allocate.problem import Problem
from oath.motion.ltl import Formula

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


# --- Linear temporal logic ------------------------------------------------------------------


def holds(
    formula: Formula, prefix: Sequence[AbstractSet[str]], loop: Sequence[AbstractSet[str]]
) -> bool:
    """Return whether the word ``prefix loop loop ...`` satisfies ``formula``.

    The textbook semantics, evaluated for every position of the lasso: from each of the n
    positions, the first n of its future hold every letter that will ever be read.
    """
    word = [*prefix, *loop]
    n = len(word)
    following = [i + 1 if i + 1 < n else len(prefix) for i in range(n)]
    futures = []
    for i in range(n):
        future = [i]
        while len(future) < n:
            future.append(following[future[-1]])
        futures.append(future)

    def until(left: list[bool], right: list[bool], future: list[int]) -> bool:
        return any(
            right[k] and all(left[j] for j in future[:step]) for step, k in enumerate(future)
        )

    def release(left: list[bool], right: list[bool], future: list[int]) -> bool:
        return all(right[k] or any(left[j] for j in future[:step]) for step, k in enumerate(future))

    def values(part: Formula) -> list[bool]:
        """Return the truth of `part` at each position."""
        if part.op == "atom":
            return [part.name in letter for letter in word]
        args = [values(arg) for arg in part.args]
        match part.op:
            case "true":
                return [True] * n
            case "false":
                return [False] * n
            case "!":
                return [not x for x in args[0]]
            case "&":
                return [all(column) for column in zip(*args, strict=True)]
            case "|":
                return [any(column) for column in zip(*args, strict=True)]
            case "->":
                return [not x or y for x, y in zip(*args, strict=True)]
            case "<->":
                return [x == y for x, y in zip(*args, strict=True)]
            case "X":
                return [args[0][i] for i in following]
            case "F":
                return [any(args[0][k] for k in future) for future in futures]
            case "G":
                return [all(args[0][k] for k in future) for future in futures]
        left, right = args
        match part.op:
            case "U":
                return [until(left, right, future) for future in futures]
            case "R":
                return [release(left, right, future) for future in futures]
            case "W":
                return [
                    until(left, right, future) or all(left[k] for k in future) for future in futures
                ]
            case "M":
                return [
                    release(left, right, future) and any(left[k] for k in future)
                    for future in futures
                ]
        raise AssertionError(part.op)

    return values(formula)[0]
