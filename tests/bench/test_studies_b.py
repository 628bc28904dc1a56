"""The studies of whole allocations: small cases give sound rows, and what is made of them works."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oath
from oath.allocate import ALLOCATORS, Budget, Problem
from oath.bench import Row, Study, endtoend, markdown, optimality, study
from oath.bench.paper import FIVE_CAPABILITIES, TASK_SETS, maze, random_maze
from oath.model import Assignment, Mission

MISSIONS = Path(__file__).parents[2] / "missions"

SMALL: dict[str, list[dict[str, Any]]] = {
    "types": [{"kind": "the paper's", "types": 2, "seed": 0}],
    "efficiency": [
        {"swept": swept, "value": value, "seed": 0, "repeats": 1}
        for swept, values in (("P", (10, 15)), ("R", (2, 4)), ("Q", (1, 2)))
        for value in values
    ],
    "endtoend": [
        {"kind": endtoend.OWN, "tasks": 10, "seed": 0},
        {"kind": endtoend.DRAWN, "tasks": 10, "seed": 0},
    ],
    "optimality": [
        {"variant": variant, "placement": placement, "tasks": 9, "seed": 0, "limit": 0.2}
        for placement in (optimality.OWN, optimality.DRAWN)
        for variant in (optimality.LITERAL, optimality.SINGLE)
    ],
    "scaling": [{"tasks": 25, "robots": 4, "seed": 0, "long": False}],
}
MAY_BE_MISSING = {"bound", "steps"}


@pytest.fixture(scope="module")
def measured() -> dict[str, list[Row]]:
    return {
        name: [row for case in cases for row in study(name).measure(**case)]
        for name, cases in SMALL.items()
    }


@pytest.mark.parametrize("name", SMALL)
def test_cases_are_sensible(name: str) -> None:
    chosen: Study = study(name)
    assert chosen.name == name
    quick, full = chosen.cases(True, 5), chosen.cases(False, 5)
    for cases in (quick, full):
        assert len({case.key for case in cases}) == len(cases) > 0
    assert len(quick) < len(full) or name == "scaling"
    for wanted in SMALL[name]:
        assert wanted.keys() == quick[0].arguments.keys()


@pytest.mark.parametrize("name", SMALL)
def test_rows_are_finite(name: str, measured: dict[str, list[Row]]) -> None:
    rows = measured[name]
    assert {"oath", "lns"} <= {row["method"].split()[0] for row in rows}
    for row in rows:
        for column, value in row.items():
            assert value is not None or column in MAY_BE_MISSING, column
            if isinstance(value, float):
                assert math.isfinite(value) and value >= 0, column


@pytest.mark.parametrize("name", SMALL)
def test_rows_are_told(name: str, measured: dict[str, list[Row]], tmp_path: Path) -> None:
    chosen, rows = study(name), measured[name]
    assert len(markdown(chosen.table(rows)).splitlines()) > 2
    assert "nan" not in chosen.finding(rows)
    chosen.plot(rows).savefig(tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 10_000


def test_a_finding_follows_its_rows(measured: dict[str, list[Row]]) -> None:
    """The claim of the least distance falls with the first row that speaks against it."""
    rows = [dict(row) for row in measured["endtoend"]]
    assert "LNS has the least total distance on all 2 rows" in endtoend.finding(rows)
    for row in rows:
        if row["method"] == "lns":
            row["distance"] *= 10
    assert "LNS has the least total distance on 0 of 2 rows" in endtoend.finding(rows)


def test_gaps_are_over_the_proven_optimum() -> None:
    base = {"variant": "literal", "placement": optimality.OWN, "tasks": 9, "seed": 0}
    base |= {"unassigned": 0, "over": 0}
    rows = [
        base | {"method": "oath", "distance": 12.0, "proven": False},
        base | {"method": "exact", "distance": 10.0, "proven": True},
        base | {"method": "kam", "distance": 8.0, "proven": False, "unassigned": 1},
    ]
    gaps = [row["gap"] for row in optimality.with_gaps(rows)]
    assert gaps[:2] == [pytest.approx(0.2), 0.0]
    assert gaps[2] is None, "a task was left, so it is no solution"


def test_the_papers_gaps() -> None:
    assert optimality.papers_gaps()[0] == pytest.approx(0.314, abs=5e-4)


def test_a_violation_stops_the_study(monkeypatch: pytest.MonkeyPatch) -> None:
    def lazy(problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        routes: dict[str, Any] = dict.fromkeys(problem.robots, ())
        return Assignment(routes=routes, unassigned=dict.fromkeys(problem.tasks, "no"))

    class Lazy:
        reconsiders = False
        allocate = staticmethod(lazy)

    monkeypatch.setitem(ALLOCATORS, "lns", Lazy)
    with pytest.raises(RuntimeError, match="maze-10, allocator lns, seed 0"):
        endtoend.measure(endtoend.OWN, 10, 0)


def test_growth_is_the_slope() -> None:
    from oath.bench.efficiency import growth

    rows: list[Row] = [
        {"method": "oath", "swept": "P", "value": p, "all_seconds": 0.5 + 0.01 * p}
        for p in (10, 20, 30)
    ]
    assert growth(rows, "oath", "P", "all_seconds") == pytest.approx(0.01)
    assert math.isnan(growth(rows, "oath", "Q", "all_seconds"))


@pytest.mark.parametrize("tasks", sorted(TASK_SETS))
def test_the_maze_is_the_shipped_one(tasks: int) -> None:
    _same(maze(TASK_SETS[tasks]), oath.load(MISSIONS / f"maze-{tasks:02}.yaml"))


def test_the_five_types_are_the_shipped_ones() -> None:
    made = maze(five_types=True)
    _same(made, oath.load(MISSIONS / "maze-25-five-types.yaml"))
    for robot, row in FIVE_CAPABILITIES.items():
        assert {f"type{i + 1}" for i, able in enumerate(row) if able} == made.robot(
            robot
        ).can.keys()


def _same(made: Mission, shipped: Mission) -> None:
    assert made.map == shipped.map
    assert made.places == shipped.places
    assert set(made.task_types) == set(shipped.task_types)
    assert made.robots == shipped.robots
    assert {t.id: (t.type, t.stops) for t in made.tasks} == {
        t.id: (t.type, t.stops) for t in shipped.tasks
    }


@pytest.mark.parametrize("types", [2, 3, 5])
def test_every_type_of_a_random_maze_finds_a_robot(types: int) -> None:
    for seed in range(5):
        mission = random_maze(12, types=types, seed=seed)
        assert mission == random_maze(12, types=types, seed=seed)
        able = {name for robot in mission.robots for name in robot.can}
        assert set(mission.task_types) <= able
