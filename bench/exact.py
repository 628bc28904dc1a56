"""Proven optima on the paper's maze, and how far the other allocators are from them.

Sum of lengths only (weight 0), as in the paper's problem 1, and with the makespan (weight 1), each
with capacity 2 and any number of tasks per robot (*literal*), and with at most Q tasks per robot
which may all be aboard at once (*single round*). The set of 21 tasks is that of 20 and `gb`, the
next task of maze-25. A gap is (x - optimum) / optimum.
"""

from __future__ import annotations

import argparse
import resource
from dataclasses import replace
from time import perf_counter

import numpy as np

import oath
from oath.allocate import Allocator, Budget, Exact, Lns, Oath, Problem, follow, plan_all
from oath.allocate.exact import Params
from oath.allocate.lns import Params as LnsParams
from oath.dispatch import State
from oath.scene import pose, prepare
from oath.world.roadmap import Params as RoadmapParams

LITERAL = [(tasks, 2, None) for tasks in (12, 15, 18, 20, 21, 25)]
SINGLE_ROUND = [(12, 3, 3), (15, 4, 4), (18, 5, 5), (20, 5, 5), (21, 6, 6), (25, 7, 7)]


def maze(tasks: int, capacity: int, most: int | None) -> Problem:
    """Return so many tasks of the maze for its four robots, at most `most` each."""
    names = {task.id for task in oath.load(f"missions/maze-{min(tasks, 20)}.yaml").tasks}
    mission = oath.load("missions/maze-25.yaml")
    names |= {"gb"} if tasks == 21 else {task.id for task in mission.tasks if tasks == 25}
    mission = replace(mission, tasks=tuple(task for task in mission.tasks if task.id in names))
    assert len(mission.tasks) == tasks
    scene = prepare(mission, RoadmapParams(points=2000))
    problem = pose(scene, State.of(mission))
    robots = len(problem.robots)
    return replace(
        problem,
        capacity=np.full(robots, capacity, dtype=np.int32),
        max_tasks=np.full(robots, most or tasks, dtype=np.int32),
    )


def value(problem: Problem, solver: Allocator, budget: Budget, weight: float) -> float:
    """Return the objective of all tasks; inf if the allocator leaves any out."""
    answer = plan_all(problem, solver, budget, np.random.default_rng(0))
    lengths, times = [], []
    for r, robot in enumerate(problem.robots):
        length, service, _ = follow(problem, r, answer.routes[robot])
        lengths.append(length)
        times.append(length / float(problem.speed[r]) + service)
    return np.inf if answer.unassigned else sum(lengths) + weight * max(times)


def report(tasks: int, capacity: int, most: int | None, weight: float, seconds: float) -> None:
    """Print one line."""
    problem = maze(tasks, capacity, most)
    solver = Exact(Params(makespan_weight=weight, seconds=seconds))
    begin = perf_counter()
    answer = solver.allocate(problem, Budget(), np.random.default_rng(0))
    took = perf_counter() - begin
    found = value(problem, solver, Budget(), weight)
    lns = Lns(LnsParams(makespan_weight=weight))
    others = [
        value(problem, lns, Budget(seconds=0.05), weight),
        value(problem, lns, Budget(seconds=0.2), weight),
        value(problem, Oath(), Budget(), weight),
    ]
    assert min(others) > found - 1e-6 or not answer.optimal, "a proven optimum was beaten"
    gaps = "  ".join(f"{round(100 * (x - found) / found, 2) + 0.0:8.2f} %" for x in others)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    proven = "yes" if answer.optimal else "no"
    print(
        f"{tasks:5}  {capacity:3}  {most or '-':>4}  {weight:6.0f}  {found:9.3f}"
        f"  {answer.lower_bound:9.3f}  {proven:>6}  {took:8.2f}  {memory:8.0f}  {gaps}",
        flush=True,
    )


def main() -> None:
    """Print one line per problem."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="limit of each proof")
    args = parser.parse_args()
    print(
        "tasks  cap  most  weight    optimum      bound  proven  time [s]  mem [MB]"
        "   lns 50 ms  lns 200 ms        oath"
    )
    for weight in (0.0, 1.0):
        for tasks, capacity, most in LITERAL + SINGLE_ROUND:
            report(tasks, capacity, most, weight, args.seconds)


if __name__ == "__main__":
    main()
