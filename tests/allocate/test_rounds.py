"""Laws of assignments beyond one round."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import line, problems

from oath.allocate import WAITING, Budget, ByPriority, Oath, Problem, checked, plan_all, urgent
from oath.allocate.problem import Aboard
from oath.model import Assignment, RouteStop


def plan(problem: Problem, seed: int = 0) -> Assignment:
    return plan_all(problem, Oath(), Budget(), np.random.default_rng(seed))


class Same:
    """Returns a fixed assignment, so that `checked` can judge one made elsewhere."""

    def __init__(self, answer: Assignment) -> None:
        self.answer = answer

    def allocate(self, *_: object) -> Assignment:
        return self.answer


def judge(problem: Problem, answer: Assignment) -> None:
    checked(Same(answer), problem, Budget(), np.random.default_rng(0))


@settings(max_examples=80, deadline=None)
@given(problem=problems(tasks=14))
def test_no_task_is_lost_or_doubled_and_all_that_can_be_done_is(problem: Problem) -> None:
    answer = plan(problem)
    judge(problem, answer)
    feasible = problem.feasible().any(axis=0)
    done = {stop.task for route in answer.routes.values() for stop in route}
    assert done == {task for task, able in zip(problem.tasks, feasible, strict=True) if able}
    assert WAITING not in answer.unassigned.values()
    assert plan(problem) == answer


@settings(max_examples=40, deadline=None)
@given(problem=problems(wild=True))
def test_it_ends_with_any_costs(problem: Problem) -> None:
    judge(problem, plan(problem))


def test_a_robot_far_from_everything_joins_only_when_needed() -> None:
    """r0 is back for more long before r1 has come: rounds follow travel times."""
    problem = line([0.0, 1000.0], [(x, x + 1) for x in range(12)], capacity=1)
    problem = replace(problem, capacity=np.array([1, 1], dtype=np.int32))
    answer = plan(problem)
    assert len(answer.routes["r1"]) == 2
    assert len(answer.routes["r0"]) == 22


def test_service_time_counts() -> None:
    """While r0 works at its first visit, r1 does the rest."""
    problem = line([0.0, 3.0], [(0, 0), (3, 3), (4, 4), (5, 5)], capacity=1)
    answer = plan(replace(problem, service_time=np.array([99.0, 0, 0, 0])))
    assert [stop.task for stop in answer.routes["r0"]] == ["t0"]
    assert {stop.task for stop in answer.routes["r1"]} == {"t1", "t2", "t3"}


def test_robots_that_are_busy_from_the_start_keep_their_routes() -> None:
    problem = line([0.0, 10.0], [(1, 2), (3, 4), (9, 8)])
    carried = RouteStop(task="old", stop="delivery")
    mine = (carried, *(RouteStop(task="t0", stop=stop) for stop in ("pickup", "delivery")))
    problem = replace(problem, busy=np.array([True, False]), routes=(mine, ()))
    answer = plan(problem)
    judge(problem, answer)
    assert answer.routes["r0"] == mine
    assert {stop.task for stop in answer.routes["r1"]} == {"t1", "t2"}


def test_an_urgent_task_goes_to_who_completes_it_soonest() -> None:
    problem = line([0.0, 10.0], [(4, 4), (6, 5)])
    problem = replace(problem, speed=np.array([1.0, 4.0]))
    answer = urgent(problem, [0, 1])
    # r1 needs 1.5 s to t0 and is the first at t1 from there, too
    assert [stop.task for stop in answer.routes["r1"]] == ["t0", "t1", "t1"]
    assert answer.routes["r0"] == () and answer.unassigned == {}


def loaded(problem: Problem, *loads: list[int]) -> Problem:
    """Return the problem with loads aboard, given by where they go."""
    aboard = tuple(
        tuple(
            Aboard(task=f"l{r}{i}", delivery=int(problem.delivery[to]), service_time=0.0)
            for i, to in enumerate(load)
        )
        for r, load in enumerate(loads)
    )
    return replace(problem, aboard=aboard, load=np.array([len(a) for a in aboard], dtype=np.int32))


def test_a_full_robot_unloads_first_what_lets_it_begin_soonest() -> None:
    problem = loaded(line([0.0], [(5, 6), (9, 9), (2, 2)], capacity=2), [1, 2])
    answer = urgent(problem, [0])
    assert [(stop.task, stop.stop) for stop in answer.routes["r0"]] == [
        ("l01", "delivery"),
        ("t0", "pickup"),
        ("t0", "delivery"),
    ]


def test_a_free_robot_goes_where_a_full_one_would_be_later() -> None:
    problem = loaded(line([4.0, 0.0], [(5, 6), (9, 9)], capacity=1), [1], [])
    assert urgent(problem, [0]).routes["r0"] == ()


def test_of_equally_soon_robots_the_holder_keeps_an_urgent_task() -> None:
    problem = line([0.0, 10.0], [(5, 6)])
    assert urgent(problem, [0]).routes["r1"] == ()
    mine = (RouteStop(task="t0", stop="pickup"), RouteStop(task="t0", stop="delivery"))
    held = replace(problem, previous=((), mine))
    assert urgent(held, [0]).routes == {"r0": (), "r1": mine}


def test_urgent_tasks_say_why_they_cannot_be_done() -> None:
    problem = line([0.0], [(1, 2), (3, 4)], capability=[[1.0, 0.0]], types=[1, 0])
    answer = urgent(problem, [0])
    assert answer.routes == {"r0": ()}
    assert answer.unassigned == {"t0": "no robot can do type 'b'"}


@pytest.mark.parametrize(("priority", "shares"), [([1, 0], [6.0]), ([0, -1], [3.0, 3.0])])
def test_priorities_share_the_time_there_is(priority: list[int], shares: list[float]) -> None:
    asked = []

    class Spy(Oath):
        def allocate(self, problem: Problem, budget: Budget, rng: Any) -> Assignment:
            asked.append(budget.seconds)
            return super().allocate(problem, budget, rng)

    problem = replace(line([0.0], [(1, 2), (3, 4)], capacity=2), priority=np.array(priority))
    ByPriority(Spy()).allocate(problem, Budget(seconds=6.0), np.random.default_rng(0))
    assert asked == shares


@settings(max_examples=60, deadline=None)
@given(problem=problems(), seed=st.integers(0, 99))
def test_each_urgent_task_is_given_once(problem: Problem, seed: int) -> None:
    rng = np.random.default_rng(seed)
    tasks = np.flatnonzero(rng.random(len(problem.tasks)) < 0.5).tolist()
    answer = urgent(problem, tasks)
    others = {task: "" for i, task in enumerate(problem.tasks) if i not in tasks}
    judge(problem, replace(answer, unassigned={**answer.unassigned, **others}))
    feasible = problem.feasible().any(axis=0)
    assert set(answer.unassigned) == {problem.tasks[i] for i in tasks if not feasible[i]}
