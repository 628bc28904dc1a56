"""Known answers and laws of k-means, nearest neighbour and cheapest insertion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import line, problems

from oath import load
from oath.allocate import ALLOCATORS, Budget, Greedy, Kam, Kan, Oath, Problem, checked, plan_all
from oath.allocate.clustering import count, kmeans
from oath.allocate.insertion import best_places
from oath.allocate.kan import nearest_neighbour, to_centroids
from oath.model import Assignment
from oath.scene import pose, prepare
from oath.state import State
from oracles import path_length

MISSIONS = Path(__file__).parents[2] / "missions"
BASELINES = ("cbba", "greedy", "kam", "kan")


def ask(allocator: object, problem: Problem) -> Assignment:
    return checked(allocator, problem, Budget(), np.random.default_rng(0))  # type: ignore[arg-type]


def names(answer: Assignment, robot: str) -> list[str]:
    return [f"{stop.task} {stop.stop}" for stop in answer.routes[robot]]


# --- All of them --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BASELINES)
@settings(max_examples=40, deadline=None)
@given(problem=problems())
def test_all_that_can_be_done_is(name: str, problem: Problem) -> None:
    answer = plan_all(problem, ALLOCATORS[name](), Budget(), np.random.default_rng(0))
    feasible = problem.feasible().any(axis=0)
    done = {stop.task for route in answer.routes.values() for stop in route}
    assert done == {task for task, able in zip(problem.tasks, feasible, strict=True) if able}


@pytest.mark.parametrize("name", BASELINES)
@settings(max_examples=40, deadline=None)
@given(problem=problems(wild=True))
def test_any_costs_do(name: str, problem: Problem) -> None:
    """Routes are checked round by round; what a robot reaches changes as it goes."""
    plan_all(problem, ALLOCATORS[name](), Budget(), np.random.default_rng(0))


@pytest.mark.parametrize("name", BASELINES)
@settings(max_examples=40, deadline=None)
@given(problem=problems(), seed=st.integers(0, 99))
def test_idle_robots_take_what_they_can_carry_and_busy_ones_nothing(
    name: str, problem: Problem, seed: int
) -> None:
    busy = np.random.default_rng(seed).random(len(problem.robots)) < 0.3
    problem = replace(problem, busy=busy)
    answer = ask(ALLOCATORS[name](), problem)
    for r, robot in enumerate(problem.robots):
        tasks = {stop.task for stop in answer.routes[robot]}
        assert len(tasks) <= (0 if busy[r] else max(1, problem.capacity[r]))


@pytest.mark.parametrize("name", BASELINES)
def test_one_robot_one_task(name: str) -> None:
    answer = ask(ALLOCATORS[name](), line([0.0, 9.0], [(8, 5)]))
    assert names(answer, "r0") == [] and names(answer, "r1") == ["t0 pickup", "t0 delivery"]


def test_missions_say_where_their_locations_are() -> None:
    scene = prepare(load(MISSIONS / "maze-09.yaml"))
    problem = pose(scene, State.of(scene.mission))
    for task, first, last in zip(
        scene.mission.tasks, problem.pickup, problem.delivery, strict=True
    ):
        assert problem.points[[first, last]] == pytest.approx(
            np.array([task.stops[0].at, task.stops[-1].at])
        )
    legs = problem.points[:, None] - problem.points
    assert (problem.cost >= np.hypot(legs[..., 0], legs[..., 1]) - 1e-3).all()


# --- K-means ------------------------------------------------------------------------------------


@given(problem=problems(), seed=st.integers(0, 99))
def test_kmeans_puts_every_task_into_one_cluster(problem: Problem, seed: int) -> None:
    n = len(problem.tasks)
    clusters = kmeans(problem, np.arange(n), np.random.default_rng(seed))
    members = np.concatenate([c.tasks for c in clusters]) if clusters else np.empty(0, int)
    assert sorted(members.tolist()) == list(range(n))
    assert len(clusters) <= count(n, len(problem.robots))
    for c in clusters:
        assert c.share.sum() == pytest.approx(1.0)
        off = problem.points[problem.pickup[c.tasks]] - problem.points[
            problem.pickup[c.tasks]
        ].mean(axis=0)
        assert c.medoid == c.tasks[np.argmin(np.hypot(*off.T))]


def test_kmeans_finds_what_lies_together_and_sees_no_walls() -> None:
    problem = line([0.0], [(x, x + 0.5) for x in (0, 1, 2, 50, 51, 90, 91, 92)])
    apart = replace(problem, cost=np.where(problem.cost > 0, 1000.0, 0.0))
    groups = [c.tasks.tolist() for c in kmeans(apart, np.arange(8), np.random.default_rng(0),
                                               clusters=3)]  # fmt: skip
    assert groups == [[0, 1, 2], [3, 4], [5, 6, 7]]


def test_pickups_in_one_place_make_one_cluster() -> None:
    problem = line([0.0], [(3, x) for x in range(4, 13)])
    assert len(kmeans(problem, np.arange(9), np.random.default_rng(0))) == 1


# --- KAN and KAM --------------------------------------------------------------------------------


def test_nearest_neighbour_goes_where_it_is_nearest() -> None:
    """Room for two: the third pickup is passed by, the first delivery lies before the second."""
    problem = line([0.0], [(1, 5), (2, 9), (3, 4)], capacity=2)
    picks = nearest_neighbour(problem, 0, [0, 1, 2])
    assert picks == ((0, "pickup"), (1, "pickup"), (0, "delivery"), (1, "delivery"))


def test_nearest_neighbour_delivers_first_if_that_is_nearer() -> None:
    problem = line([0.0], [(1, 2), (5, 4), (3, 3)], capacity=3)
    picks = nearest_neighbour(problem, 0, [0, 1, 2])
    assert [stop for _, stop in picks] == ["pickup", "delivery", "visit", "pickup", "delivery"]


def test_nearest_neighbour_takes_less_rather_than_strand_a_load() -> None:
    problem = line([0.0], [(1, 9), (2, 8)], capacity=2)
    cost = problem.cost.copy()
    cost[0, 2, 3] = cost[0, 4, 3] = np.inf  # nobody comes from the other task to the first's end
    picks = nearest_neighbour(replace(problem, cost=cost), 0, [0, 1])
    assert picks == ((0, "pickup"), (0, "delivery"))


def test_bids_go_by_straight_distance_to_the_mean() -> None:
    problem = line([0.0, 9.0], [(2, 2), (4, 4)])
    clusters = kmeans(problem, np.arange(2), np.random.default_rng(0), clusters=1)
    assert to_centroids(problem, clusters).tolist() == [[3.0], [6.0]]


def test_only_kan_drives_into_the_wall() -> None:
    """A long way round to the nearer of two tasks: KAN is taken in, KAM and OATH are not."""
    problem = line([0.0], [(2, 2), (-3, -3)], capacity=1)
    cost = problem.cost.copy()
    cost[0, 0, 1] = cost[0, 1, 0] = 100.0
    problem = replace(problem, cost=cost)
    assert names(ask(Kan(), problem), "r0") == ["t0 visit"]
    assert names(ask(Kam(), problem), "r0") == ["t1 visit"] == names(ask(Oath(), problem), "r0")


# --- Greedy -------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(problem=problems(robots=1, tasks=6))
def test_the_best_places_are_those_of_all_places(problem: Problem) -> None:
    """A second task into the path of a first, against every pair of places."""
    able = np.flatnonzero(problem.feasible()[0]).tolist()
    problem = replace(problem, capacity=np.array([2], dtype=np.int32))
    for a in able[:2]:
        first = [(a, "visit")] if problem.visit[a] else [(a, "pickup"), (a, "delivery")]
        path = [problem.start[0], problem.pickup[a], problem.delivery[a]][: 1 + len(first)]
        increase, _, _ = best_places(
            problem.cost[problem.mode[0]],
            np.array(path),
            problem.pickup,
            problem.delivery,
            problem.visit,
        )
        before = path_length(problem, 0, tuple(first))
        for b in set(able) - {a}:
            lengths = []
            for i in range(len(first) + 1):
                for j in range(i, len(first) + 1):
                    new = [*first[:j], (b, "delivery"), *first[j:]]
                    new.insert(i, (b, "pickup"))
                    if problem.visit[b]:
                        new = [*first[:i], (b, "visit"), *first[i:]]
                    lengths.append(path_length(problem, 0, tuple(new)))
            assert increase[b] == pytest.approx(min(lengths) - before)


def test_the_cheapest_insertion_comes_first() -> None:
    """t1 costs 2, t2 then nothing on its way; t0 is left, for r0 is full and r1 cannot do it."""
    problem = line(
        [0.0, 50.0],
        [(9, 10), (1, 2), (1.2, 1.8)],
        capability=[[1.0, 0.0], [0.0, 1.0]],
        types=[0, 0, 0],
    )
    answer = ask(Greedy(), problem)
    assert names(answer, "r0") == ["t1 pickup", "t2 pickup", "t2 delivery", "t1 delivery"]
    assert set(answer.unassigned) == {"t0"}


def test_ties_go_to_the_lower_robot_then_task() -> None:
    problem = line([5.0, 5.0], [(6, 6), (4, 4)], capacity=1)
    answer = ask(Greedy(), problem)
    assert names(answer, "r0") == ["t0 visit"] and names(answer, "r1") == ["t1 visit"]
