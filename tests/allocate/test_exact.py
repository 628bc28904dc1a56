"""Laws of the exact allocator: brute force = MILP = dynamic program; it admits what it misses."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import line, problems

from oath import _core
from oath.allocate import (
    Budget,
    ByPriority,
    Exact,
    Lns,
    Oath,
    Problem,
    allocator,
    checked,
    follow,
    plan_all,
)
from oath.allocate.exact import Params
from oath.allocate.lns import Params as LnsParams
from oath.cli import main
from oath.errors import BadInput
from oath.model import Assignment
from oracles import FleetProgram, best_assignment

FEW = Budget(iterations=20)
WEIGHTS = st.sampled_from([0.0, 0.3, 1.0, 5.0])


def solve(problem: Problem, weight: float, budget: Budget = FEW) -> Assignment:
    solver = Exact(Params(makespan_weight=weight))
    return checked(solver, problem, budget, np.random.default_rng(0))


def value(problem: Problem, answer: Assignment, weight: float) -> float:
    ends = [follow(problem, r, answer.routes[robot]) for r, robot in enumerate(problem.robots)]
    times = [
        length / speed + service
        for (length, service, _), speed in zip(ends, problem.speed, strict=True)
    ]
    return sum(length for length, _, _ in ends) + weight * max(times, default=0.0)


def at_sites(problem: Problem, seed: int) -> Problem:
    """Let deliveries share two locations, and robots differ in what they may be given."""
    rng = np.random.default_rng(seed)
    if not len(problem.tasks):
        return problem
    shared = np.where(
        problem.visit, problem.pickup, rng.choice(problem.delivery[-2:], 99)[: len(problem.tasks)]
    )
    most = rng.integers(0, 4, len(problem.robots)).astype(np.int32)
    return replace(problem, delivery=shared.astype(np.int32), max_tasks=most)


def judge(problem: Problem, weight: float) -> None:
    served, least = best_assignment(problem, weight)
    answer = solve(problem, weight)
    assert len(problem.tasks) - len(answer.unassigned) == served
    assert answer.optimal and answer.lower_bound == pytest.approx(least)
    assert value(problem, answer, weight) == pytest.approx(least)


@settings(max_examples=120, deadline=None)
@given(problem=problems(robots=3, tasks=4), weight=WEIGHTS)
def test_it_equals_brute_force(problem: Problem, weight: float) -> None:
    judge(problem, weight)


@settings(max_examples=120, deadline=None)
@given(problem=problems(robots=3, tasks=4), weight=WEIGHTS, seed=st.integers(0, 999))
def test_it_equals_brute_force_with_sites_and_task_limits(
    problem: Problem, weight: float, seed: int
) -> None:
    judge(at_sites(problem, seed), weight)


@settings(max_examples=120, deadline=None)
@given(problem=problems(robots=3, tasks=4, wild=True), weight=WEIGHTS, seed=st.integers(0, 999))
def test_it_equals_brute_force_with_any_costs(problem: Problem, weight: float, seed: int) -> None:
    judge(at_sites(problem, seed), weight)


def random_problem(tasks: int, seed: int, *, sites: int = 3, robots: int = 3) -> Problem:
    """Deliveries and a few visits in a square; two types, two modes."""
    rng = np.random.default_rng(seed)
    points = rng.random((robots + tasks + sites, 2)) * 20
    legs = points[:, None] - points[None]
    plain = np.hypot(legs[..., 0], legs[..., 1])
    pickup = np.arange(robots, robots + tasks, dtype=np.int32)
    visit = rng.random(tasks) < 0.2
    site = rng.integers(robots + tasks, len(points), tasks)
    capability = np.ones((robots, 2))
    capability[0, 1] = 0.0
    base = line([0.0] * robots, [(1.0, 2.0)] * tasks, capability=capability.tolist())
    return replace(
        base,
        cost=np.array([plain, np.abs(legs).sum(axis=2)]),
        mode=np.arange(robots, dtype=np.int32) % 2,
        pickup=pickup,
        delivery=np.where(visit, pickup, site).astype(np.int32),
        visit=visit,
        type=(rng.random(tasks) < 0.3).astype(np.int32),
        speed=rng.choice([0.5, 1.0], robots),
        service_time=rng.integers(0, 3, tasks).astype(float),
    )


@pytest.mark.parametrize("weight", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_it_equals_an_independent_program(seed: int, weight: float) -> None:
    problem = random_problem(4, seed, robots=2)
    answer = solve(problem, weight)
    assert answer.optimal
    assert value(problem, answer, weight) == pytest.approx(FleetProgram(problem, weight).solve())


@pytest.mark.slow
@pytest.mark.parametrize("weight", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(3, 6))
def test_it_equals_an_independent_program_with_five_tasks(seed: int, weight: float) -> None:
    problem = replace(random_problem(5, seed), max_tasks=np.array([2, 2, 3], dtype=np.int32))
    answer = solve(problem, weight)
    assert answer.optimal and not answer.unassigned
    assert value(problem, answer, weight) == pytest.approx(FleetProgram(problem, weight).solve())


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    tasks=st.integers(5, 12),
    weight=WEIGHTS,
    states=st.sampled_from([1, 30, 1000]),
    seconds=st.sampled_from([0.0, 60.0]),
)
def test_bounds_are_honest_under_any_limits(
    seed: int, tasks: int, weight: float, states: int, seconds: float
) -> None:
    problem = random_problem(tasks, seed)
    full = solve(problem, weight)
    assert full.optimal
    least = value(problem, full, weight)
    params = Params(makespan_weight=weight, states=states)
    budget = Budget(iterations=0, seconds=seconds)
    answer = checked(Exact(params), problem, budget, np.random.default_rng(1))
    assert answer.lower_bound is not None
    assert answer.lower_bound <= least * (1 + 1e-9)
    if answer.optimal:
        assert value(problem, answer, weight) == pytest.approx(least)
        assert answer.lower_bound == pytest.approx(least)


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_nothing_else_is_better(weight: float) -> None:
    problem = random_problem(10, 5, robots=4)
    answer = solve(problem, weight)
    assert answer.optimal
    least = value(problem, answer, weight)
    for other in (Lns(LnsParams(makespan_weight=weight)), Oath()):
        budget = Budget(iterations=2000)
        found = plan_all(problem, other, budget, np.random.default_rng(3))
        assert value(problem, found, weight) >= least * (1 - 1e-9)


@pytest.mark.parametrize("weight", [0.0, 1.0])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0)])
def test_it_finds_the_optimum_without_a_bound_in_any_order_of_robots(
    order: tuple[int, ...], weight: float
) -> None:
    problem = random_problem(8, 4)
    robots = list(order)
    routes, least, lower, complete, _ = _core.solve_exact(
        cost=problem.cost,
        first=problem.pickup,
        last=problem.delivery,
        visit=problem.visit.astype(np.uint8),
        service=problem.service_time,
        able=np.ascontiguousarray(problem.feasible()[robots].T, dtype=np.uint8),
        mode=problem.mode[robots],
        start=problem.start[robots],
        capacity=problem.capacity[robots],
        most=problem.max_tasks[robots],
        speed=problem.speed[robots],
        makespan_weight=weight,
        skip=0,
        upper=np.inf,
        seconds=60.0,
        states=1_000_000,
    )
    expected = value(problem, solve(problem, weight), weight)
    assert complete and lower == least == pytest.approx(expected)
    assert sorted(stop for route in routes for stop in route if stop < 8) == list(range(8))


def test_the_same_input_gives_the_same_answer() -> None:
    problem = random_problem(10, 7)
    assert solve(problem, 1.0) == solve(problem, 1.0)
    assert solve(problem, 0.0, Budget()) == solve(problem, 0.0, Budget())


def test_twins_share_the_work_only_if_that_is_better() -> None:
    problem = line([0.0, 0.0, 0.0], [(1, 2), (3, 4), (-1, -2), (-3, -4)])
    start = np.zeros(3, dtype=np.int32)
    problem = replace(problem, start=start)
    answer = solve(problem, 1.0)
    assert answer.optimal and value(problem, answer, 1.0) == pytest.approx(8 + 4)
    assert sorted(len(route) for route in answer.routes.values()) == [0, 4, 4]


@pytest.mark.parametrize("solver", [Exact(), Lns()])
def test_task_limits_leave_tasks_out_and_say_so(solver: Exact | Lns) -> None:
    problem = line([0.0, 10.0], [(1, 2), (3, 4), (9, 8), (6, 6)])
    problem = replace(problem, max_tasks=np.array([1, 2], dtype=np.int32))
    rng = np.random.default_rng(0)
    for answer in (checked(solver, problem, FEW, rng), plan_all(problem, solver, FEW, rng)):
        (reason,) = answer.unassigned.values()
        assert "max_tasks" in reason
        assert sorted(len({s.task for s in route}) for route in answer.routes.values()) == [1, 2]


@settings(max_examples=40, deadline=None)
@given(problem=problems(tasks=8), seed=st.integers(0, 99))
def test_every_allocator_keeps_the_task_limits(problem: Problem, seed: int) -> None:
    limited = at_sites(problem, seed)
    for solver in (Exact(), Lns(), Oath()):
        answer = plan_all(limited, solver, FEW, np.random.default_rng(0))
        for r, robot in enumerate(limited.robots):
            assert len({stop.task for stop in answer.routes[robot]}) <= limited.max_tasks[r]


def test_too_many_tasks_get_a_bound() -> None:
    problem = random_problem(40, 2)
    answer = solve(problem, 1.0, Budget(iterations=500))
    assert not answer.optimal and not answer.unassigned
    assert answer.lower_bound is not None
    assert 0.2 * value(problem, answer, 1.0) < answer.lower_bound < value(problem, answer, 1.0)


def test_a_proof_survives_only_where_one_round_did_it_all() -> None:
    problem = random_problem(6, 1)
    rng = np.random.default_rng(0)
    alone = plan_all(problem, ByPriority(Exact()), FEW, rng)
    assert alone.optimal and alone.lower_bound == pytest.approx(value(problem, alone, 1.0))
    mixed = replace(problem, priority=np.array([1, 0, 0, 0, 0, -1], dtype=np.int8))
    answer = plan_all(mixed, ByPriority(Exact()), FEW, rng)
    assert not answer.optimal and answer.lower_bound is None


def test_plan_prints_what_is_proven() -> None:
    plan = ["plan", "missions/maze-09.yaml", "--points", "300", "--json"]
    options = ["--allocator", "exact", "--makespan-weight", "0", "--max-tasks", "3"]
    result = CliRunner().invoke(main, [*plan, *options])
    report = json.loads(result.stdout)
    assert result.exit_code == 0 and report["optimal"]
    assert report["objective"] == report["total_distance"] == pytest.approx(report["lower_bound"])
    assert all(len(route) <= 6 for route in report["routes"].values())
    refused = CliRunner().invoke(main, [*plan, "--allocator", "oath", "--makespan-weight", "2"])
    assert refused.exit_code == 2 and "no makespan weight" in refused.stderr


def test_nothing_to_do_is_optimal() -> None:
    for problem in (line([0.0], []), line([], [(1, 2)])):
        answer = solve(problem, 1.0)
        assert answer.optimal and answer.lower_bound == 0.0


def test_the_makespan_weight_is_for_those_who_know_it() -> None:
    assert allocator("exact", makespan_weight=2.0) == Exact(Params(makespan_weight=2.0))
    assert allocator("lns", makespan_weight=0.0) == Lns(LnsParams(makespan_weight=0.0))
    with pytest.raises(BadInput, match="no makespan weight"):
        allocator("oath", makespan_weight=1.0)
    with pytest.raises(BadInput, match="-1"):
        allocator("lns", makespan_weight=-1.0)
