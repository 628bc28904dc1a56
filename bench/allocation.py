"""How long the paper's allocator takes: one round, and all tasks round by round.

Random points in a square, straight-line costs. The reference in the same run, which makes figures
from different machines comparable, is scipy's `linear_sum_assignment` from every delivery to every
pickup.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from statistics import median
from time import perf_counter

import numpy as np
from scipy.optimize import linear_sum_assignment

from oath.allocate import Budget, Oath, Problem, plan_all


def random_problem(tasks: int, robots: int, capacity: int, seed: int) -> Problem:
    """Return deliveries between random points of a 20 m square; two types, some robots do both."""
    rng = np.random.default_rng(seed)
    points = rng.random((2 * tasks + robots, 2)) * 20.0
    legs = points[:, None] - points[None]
    capability = np.ones((robots, 2))
    capability[1::2, 1] = 0.0
    return Problem(
        robots=tuple(f"r{i}" for i in range(robots)),
        tasks=tuple(f"t{i}" for i in range(tasks)),
        start=np.arange(2 * tasks, 2 * tasks + robots, dtype=np.int32),
        pickup=np.arange(tasks, dtype=np.int32),
        delivery=np.arange(tasks, 2 * tasks, dtype=np.int32),
        visit=np.zeros(tasks, dtype=np.bool_),
        service_time=np.zeros(tasks),
        type=(rng.random(tasks) < 0.3).astype(np.int32),
        capability=capability,
        capacity=np.full(robots, capacity, dtype=np.int32),
        speed=np.ones(robots),
        cost=np.hypot(legs[..., 0], legs[..., 1])[None],
        points=points,
        mode=np.zeros(robots, dtype=np.int32),
        busy=np.zeros(robots, dtype=np.bool_),
        routes=((),) * robots,
        types=("light", "heavy"),
        priority=np.zeros(tasks, dtype=np.int8),
        refused=np.zeros((robots, tasks), dtype=np.bool_),
        max_tasks=np.full(robots, tasks, dtype=np.int32),
        load=np.zeros(robots, dtype=np.int32),
        ready=np.zeros(robots),
        aboard=((),) * robots,
        previous=((),) * robots,
    )


def milliseconds(call: Callable[[], object], repeats: int) -> float:
    """Return the median time of a call."""
    times = []
    for _ in range(repeats):
        begin = perf_counter()
        call()
        times.append(perf_counter() - begin)
    return 1e3 * median(times)


def main() -> None:
    """Print one line per size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--capacity", type=int, default=3)
    args = parser.parse_args()
    rng = np.random.default_rng(0)
    print("tasks robots  round [ms]  plan_all [ms]  reference [ms]  round/ref  plan_all/ref")
    for tasks, robots in ((25, 4), (100, 10)):
        problem = random_problem(tasks, robots, args.capacity, seed=1)
        cost = problem.cost[0][np.ix_(problem.delivery, problem.pickup)]
        oath, budget = Oath(), Budget()
        oath.allocate(problem, budget, rng)  # imports scipy's clustering
        one = milliseconds(lambda: oath.allocate(problem, budget, rng), args.repeats)  # noqa: B023
        all_ = milliseconds(lambda: plan_all(problem, oath, budget, rng), args.repeats)  # noqa: B023
        reference = milliseconds(lambda: linear_sum_assignment(cost), 20 * args.repeats)  # noqa: B023
        print(
            f"{tasks:5} {robots:6}  {one:10.2f}  {all_:13.1f}  {reference:14.4f}"
            f"  {one / reference:9.0f}  {all_ / reference:12.0f}"
        )


if __name__ == "__main__":
    main()
