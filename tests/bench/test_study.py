"""The frame of the studies: it goes on where it stopped, and writes what people read."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from oath.bench import STUDIES, Case, Row, Study, markdown, report, run_study, study
from oath.bench.study import shown
from oath.errors import BadInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def square(number: int, note: str = "") -> list[Row]:
    rows: list[Row] = [{"number": number, "square": number**2}]
    if note:
        with Path(note).open("a") as file:
            file.write(f"{number}\n")
        rows[0]["process"] = os.getpid()
    return rows


def figure(rows: Sequence[Row]) -> Figure:
    from matplotlib.figure import Figure

    drawn = Figure()
    drawn.subplots().plot([row["number"] for row in rows], [row["square"] for row in rows])
    return drawn


def toy(note: str = "", numbers: Sequence[int] = (1, 2, 3), *, timed: bool = True) -> Study:
    return Study(
        name="toy",
        title="Squares",
        asked="What are they?",
        paper="It says nothing.",
        cases=lambda quick, seeds: [
            Case(str(n), {"number": n, "note": note}) for n in numbers[: 1 if quick else None]
        ],
        measure=square,
        table=lambda rows: [{"n": row["number"], "n^2": float(row["square"])} for row in rows],
        plot=figure,
        finding=lambda rows: f"The largest is {max(row['square'] for row in rows)}.",
        timed=timed,
    )


def notes(path: Path) -> list[int]:
    return [int(line) for line in path.read_text().split()]


def test_a_run_leaves_rows_table_figure_and_finding(tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    outcome = run_study(
        toy(),
        tmp_path / "new" / "folder",
        on_progress=lambda done, total: seen.append((done, total)),
    )
    assert outcome.finding == "The largest is 9."
    assert outcome.table[-1] == {"n": 3, "n^2": 9.0}
    with outcome.csv.open() as file:
        assert list(csv.DictReader(file))[1] == {"number": "2", "square": "4"}
    assert outcome.png.read_bytes().startswith(b"\x89PNG")
    assert seen == [(0, 3), (1, 3), (2, 3), (3, 3)]


def test_quick_and_whole_share_what_is_finished(tmp_path: Path) -> None:
    note = tmp_path / "note"
    run_study(toy(str(note)), tmp_path, quick=True)
    assert notes(note) == [1]
    run_study(toy(str(note)), tmp_path)
    assert notes(note) == [1, 2, 3]
    run_study(toy(str(note)), tmp_path)
    assert notes(note) == [1, 2, 3]


@pytest.mark.parametrize("cut", [2, 12, 25])
def test_a_last_line_that_was_cut_off_is_measured_again(tmp_path: Path, cut: int) -> None:
    note, journal = tmp_path / "note", tmp_path / "toy.jsonl"
    whole = run_study(toy(str(note)), tmp_path)
    text = journal.read_text()
    journal.write_text(text[:-cut])
    again = run_study(toy(str(note)), tmp_path)
    assert notes(note) == [1, 2, 3, 3]
    assert again.table == whole.table
    lines = journal.read_text().splitlines()
    assert [json.loads(line)["case"] for line in lines] == ["1", "2", "3"]


def test_an_interrupted_run_keeps_what_was_measured(tmp_path: Path) -> None:
    def stop(number: int, note: str) -> list[Row]:
        if number == 3:
            raise KeyboardInterrupt
        return square(number, note)

    note = tmp_path / "note"
    with pytest.raises(KeyboardInterrupt):
        run_study(replace(toy(str(note)), measure=stop), tmp_path)
    run_study(toy(str(note)), tmp_path)
    assert notes(note) == [1, 2, 3]


def test_cases_are_told_apart_by_their_keys_and_keep_their_order(tmp_path: Path) -> None:
    run_study(toy(numbers=(2, 5)), tmp_path)
    assert [row["n"] for row in run_study(toy(numbers=(5, 4, 2)), tmp_path).table] == [5, 4, 2]


def test_what_is_not_timed_runs_in_other_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    outcome = run_study(toy(str(tmp_path / "note"), timed=False), tmp_path)
    with outcome.csv.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["square"] for row in rows] == ["1", "4", "9"]
    assert str(os.getpid()) not in {row["process"] for row in rows}


def test_a_table_in_markdown() -> None:
    text = markdown([{"name": "a", "share": 0.123456}, {"name": "b", "more": True}])
    assert text.splitlines() == [
        "| name | share | more |",
        "|---|---|---|",
        "| a | 0.1235 | – |",
        "| b | – | yes |",
    ]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (float("nan"), "–"),
        (False, "no"),
        (12345.6, "12346"),
        (7, "7"),
        (1e-7, "1e-07"),
    ],
)
def test_what_a_cell_shows(value: object, text: str) -> None:
    assert shown(value) == text


def test_the_report_holds_question_paper_answer_table_and_figure(tmp_path: Path) -> None:
    outcome = run_study(toy(), tmp_path)
    path = tmp_path / "report.md"
    report([outcome], path, command="oath bench all")
    text = path.read_text()
    for part in ("Squares", "What are they?", "It says nothing.", outcome.finding, "(toy.png)"):
        assert part in text
    assert markdown(outcome.table) in text and "oath bench all" in text
    assert not list(tmp_path.glob("*.part"))


def test_an_unknown_study_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(BadInput, match="unknown study 'smapling'; did you mean 'sampling'"):
        study("smapling")
    assert "sampling" in STUDIES
