"""The studies of instructions: small cases give sound rows, and what is made of them works."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from oath.bench import Row, instructions, latency, markdown, study
from oath.commands import Live
from oath.instruct import Dialogue, Reply


class Deaf:
    """Understands nothing, quickly."""

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        return Reply(status="clarification", message="What?")


@pytest.fixture(scope="module")
def measured() -> dict[str, list[Row]]:
    told = [row for kind in instructions.KINDS for row in instructions.measure(kind, 20.0, 1)]
    timed = latency.updates(0)
    timed += latency.interpretations(Deaf, latency.started(0).live(), 0)
    return {"instructions": told, "latency": timed}


STUDIES = pytest.mark.parametrize("name", ["instructions", "latency"])


@STUDIES
def test_cases_are_sensible(name: str) -> None:
    chosen = study(name)
    assert chosen.name == name
    quick, full = chosen.cases(True, 5), chosen.cases(False, 5)
    for cases in (quick, full):
        assert len({case.key for case in cases}) == len(cases) > 0
    assert {case.key for case in quick} < {case.key for case in full}


def test_every_kind_is_told_at_five_times_with_every_seed() -> None:
    cases = instructions.cases(False, 5)
    assert len(cases) == 3 * 5 * 5
    assert latency.STUDY.timed


@STUDIES
def test_rows_are_told(name: str, measured: dict[str, list[Row]], tmp_path: Path) -> None:
    chosen, rows = study(name), measured[name]
    for row in rows:
        for column, value in row.items():
            assert value is not None or column == "wait"
            if isinstance(value, float):
                assert math.isfinite(value) and value >= 0, column
    assert len(markdown(chosen.table(rows)).splitlines()) > 2
    assert "nan" not in chosen.finding(rows) and "not measured" not in chosen.finding(rows)
    chosen.plot(rows).savefig(tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 10_000


def test_every_method_is_told_the_same(measured: dict[str, list[Row]]) -> None:
    for kind in instructions.KINDS:
        rows = [row for row in measured["instructions"] if row["kind"] == kind]
        assert [row["method"] for row in rows] == list(instructions.METHODS)
        assert all((row["wait"] is None) == (kind == "obstacle") for row in rows)


def test_the_gate_that_is_told_is_the_one_to_be_found() -> None:
    mission = instructions._hidden(instructions.maze(), 3)
    (gate,) = mission.map.obstacles
    (x0, y), (x1, _) = instructions.closed_gate(3)
    assert not gate.known
    assert {corner[0] for corner in gate.polygon} == {x0, x1}
    assert all(abs(corner[1] - y) == pytest.approx(0.1) for corner in gate.polygon)


def test_a_violation_stops_the_study(monkeypatch: pytest.MonkeyPatch) -> None:
    def harsh(*_: Any) -> Any:
        from oath.verify import Verdict, Violation

        fault = Violation(rule="wall", message="on purpose")
        return Verdict(violations=(fault,), checked={}, separation=None)

    monkeypatch.setattr("oath.verify.verify", harsh)
    with pytest.raises(RuntimeError, match=r"priority at 5\.0 s, seed 0, waits"):
        instructions.measure("priority", 5.0, 0)


def test_percentiles_are_of_the_calls_of_one_intent() -> None:
    rows: list[Row] = [
        {"intent": "undo", "part": "update", "seed": 0, "ms": float(ms)} for ms in range(101)
    ]
    (line,) = latency.table(rows)
    assert (line["calls"], line["p50 [ms]"], line["p95 [ms]"]) == (101, 50.0, 95.0)
