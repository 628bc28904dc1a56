"""The studies of roadmaps, clusters, selection and automata, each on its smallest case."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from oath.bench import Row, markdown, study
from oath.bench.clusters import scene, spread
from oath.bench.shortest import exact_lengths
from oath.bench.tuning import sweep
from oath.model import Map, Motion
from oath.scene import pose
from oath.state import State
from oath.world.workspace import Mode

SMALLEST = {
    "sampling": [
        f"{sampling}-200-{nodes}-0"
        for nodes in ("plain", "corners")
        for sampling in ("adaptive", "uniform", "grid", "random")
    ],
    "tuning": ["0.4-0.5-0.2-plain-0", "0.4-0.5-0.2-corners-0", "0.3-0.5-0.2-plain-0"],
    "clusters": ["maze-9", "maze-15"],
    "selection": ["dp-1-0", "dp-9-0"],
    "automaton": ["200-8-5-0", "1000-2-5-0"],
}


@cache
def rows(name: str) -> list[Row]:
    chosen = study(name)
    cases = {case.key: case for case in chosen.cases(True, 1)}
    return [row for key in SMALLEST[name] for row in chosen.measure(**cases[key].arguments)]


@pytest.mark.parametrize("name", SMALLEST)
def test_cases_have_their_own_keys_and_grow_with_the_seeds(name: str) -> None:
    chosen = study(name)
    quick, whole = chosen.cases(True, 2), chosen.cases(False, 2)
    for cases in (quick, whole):
        assert len({case.key for case in cases}) == len(cases)
    assert 5 <= len(quick) <= len(whole)
    assert len(chosen.cases(True, 1)) <= len(quick)
    assert len(chosen.cases(False, 3)) > len(whole)
    # What is finished in a quick study may serve in a whole one, if it is the same work.
    same = {case.key: dict(case.arguments) for case in whole}
    assert all(same.get(c.key, dict(c.arguments)) == dict(c.arguments) for c in quick)


@pytest.mark.parametrize("name", SMALLEST)
def test_measurements_are_finite(name: str) -> None:
    assert rows(name)
    for row in rows(name):
        for column, value in row.items():
            finite = not isinstance(value, float) or math.isfinite(value)
            assert finite, f"{column} = {value}"


@pytest.mark.parametrize("name", SMALLEST)
def test_table_figure_and_finding_work_on_few_rows(name: str) -> None:
    chosen = study(name)
    assert markdown(chosen.table(rows(name))).count("\n") >= 2
    figure = chosen.plot(rows(name))
    figure.canvas.draw()
    for axes in figure.axes:
        assert axes.get_ylabel() or not axes.get_xlabel()
    text = chosen.finding(rows(name))
    assert len(text) > 50 and "nan" not in text


def test_bridges_connect_what_the_samples_leave_apart() -> None:
    for row in rows("sampling"):
        assert row["connected_before_percent"] <= row["connected_percent"] == 100.0
        assert row["product_nodes"] == 5 * row["nodes"]
    assert rows("sampling")[0]["connected_before_percent"] < 100.0


def test_corner_nodes_shorten_the_paths() -> None:
    plain, corners, _ = rows("tuning")
    assert 0 < corners["excess_percent"] < plain["excess_percent"]
    means = {(0.4, 0.5, 0.2): 3.0, (0.6, 0.5, 0.2): 2.0, (0.6, 1.0, 0.2): 1.0}
    assert sweep(means, "d_opt") == ([0.4, 0.6], [3.0, 2.0])


def test_more_clusters_are_tighter() -> None:
    by_mission: dict[int, list[float]] = {}
    for row in rows("clusters"):
        by_mission.setdefault(row["tasks"], []).append(row["spread_m2"])
    for spreads in by_mission.values():
        assert spreads == sorted(spreads, reverse=True)
    ready = scene(9, 4, -1)
    assert spread(pose(ready, State.of(ready.mission)), 9) == 0.0


def test_the_program_that_hits_its_limit_is_marked_and_ends_its_case() -> None:
    chosen = study("selection")
    found = chosen.measure(method="milp", capacities=(1, 4, 5), seed=0, limit=0.02)
    assert found[-1]["hit_limit"] and not found[-1]["proven"]
    assert not any(row["hit_limit"] for row in found[:-1])
    assert "the limit of 0.02 s" in chosen.finding([*rows("selection"), *found])
    assert " over 0.02 s" in markdown(chosen.table(found))
    chosen.plot([*rows("selection"), *found])


def test_the_program_agrees_with_the_dynamic_program() -> None:
    chosen = study("selection")
    (ours,) = chosen.measure(method="dp", capacities=(2,), seed=0)
    (theirs,) = chosen.measure(method="milp", capacities=(2,), seed=0, limit=60.0)
    assert ours["proven"] and theirs["proven"] and not theirs["hit_limit"]
    assert ours["shortest_m"] == ours["length_m"] > 0


def test_the_direct_automaton_is_as_small_as_the_translated_one() -> None:
    for row in rows("automaton"):
        assert row["states"] == row["general_states"] == row["stops"] + 1
        assert row["product_nodes"] == row["states"] * row["nodes"]


def test_exact_lengths_go_round_the_end_of_a_wall() -> None:
    """Known answer: two tangents and an arc around the wall's round end."""
    hall = Map(bounds=(0, 0, 8, 8), walls=(((4, 0), (4, 4)),), wall_thickness=0.2)
    stops = np.array([[2.0, 2.0], [6.0, 2.0], [2.0, 6.0]])
    lengths = exact_lengths(hall, stops, Mode(Motion(name="ground"), 0.2))
    radius, away = 0.3, math.hypot(2.0, 2.0)
    tangent = math.sqrt(away**2 - radius**2)
    turn = 2 * math.pi - math.pi / 2 - 2 * math.acos(radius / away)
    turn = turn - math.pi if turn > math.pi else turn
    expected = 2 * tangent + radius * turn
    assert lengths[0, 1] == pytest.approx(expected, rel=0.005)
    assert lengths[0, 1] >= 2 * tangent
    assert lengths[0, 2] == pytest.approx(4.0)
    assert np.allclose(lengths, lengths.T)
