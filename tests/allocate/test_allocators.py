"""The contract suite: every allocator passes it, broken ones do not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import line, problems

from oath.allocate import (
    ALLOCATORS,
    WAITING,
    Allocator,
    Budget,
    Oath,
    Problem,
    allocator,
    checked,
    plan_all,
)
from oath.allocate.oath import Params
from oath.errors import BadInput, ProviderError
from oath.model import Assignment, Route, RouteStop

BUDGET = Budget(iterations=200)


def ask(solver: Allocator, problem: Problem, seed: int = 0) -> Assignment:
    return checked(solver, problem, BUDGET, np.random.default_rng(seed))


def route(*stops: str) -> Route:
    """``route("t0 pickup", ...)``."""
    return tuple(
        RouteStop(task=task, stop=stop)  # type: ignore[arg-type]
        for task, stop in (text.split() for text in stops)
    )


def suite(make: Callable[[], Allocator], problem: Problem) -> None:
    """What every allocator must do."""
    answer = ask(make(), problem)  # checks all that one answer can show
    feasible = problem.feasible().any(axis=0)
    for task, reason in answer.unassigned.items():
        assert (reason == WAITING) == feasible[problem.tasks.index(task)]
    if feasible.any() and not problem.busy.any():
        assert any(answer.routes.values()), "nothing is done though something can be"
    assert ask(make(), problem) == answer, "the same seed gave another answer"


@pytest.mark.parametrize("name", sorted(ALLOCATORS))
@settings(max_examples=60, deadline=None)
@given(problem=problems())
def test_contract(name: str, problem: Problem) -> None:
    suite(ALLOCATORS[name], problem)


class Broken:
    """Passes what Oath answers through a change that breaks the contract."""

    def __init__(self, change: Callable[[Assignment], Assignment]) -> None:
        self.change = change

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        return self.change(Oath().allocate(problem, budget, rng))


def _with(answer: Assignment, *stops: str, robot: str = "r0") -> Assignment:
    """The answer with another route, and nothing unassigned that stands in it."""
    new = route(*stops)
    names = {stop.task for stop in new}
    others = {task: why for task, why in answer.unassigned.items() if task not in names}
    return Assignment(routes={**answer.routes, robot: new}, unassigned=others)


BREAKS: dict[str, tuple[Callable[[Assignment], Assignment], str]] = {
    "no route": (lambda a: replace(a, routes={"r0": a.routes["r0"]}), "has no route"),
    "unknown robot": (lambda a: replace(a, routes={**a.routes, "r9": ()}), "'r9' is unknown"),
    "lost": (lambda a: replace(a, unassigned={}), "lost"),
    "both": (lambda a: replace(a, unassigned={"t0": "", "t1": "", "t2": ""}), "both"),
    "unknown unassigned": (lambda a: replace(a, unassigned={"x": "", **a.unassigned}), "'x'"),
    "unknown task": (lambda a: _with(a, "x visit"), "unknown task 'x'"),
    "doubled": (lambda a: _with(a, *["t0 pickup", "t0 delivery"] * 2), "stops"),
    "wrong order": (lambda a: _with(a, "t0 delivery", "t0 pickup"), "stops"),
    "half": (lambda a: _with(a, "t0 pickup"), "stops"),
    "wrong stop": (lambda a: _with(a, "t0 visit"), "stops"),
    "split": (lambda a: _with(_with(a, "t0 pickup"), "t0 delivery", robot="r1"), "split"),
    "overload": (
        lambda a: _with(a, "t0 pickup", "t1 pickup", "t0 delivery", "t1 delivery"),
        "carries 2",
    ),
    "incapable": (lambda a: _with(a, "t2 pickup", "t2 delivery"), "cannot do"),
}


@pytest.mark.parametrize("name", BREAKS)
def test_broken_allocators_are_caught(name: str) -> None:
    problem = line(
        [0.0, 9.0],
        [(1, 2), (3, 4), (8, 7)],
        capacity=1,
        capability=[[1, 0], [1, 1]],
        types=[0, 0, 1],
    )
    change, message = BREAKS[name]
    with pytest.raises(ProviderError, match=message):
        suite(lambda: Broken(change), problem)


def test_out_of_reach_and_dropped_loads_are_caught() -> None:
    problem = line([0.0], [(1, 2)])
    cut = replace(problem, cost=np.where(problem.cost > 0, np.inf, 0.0))
    with pytest.raises(ProviderError, match="cannot reach the pickup"):
        ask(Broken(lambda a: _with(a, "t0 pickup", "t0 delivery")), cut)
    carrying = replace(problem, busy=np.array([True]), routes=(route("old delivery"),))
    with pytest.raises(ProviderError, match="drops the delivery of 'old'"):
        ask(Broken(lambda a: _with(a)), carrying)
    with pytest.raises(ProviderError, match="twice"):
        ask(Broken(lambda a: _with(a, "old delivery", "old delivery")), carrying)


def test_a_lazy_or_moody_allocator_fails_the_suite() -> None:
    problem = line([0.0], [(1, 2)])
    lazy = Broken(lambda a: Assignment(routes={"r0": ()}, unassigned={"t0": WAITING}))
    with pytest.raises(AssertionError, match="nothing is done"):
        suite(lambda: lazy, problem)


def test_a_delivery_on_the_way_makes_room() -> None:
    problem = line([0.0], [(1, 2)], capacity=0)
    problem = replace(problem, busy=np.array([True]), routes=(route("old delivery"),))
    ask(Broken(lambda a: _with(a, "old delivery", "t0 pickup", "t0 delivery")), problem)
    with pytest.raises(ProviderError, match="carries 1"):
        ask(Broken(lambda a: _with(a, "t0 pickup", "old delivery", "t0 delivery")), problem)


def test_what_is_added_to_a_route_is_reached_from_its_end() -> None:
    """A find may have cut off the route's own stops from there; that is not the allocator's."""
    problem = line([5.0], [(1, 5), (6, 7)])
    problem.cost[0, 0, 1] = np.inf  # from where t0 ends to where it begins
    problem = replace(problem, busy=np.array([True]), routes=(route("t0 pickup", "t0 delivery"),))
    longer = ("t0 pickup", "t0 delivery", "t1 pickup", "t1 delivery")
    ask(Broken(lambda a: _with(a, *longer)), problem)
    problem.cost[0, 0, 2] = np.inf
    with pytest.raises(ProviderError, match="cannot reach the pickup of task 't1'"):
        ask(Broken(lambda a: _with(a, *longer)), problem)


def test_names_are_looked_up() -> None:
    assert isinstance(allocator("oath"), Oath)
    with pytest.raises(BadInput, match="did you mean 'oath'"):
        allocator("oth")


# --- The paper's allocator ------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(problem=problems(), theta=st.sampled_from([0.0, 1.0, 2.0]), elbow=st.booleans())
def test_switches_keep_the_contract(problem: Problem, theta: float, elbow: bool) -> None:
    suite(lambda: Oath(Params(theta=theta, elbow=elbow, clusters=3)), problem)


@settings(max_examples=40, deadline=None)
@given(problem=problems())
def test_winners_take_what_they_can_carry_at_most(problem: Problem) -> None:
    answer = ask(Oath(), problem)
    for r, robot in enumerate(problem.robots):
        tasks = {stop.task for stop in answer.routes[robot]}
        assert len(tasks) <= max(1, problem.capacity[r])


def test_busy_robots_keep_their_routes_and_tasks() -> None:
    problem = line([0.0, 10.0], [(1, 2), (3, 4), (9, 8)])
    mine = route("t0 pickup", "t0 delivery")
    problem = replace(problem, busy=np.array([True, False]), routes=(mine, ()))
    answer = ask(Oath(), problem)
    assert answer.routes["r0"] == mine
    assert {stop.task for stop in answer.routes["r1"]} <= {"t1", "t2"} != set()


def test_milp_and_dynamic_program_find_the_same() -> None:
    problem = line([0.0, 20.0], [(1, 3), (2, 6), (18, 15), (12, 19), (7, 7)])
    by_milp = ask(Oath(Params(method="milp")), problem)
    assert by_milp == ask(Oath(), problem)


@pytest.mark.parametrize(
    ("cost", "capability", "capacity", "reason"),
    [
        ({}, 0.0, 1, "no robot can do type 'a'"),
        ({(0, 1): np.inf}, 1.0, 1, "no capable robot reaches its pickup"),
        ({(1, 2): np.inf}, 1.0, 1, "no capable robot reaches its delivery"),
        ({}, 1.0, 0, "no room"),
    ],
)
def test_reasons(
    cost: dict[tuple[int, int], float], capability: float, capacity: int, reason: str
) -> None:
    problem = line([0.0], [(1, 2)], capability=[[capability]], capacity=capacity)
    matrix = problem.cost.copy()
    for (a, b), value in cost.items():
        matrix[0, a, b] = value
    problem = replace(problem, cost=matrix)
    for answer in (
        ask(Oath(), problem),
        plan_all(problem, Oath(), BUDGET, np.random.default_rng()),
    ):
        assert answer.routes == {"r0": ()}
        assert answer.unassigned["t0"].startswith(reason)


def test_at_least_one_task_is_taken_where_every_medoid_is_out_of_reach() -> None:
    """Only a busy robot reaches the medoid; the idle one reaches another task of the cluster."""
    problem = line([0.0, 8.0], [(5, 5), (6, 6), (7, 7)])
    cost = problem.cost.copy()
    cost[0, 0, 3] = np.inf  # from the idle robot to the middle one
    routes = ((), route("old delivery"))
    problem = replace(problem, cost=cost, busy=np.array([False, True]), routes=routes)
    answer = ask(Oath(Params(clusters=1)), problem)
    assert answer.routes["r0"] == route("t0 visit")


def test_no_tasks_no_robots() -> None:
    rng = np.random.default_rng(0)
    assert ask(Oath(), line([0.0], [])) == Assignment(routes={"r0": ()}, unassigned={})
    nobody = plan_all(line([], [(1, 2)]), Oath(), BUDGET, rng)
    assert nobody == Assignment(routes={}, unassigned={"t0": "no robot can do type 'a'"})


def degenerate() -> dict[str, Problem]:
    pair = line([0.0, 5.0], [(1.0, 2.0), (3.0, 4.0)])
    blind, one_sided = pair.cost.copy(), pair.cost.copy()
    blind[:, 2], blind[:, :, 2] = np.nan, np.nan  # the first pickup
    one_sided[:, 0, 3] = np.inf
    return {
        "no robots": line([], [(1.0, 2.0)]),
        "no tasks": line([0.0], []),
        "nothing": line([], []),
        "nobody can": line([0.0], [(1.0, 2.0)], capability=[[0.0]]),
        "room for more than there is": line([0.0], [(1.0, 2.0), (3.0, 4.0)], capacity=50),
        "one-sided": replace(pair, cost=one_sided),
        "lopsided": replace(pair, cost=pair.cost * np.array([[[1.0], [2.0], [3.0]] * 2])),
        "not a number": replace(pair, cost=blind),
    }


@pytest.mark.parametrize("case", degenerate())
@pytest.mark.parametrize("name", sorted(ALLOCATORS))
@pytest.mark.parametrize("budget", [BUDGET, Budget(seconds=0.0)])
def test_odd_problems_get_an_answer_with_reasons(name: str, case: str, budget: Budget) -> None:
    problem = degenerate()[case]
    answer = plan_all(problem, ALLOCATORS[name](), budget, np.random.default_rng(0))
    feasible = problem.feasible().any(axis=0) if problem.robots else [False] * len(problem.tasks)
    for task, able in zip(problem.tasks, feasible, strict=True):
        assert (task in answer.unassigned) == (not able)
        assert able or answer.unassigned[task]
