"""Laws of the clusters and of the bids for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import line, problems

from oath.allocate import Problem
from oath.allocate.auction import auction, scores, specialisation
from oath.allocate.clustering import cluster


@given(
    shape=st.tuples(st.integers(0, 6), st.integers(0, 6)),
    seed=st.integers(0, 2**32 - 1),
    hidden=st.sampled_from([0.0, 0.3, 1.0]),
)
def test_auction_ends_without_conflict_and_nobody_can_do_better(
    shape: tuple[int, int], seed: int, hidden: float
) -> None:
    rng = np.random.default_rng(seed)
    score = rng.integers(0, 5, shape).astype(float)  # many ties
    score[rng.random(shape) < hidden] = np.inf
    outcome = auction(score)
    won = outcome.won.tolist()
    taken = [k for k in won if k >= 0]
    assert len(taken) == len(set(taken))
    assert outcome.bids <= score.size
    holder = {k: (score[r, k], r) for r, k in enumerate(won) if k >= 0}
    for r, own in enumerate(won):
        mine = score[r, own] if own >= 0 else np.inf
        assert own < 0 or np.isfinite(mine)
        for k in range(shape[1]):
            if score[r, k] < mine:  # what it would rather have went to a lower bid
                assert holder[k] < (score[r, k], r)


@given(problem=problems(), elbow=st.booleans())
def test_every_task_is_in_one_cluster(problem: Problem, elbow: bool) -> None:
    n, robots = len(problem.tasks), len(problem.robots)
    clusters = cluster(problem, np.arange(n), elbow=elbow)
    members = np.concatenate([c.tasks for c in clusters]) if clusters else np.empty(0, int)
    assert sorted(members.tolist()) == list(range(n))
    if not elbow or n < robots:
        assert len(clusters) == (n if n < robots else min(n, max(4, robots + 1)))
    for c in clusters:
        assert c.medoid in c.tasks
        assert c.share.sum() == pytest.approx(1.0)


def test_clusters_are_what_lies_together() -> None:
    places = [0, 1, 2, 50, 51, 90, 91, 92]
    problem = line([0.0], [(x, x + 0.5) for x in places])
    for options in ({"clusters": 3}, {"elbow": True}):
        groups = [c.tasks.tolist() for c in cluster(problem, np.arange(8), **options)]
        assert groups == [[0, 1, 2], [3, 4], [5, 6, 7]]
    assert cluster(problem, np.arange(8), clusters=3)[0].medoid == 1


def test_a_wall_parts_what_lies_together() -> None:
    problem = line([0.0], [(0, 0), (0.1, 0.1), (9, 9), (9.1, 9.1)])
    cost = problem.cost.copy()
    cost[:, 1, 2] = cost[:, 2, 1] = 100.0
    groups = [c.tasks.tolist() for c in cluster(replace(problem, cost=cost), np.arange(4),
                                                clusters=3)]  # fmt: skip
    assert groups == [[0], [1], [2, 3]]


def test_tasks_that_tie_still_make_as_many_clusters() -> None:
    problem = line([0.0], [(3, 3)] * 9)
    assert len(cluster(problem, np.arange(9))) == 4


def test_specialists_go_first() -> None:
    """A robot that can do one type only outbids a nearer one that can do both."""
    problem = line([0.0, 3.0], [(5, 6)], capability=[[1.0, 1.0], [1.0, 0.0]], types=[0])
    problem = replace(problem, start=np.array([1, 0], dtype=np.int32))
    clusters = cluster(problem, np.arange(1))
    assert specialisation(problem, clusters).tolist() == [[0.5], [1.0]]
    feasible = problem.feasible()
    assert scores(problem, clusters, feasible).tolist() == [[4.0], [5.0]]
    assert scores(problem, clusters, feasible, theta=4.0).tolist() == [[32.0], [5.0]]


@pytest.mark.parametrize("theta", [0.0, 1.0])
def test_what_a_robot_cannot_do_is_masked_before_theta(theta: float) -> None:
    problem = line([0.0, 0.0], [(5, 6)], capability=[[0.0, 1.0], [0.5, 0.0]], types=[0])
    score = scores(problem, cluster(problem, np.arange(1)), problem.feasible(), theta)
    assert score[0, 0] == np.inf and np.isfinite(score[1, 0])


@settings(max_examples=50)
@given(problem=problems(wild=True))
def test_scores_are_never_nan(problem: Problem) -> None:
    clusters = cluster(problem, np.arange(len(problem.tasks)))
    score = scores(problem, clusters, problem.feasible())
    assert score.shape == (len(problem.robots), len(clusters))
    assert not np.isnan(score).any()


def test_half_the_capability_doubles_the_bid() -> None:
    problem = line([0.0, 0.0], [(5, 6)], capability=[[1.0], [0.5]], types=[0])
    score = scores(problem, cluster(problem, np.arange(1)), problem.feasible())
    assert score[1, 0] == 2 * score[0, 0]
