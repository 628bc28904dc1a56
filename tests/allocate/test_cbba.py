"""Laws of the consensus: one winner a task, in time, on any graph, worth half of the best."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import line, problems

from oath.allocate import Budget, Cbba, Problem, checked, plan_all
from oath.allocate.cbba import Network, Params, links, travel_gain
from oath.allocate.consensus import Gain, agree, diameter
from oath.allocate.stages import quota
from oath.errors import BadInput, ProviderError
from oath.model import Assignment
from oracles import path_length

NAMES = [f"r{i}" for i in range(6)]
NETWORKS = ("complete", "line", "ring", "star", "tree")


def network(kind: str, robots: int, rng: np.random.Generator) -> np.ndarray:
    if kind == "tree":
        pairs = tuple((NAMES[i], NAMES[rng.integers(i)]) for i in range(1, robots))
        return links(pairs, NAMES[:robots])
    return links(kind, NAMES[:robots])  # type: ignore[arg-type]


def coverage(rng: np.random.Generator, robots: int, tasks: int, whole: bool) -> Gain:
    """Each task covers items, which count only once: gains diminish. Whole worths tie often."""
    items = rng.random((tasks, 6)) < 0.4
    worth = rng.integers(1, 4, (robots, 6)).astype(float) if whole else rng.random((robots, 6))

    def gain(agent: int, path: object) -> tuple[np.ndarray, np.ndarray]:
        done = items[list(path)].any(axis=0)  # type: ignore[call-overload]
        return (items & ~done) @ worth[agent], np.full(tasks, len(list(path)))  # type: ignore

    return gain


def total(gain: Gain, agent: int, path: tuple[int, ...]) -> float:
    return sum(float(gain(agent, path[:i])[0][task]) for i, task in enumerate(path))


def optimum(gain: Gain, tasks: int, most: list[int]) -> float:
    """The greatest worth of all ways to give tasks to agents or to nobody."""
    best = 0.0
    for owner in product(range(len(most) + 1), repeat=tasks):
        sets = [tuple(j for j in range(tasks) if owner[j] == i) for i in range(len(most))]
        if all(len(own) <= limit for own, limit in zip(sets, most, strict=True)):
            best = max(best, sum(total(gain, i, own) for i, own in enumerate(sets)))
    return best


def central(gain: Gain, tasks: int, most: list[int]) -> tuple[tuple[int, ...], ...]:
    """The central greedy: always the highest warped bid; ties to the lower agent."""
    paths: list[list[int]] = [[] for _ in most]
    least, left = [np.inf] * len(most), set(range(tasks))
    while True:
        bids = []
        for i, path in enumerate(paths):
            gains, places = gain(i, path)
            open_ = [j for j in left if gains[j] > 0 and len(path) < most[i]]
            bids += [(-min(gains[j], least[i]), i, -gains[j], j, places[j]) for j in open_]
        if not bids:
            return tuple(map(tuple, paths))
        bid, i, _, task, place = min(bids)
        paths[i].insert(int(place), task)
        least[i] = -bid
        left.remove(task)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    kind=st.sampled_from(NETWORKS),
    rebuild=st.booleans(),
    whole=st.booleans(),
)
def test_diminishing_gains_end_in_time_without_conflict(
    seed: int, kind: str, rebuild: bool, whole: bool
) -> None:
    rng = np.random.default_rng(seed)
    robots, tasks = int(rng.integers(1, 6)), int(rng.integers(1, 9))
    linked = network(kind, robots, rng)
    gain = coverage(rng, robots, tasks, whole)
    most = rng.integers(1, 4, robots).tolist()
    result = agree(gain, tasks, most, linked, rebuild=rebuild)
    won = [task for bundle in result.bundles for task in bundle]
    assert len(won) == len(set(won))
    assert all(len(b) <= limit for b, limit in zip(result.bundles, most, strict=True))
    assert result.rounds <= tasks * max(1, diameter(linked))
    assert [sorted(path) for path in result.paths] == [sorted(b) for b in result.bundles]


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(NETWORKS), rebuild=st.booleans())
def test_diminishing_gains_are_worth_half_of_the_best(seed: int, kind: str, rebuild: bool) -> None:
    rng = np.random.default_rng(seed)
    robots, tasks = int(rng.integers(1, 4)), int(rng.integers(1, 6))
    gain = coverage(rng, robots, tasks, whole=False)
    most = rng.integers(1, 4, robots).tolist()
    result = agree(gain, tasks, most, network(kind, robots, rng), rebuild=rebuild)
    worth = sum(total(gain, i, bundle) for i, bundle in enumerate(result.bundles))
    assert worth >= 0.5 * optimum(gain, tasks, most) - 1e-9


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(NETWORKS), whole=st.booleans())
def test_every_graph_agrees_on_what_a_central_greedy_does(
    seed: int, kind: str, whole: bool
) -> None:
    rng = np.random.default_rng(seed)
    robots, tasks = int(rng.integers(1, 6)), int(rng.integers(1, 9))
    gain = coverage(rng, robots, tasks, whole)
    most = rng.integers(1, 4, robots).tolist()
    result = agree(gain, tasks, most, network(kind, robots, rng))
    assert result.paths == central(gain, tasks, most)


@settings(max_examples=60, deadline=None)
@given(problem=problems(tasks=9, wild=True), kind=st.sampled_from(NETWORKS))
def test_so_do_bids_for_travel_whatever_it_costs(problem: Problem, kind: str) -> None:
    linked = network(kind, len(problem.robots), np.random.default_rng(0))
    most, gain = quota(problem).tolist(), travel_gain(problem)
    result = agree(gain, len(problem.tasks), most, linked)
    assert result.paths == central(gain, len(problem.tasks), most)


@settings(max_examples=60, deadline=None)
@given(problem=problems())
def test_gains_are_what_an_insertion_adds(problem: Problem) -> None:
    """The first two tasks of a robot, one after the other, against the lengths of the paths."""
    gain = travel_gain(problem)

    def length(path: list[int]) -> float:
        stops = [(t, s) for t in path for s in (["visit"] if problem.visit[t] else
                                                ["pickup", "delivery"])]  # fmt: skip
        return path_length(problem, 0, tuple(stops))

    empty, _ = gain(0, [])
    able = np.flatnonzero(empty > 0).tolist()
    if len(able) < 2 or problem.capacity[0] < 1:
        return
    a, b = able[:2]
    gains, places = gain(0, [a])
    path = [a]
    path.insert(int(places[b]), b)
    if gains[b] > 0:
        constant = empty[a] + length([a])
        assert constant - gains[b] == pytest.approx(length(path) - length([a]))
        assert length(path) == pytest.approx(min(length([a, b]), length([b, a])))


@settings(max_examples=20, deadline=None)
@given(problem=problems(), kind=st.sampled_from(NETWORKS[:-1]), rebuild=st.booleans())
def test_switches_keep_the_contract(problem: Problem, kind: Network, rebuild: bool) -> None:
    allocator = Cbba(Params(network=kind, rebuild=rebuild))
    answer = plan_all(problem, allocator, Budget(), np.random.default_rng(0))
    done = {stop.task for route in answer.routes.values() for stop in route}
    able = problem.feasible().any(axis=0)
    assert done == {task for task, doable in zip(problem.tasks, able, strict=True) if doable}


def ask(problem: Problem, params: Params | None = None) -> Assignment:
    return checked(Cbba(params or Params()), problem, Budget(), np.random.default_rng(0))


def test_the_nearer_robot_wins_and_the_task_on_the_way_is_inserted() -> None:
    problem = line([0.0, 20.0], [(8, 9), (2, 3), (18, 17)])
    answer = ask(problem)
    assert [stop.task for stop in answer.routes["r0"]] == ["t1", "t1", "t0", "t0"]
    assert [stop.task for stop in answer.routes["r1"]] == ["t2", "t2"]


def test_news_passes_through_busy_robots() -> None:
    """Both ends want the task; only the busy robot between them hears both."""
    problem = line([0.0, 5.0, 9.0], [(4, 4)])
    problem = replace(problem, busy=np.array([False, True, False]))
    answer = ask(problem, Params(network="line"))
    assert [len(answer.routes[robot]) for robot in problem.robots] == [1, 0, 0]


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        ((("r0", "r1"),), "never hear of each other"),
        ((("r0", "r1"), ("r1", "r9")), "unknown robot 'r9'"),
    ],
)
def test_networks_that_make_no_sense_are_refused(
    pairs: tuple[tuple[str, str], ...], message: str
) -> None:
    with pytest.raises(BadInput, match=message):
        ask(line([0.0, 1.0, 2.0], [(1, 2)]), Params(network=pairs))


def test_agents_that_change_their_minds_are_stopped() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ProviderError, match="no agreement"):
        agree(
            lambda agent, path: (rng.random(4) + 1.0, np.zeros(4, dtype=np.intp)),
            4,
            [2, 2, 2],
            links("line", NAMES[:3]),
        )
