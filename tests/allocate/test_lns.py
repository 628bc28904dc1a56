"""Near-optimal allocation: feasible at any time, near the optimum, steady under way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import line, problems

from oath.allocate import Budget, ByPriority, Exact, Lns, Problem, checked, follow
from oath.allocate.exact import Params as ExactParams
from oath.allocate.lns import Params
from oath.allocate.problem import Aboard
from oath.model import Assignment, Route, RouteStop


def ask(
    problem: Problem, *, iterations: int = 300, seed: int = 0, params: Params | None = None
) -> Assignment:
    solver = ByPriority(Lns(params or Params()))
    budget = Budget(iterations=iterations)
    return checked(solver, problem, budget, np.random.default_rng(seed))


def value(problem: Problem, answer: Assignment) -> float:
    """Sum of lengths and makespan, from where the robots are free."""
    total, latest = 0.0, 0.0
    for r, robot in enumerate(problem.robots):
        rest = answer.routes[robot][len(problem.routes[r]) :]
        length, service, _ = follow(problem, r, rest)
        total += length
        latest = max(latest, problem.ready[r] + length / problem.speed[r] + service)
    return float(total + latest)


def stop(text: str) -> RouteStop:
    task, name = text.split()
    return RouteStop(task=task, stop=name)  # type: ignore[arg-type]


@settings(max_examples=60, deadline=None)
@given(problems(wild=True))
def test_one_sided_costs_give_routes_that_exist(problem: Problem) -> None:
    ask(problem, iterations=50)


@settings(max_examples=60, deadline=None)
@given(problems(tasks=6), st.integers(0, 99))
def test_it_comes_near_the_optimum(problem: Problem, seed: int) -> None:
    found = ask(problem, iterations=2000, seed=seed)
    best = Exact(ExactParams()).allocate(problem, Budget(), np.random.default_rng(0))
    assert best.optimal and found.unassigned == best.unassigned
    assert value(problem, found) <= value(problem, best) * 1.01 + 0.01


@pytest.mark.parametrize("budget", [Budget(seconds=0.0), Budget(iterations=0)])
def test_no_time_at_all_still_gives_routes(budget: Budget) -> None:
    problem = line([0, 9], [(i, 9 - i) for i in range(8)])
    answer = checked(Lns(), problem, budget, np.random.default_rng(0))
    assert not answer.unassigned


def test_more_iterations_are_not_worse() -> None:
    rng = np.random.default_rng(3)
    problem = line([0, 5], [tuple(pair) for pair in rng.integers(0, 30, (14, 2)).tolist()])
    values = [value(problem, ask(problem, iterations=n)) for n in (0, 100, 5000)]
    assert values == sorted(values, reverse=True)


@settings(max_examples=80, deadline=None)
@given(problems(tasks=8), st.integers(0, 2**32 - 1))
def test_under_way_the_next_stop_and_the_load_stay(problem: Problem, seed: int) -> None:
    answer = ask(problem, iterations=100, seed=seed)
    later = under_way(problem, answer, np.random.default_rng(seed))
    again = ask(later, iterations=100, seed=seed)  # checked: loads, capacity, what is fixed
    for r, robot in enumerate(problem.robots):
        assert again.routes[robot][: len(later.routes[r])] == later.routes[r]
        stops = [entry.task for entry in again.routes[robot] if entry.stop == "delivery"]
        assert {load.task for load in later.aboard[r]} <= set(stops)
    assert value(later, again) <= value(later, _kept(later)) + 0.01


def under_way(problem: Problem, answer: Assignment, rng: np.random.Generator) -> Problem:
    """Every robot has served some of its route and drives to the next stop."""
    index = {task: p for p, task in enumerate(problem.tasks)}
    begun: set[str] = set()
    fixed: list[Route] = []
    previous: list[Route] = []
    aboard: list[tuple[Aboard, ...]] = []
    start, load = problem.start.copy(), np.zeros(len(problem.robots), dtype=np.int32)
    for r, robot in enumerate(problem.robots):
        route = answer.routes[robot]
        done = int(rng.integers(0, len(route) + 1))
        carried = [s.task for s in route[:done] if s.stop == "pickup"]
        for s in route[:done]:
            if s.stop == "delivery":
                carried.remove(s.task)
        load[r] = len(carried)
        head, here = route[done : done + 1], list(carried)
        for s in head:
            p = index[s.task]
            start[r] = problem.delivery[p] if s.stop == "delivery" else problem.pickup[p]
            if s.stop == "pickup":
                here.append(s.task)
            elif s.stop == "delivery":
                here.remove(s.task)
        if done and not head:
            _, _, start[r] = follow(problem, r, route)
        begun |= {s.task for s in route[: done + 1]}
        fixed.append(head)
        previous.append(route[done:])
        aboard.append(
            tuple(
                Aboard(
                    task=task,
                    delivery=int(problem.delivery[index[task]]),
                    service_time=float(problem.service_time[index[task]]),
                )
                for task in here
            )
        )
    left = [p for p, task in enumerate(problem.tasks) if task not in begun]
    return replace(
        problem.only(left),
        start=start,
        load=load,
        busy=np.array([bool(route) for route in previous]),
        routes=tuple(fixed),
        previous=tuple(previous),
        aboard=tuple(aboard),
    )


def _kept(problem: Problem) -> Assignment:
    routes = dict(zip(problem.robots, problem.previous, strict=True))
    return Assignment(routes=routes, unassigned={})


def test_a_switch_must_pay_for_itself() -> None:
    # Both robots stand at 0; t0 lies at 10, and going first to t1 at 10.05 would be a bit longer.
    tasks = line([0, 0.04], [(10, 10)])
    before = (stop("t0 visit"),)
    problem = replace(tasks, previous=(before, ()))
    assert ask(problem).routes == {"r0": before, "r1": ()}
    free = ask(problem, params=Params(switch_gain=0.0))
    assert free.routes == {"r0": (), "r1": before}


def test_a_new_task_joins_without_moving_the_others() -> None:
    problem = replace(
        line([0, 20], [(5, 5), (15, 15), (6, 6)]),
        previous=((stop("t0 visit"),), (stop("t1 visit"),)),
    )
    assert ask(problem).routes == {
        "r0": (stop("t0 visit"), stop("t2 visit")),
        "r1": (stop("t1 visit"),),
    }
