"""Laws of the selection: dynamic program = MILP = brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from problems import line, problems

from oath import _core
from oath.allocate import Problem
from oath.allocate.selection import CORE_LIMIT, nearest, select
from oracles import path_length, shortest_selection


def best(problem: Problem, robot: int) -> tuple[int, float]:
    """How many tasks can be taken, and the least length for so many."""
    tasks = np.flatnonzero(problem.feasible()[robot]).tolist()
    for take in range(min(max(1, problem.capacity[robot]), len(tasks)), 0, -1):
        length = shortest_selection(problem, robot, tasks, take)
        if np.isfinite(length):
            return take, length
    return 0, 0.0


@settings(max_examples=150, deadline=None)
@given(problem=problems(robots=1, tasks=5, wild=True))
def test_dynamic_program_equals_brute_force(problem: Problem) -> None:
    take, length = best(problem, 0)
    picks = select(problem, 0, range(len(problem.tasks)))
    assert len({task for task, _ in picks}) == take
    assert path_length(problem, 0, picks) == pytest.approx(length)
    assert all(problem.feasible()[0, task] for task, _ in picks)


@settings(max_examples=40, deadline=None)
@given(problem=problems(robots=1, tasks=4, wild=True))
def test_milp_equals_dynamic_program(problem: Problem) -> None:
    tasks = range(len(problem.tasks))
    paths = [select(problem, 0, tasks, method=method) for method in ("dp", "milp")]
    assert len(paths[0]) == 0 or len({t for t, _ in paths[0]}) == len({t for t, _ in paths[1]})
    lengths = [path_length(problem, 0, path) for path in paths]
    assert lengths[0] == pytest.approx(lengths[1], abs=1e-6)


def random_core_input(n: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    points = rng.random((2 * n + 1, 2))
    cost = np.linalg.norm(points[:, None] - points[None], axis=2)
    first = np.arange(1, n + 1, dtype=np.int32)
    return cost, first, first + n, np.zeros(n, dtype=bool)


def test_load_stays_within_a_capacity_below_the_count() -> None:
    cost, first, last, visit = random_core_input(7, 3)
    lengths = []
    for capacity in (1, 2, 5):
        order, length, exact = _core.select_tasks(cost, 0, first, last, visit, 5, capacity)
        load = np.cumsum(np.where(order < 7, 1, -1))
        assert exact and len(order) == 10 and load.max() <= capacity and load[-1] == 0
        lengths.append(length)
    assert lengths == sorted(lengths, reverse=True)


@pytest.mark.parametrize(("n", "take"), [(12, 5), (24, 5), (32, 4), (9, 9), (8, 8)])
def test_sizes_that_are_promised_to_be_exact(n: int, take: int) -> None:
    assert _core.select_tasks(*_arguments(n), take, take)[2]


@pytest.mark.parametrize(("n", "take"), [(12, 12), (13, 11), (10, 9)])
def test_more_work_proves_more_and_is_never_longer(n: int, take: int) -> None:
    _, quick, _ = _core.select_tasks(*_arguments(n), take, take)
    _, proven, exact = _core.select_tasks(*_arguments(n), take, take, work=400_000_000)
    assert exact and proven <= quick + 1e-9 and quick <= 1.1 * proven


def _arguments(n: int) -> tuple[np.ndarray, int, np.ndarray, np.ndarray, np.ndarray]:
    cost, first, last, visit = random_core_input(n, 1)
    return cost, 0, first, last, visit


def test_beyond_its_work_limit_the_search_is_still_a_path_and_says_so() -> None:
    order, length, exact = _core.select_tasks(*_arguments(14), 14, 14, work=100_000)
    cost = _arguments(14)[0]
    at = np.concatenate([[0], order + 1])
    assert not exact and sorted(order.tolist()) == list(range(28))
    assert length == pytest.approx(cost[at[:-1], at[1:]].sum())
    place = np.argsort(order)
    assert (place[:14] < place[14:]).all()


def test_same_input_same_order() -> None:
    ones = np.ones((13, 13))  # all orders tie
    first = np.arange(1, 7, dtype=np.int32)
    visit = np.zeros(6, dtype=bool)
    orders = [_core.select_tasks(ones, 0, first, first + 6, visit, 4, 2)[0] for _ in range(3)]
    assert all((order == orders[0]).all() for order in orders)


@pytest.mark.parametrize("change", ["many", "outside", "negative", "nan", "length", "start"])
def test_core_refuses_nonsense(change: str) -> None:
    cost, first, last, visit = random_core_input(33 if change == "many" else 3, 0)
    start = 99 if change == "start" else 0
    if change == "outside":
        last[0] = 7
    if change in ("negative", "nan"):
        cost[1, 2] = -1.0 if change == "negative" else np.nan
    if change == "length":
        last = last[:2]
    with pytest.raises(ValueError):
        _core.select_tasks(cost, start, first, last, visit, 2, 2)


def test_no_task_and_no_path() -> None:
    empty = np.empty(0, dtype=np.int32)
    none = _core.select_tasks(np.zeros((1, 1)), 0, empty, empty, empty.astype(bool), 3, 3)
    assert none[0].size == 0 and none[1:] == (0.0, True)
    cost, first, last, visit = random_core_input(2, 0)
    lost = _core.select_tasks(np.full_like(cost, np.inf), 0, first, last, visit, 1, 1)
    assert lost[0].size == 0 and lost[1] == np.inf


def test_capacity_above_the_number_of_tasks_takes_all() -> None:
    problem = line([0.0], [(1, 3), (2, 4)], capacity=9)
    assert select(problem, 0, [0, 1]) == (
        (0, "pickup"),
        (1, "pickup"),
        (0, "delivery"),
        (1, "delivery"),
    )


def test_without_room_only_a_visit_is_taken() -> None:
    problem = line([0.0], [(1, 3), (5, 5), (9, 9)], capacity=0)
    for method in ("dp", "milp"):
        assert select(problem, 0, [0, 1, 2], method=method) == ((1, "visit"),)


def test_more_candidates_than_the_core_takes_are_cut_to_the_nearest() -> None:
    problem = line([0.0], [(i, i + 0.5) for i in range(60, 0, -1)], capacity=3)
    picks = select(problem, 0, range(60))
    assert sorted({task for task, _ in picks}) == [57, 58, 59]
    kept = nearest(problem, 0, np.arange(60), CORE_LIMIT)
    assert kept.tolist() == list(range(60 - CORE_LIMIT, 60))


def test_one_less_is_taken_when_one_sided_costs_forbid_all() -> None:
    problem = line([0.0], [(1, 2), (3, 4)], capacity=2)
    cost = problem.cost.copy()
    cost[0, 1:, [1, 2]] = np.inf  # no pickup can be reached but from the start
    cost[0, 1, 2] = cost[0, 2, 1] = np.inf
    problem = replace(problem, cost=cost)
    for method in ("dp", "milp"):
        assert select(problem, 0, [0, 1], method=method) == ((0, "pickup"), (0, "delivery"))
