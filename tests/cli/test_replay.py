"""The program on journals: any moment is rebuilt, exported and recorded."""

from __future__ import annotations

import json
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from mcap.reader import make_reader

import oath
from oath.cli import main
from oath.dispatch import advance
from oath.formats import event_log
from oath.store import Origin
from oath.store.sqlite import SqliteJournal

MAZE = "missions/maze-25-gates.yaml"


def oath_(*args: object) -> Result:
    return CliRunner().invoke(main, [str(arg) for arg in args])


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, object]:
    """The journal of a whole mission, and the runtime that wrote it."""
    path = tmp_path_factory.mktemp("journal") / "maze.journal"
    origin = Origin.of(MAZE, allocator="lns", seed=1, points=300)
    with closing(SqliteJournal.create(path, origin)) as journal:
        runtime = oath.prepare(
            origin.mission(), seed=1, points=300, on_event=lambda event: journal.append([event])
        )
        runtime.run()
    return path, runtime


@pytest.fixture
def journal(ran: tuple[Path, object]) -> Path:
    return ran[0]


def plain(path: Path, *options: object) -> dict[str, object]:
    done = oath_("replay", path, "--json", *options)
    assert done.exit_code == 0, done.output
    found: dict[str, object] = json.loads(done.stdout)
    return found


def test_a_replay_is_the_state_that_the_run_ended_in(ran: tuple[Path, object]) -> None:
    from oath.store import replayed
    from oath.store.sqlite import read

    path, runtime = ran
    stored = read(path)
    mission = stored.origin.mission()
    once, again = (replayed(stored.origin.state(mission), stored.events) for _ in range(2))
    assert once == again == runtime.state  # type: ignore[attr-defined]
    half = len(stored.events) // 2
    first = replayed(stored.origin.state(mission), stored.events[:half])
    assert replayed(first, stored.events[half:]) == once


def test_the_end_of_a_mission_in_words(journal: Path) -> None:
    done = oath_("replay", journal)
    assert done.exit_code == 0
    first, *rest = done.stdout.splitlines()
    assert first.startswith("maze-25-gates at ")
    assert first.endswith("finished: 25 of 25 tasks done")
    assert sum(line.startswith("  robot") and line.endswith(": idle") for line in rest) == 4
    assert rest[-1].startswith("  obstacles: ")


def test_every_moment_is_that_of_the_events_until_then(journal: Path) -> None:
    from oath.store.sqlite import read

    stored = read(journal)
    state = stored.origin.state(stored.origin.mission())
    for seq, event in enumerate(stored.events):
        state, _ = advance(state, event)
        if seq % 40 == 7:
            report = plain(journal, "--seq", seq)
            assert (report["t"], report["events"]) == (state.t, seq + 1)
            for id, robot in state.robots.items():
                told = report["robots"][id]  # type: ignore[index]
                assert tuple(told["at"]) == robot.position
                assert tuple(told["carrying"]) == robot.carrying
            done = {id for id, task in report["tasks"].items() if task["status"] == "done"}  # type: ignore[attr-defined]
            assert done == state.completed
            assert set(report["obstacles"]) == set(state.obstacles)  # type: ignore[call-overload]


def test_a_moment_by_its_time(journal: Path) -> None:
    report = plain(journal, "--at", "20", "--events")
    log = report["log"]
    assert isinstance(log, list)
    assert len(log) == report["events"]
    assert log[-1]["t"] <= 20.0
    assert not report["finished"]
    before = plain(journal, "--at", "-1")
    assert (before["t"], before["events"]) == (0.0, 0)
    assert {task["status"] for task in before["tasks"].values()} == {"waiting"}  # type: ignore[attr-defined]


def test_words_about_the_middle_of_a_mission(journal: Path) -> None:
    done = oath_("replay", journal, "--at", "20", "--events")
    lines = done.stdout.splitlines()
    assert json.loads(lines[0])["type"] == "mission_started"
    words = lines[lines.index(next(line for line in lines if line.startswith("maze-25"))) :]
    assert any(": working, " in line for line in words)
    assert any(line.startswith("  assigned: ") for line in words)


def test_an_exported_log_is_accepted_by_the_judge(journal: Path, tmp_path: Path) -> None:
    out = tmp_path / "events.jsonl"
    assert oath_("replay", journal, "--out", out).exit_code == 0
    done = oath_("verify", MAZE, out)
    assert (done.exit_code, done.stdout.split(":")[0]) == (0, "ok")
    assert len(event_log.read(out)) == plain(journal)["events"]


def test_bad_questions(journal: Path, tmp_path: Path) -> None:
    for args, problem in (
        (["--seq", "9999"], "there is no event 9999; the last one is "),
        (["--seq", "1", "--at", "2"], "give --seq or --at, not both"),
        (["--seq", "-1"], "-1"),
    ):
        done = oath_("replay", journal, *args)
        assert done.exit_code == 2
        assert problem in done.stderr
    for path in (tmp_path / "none.journal", MAZE, tmp_path):
        for command in (["replay", path], ["record", path, tmp_path / "a.mcap"]):
            done = oath_(*command)
            assert done.exit_code == 2
            assert str(path) in done.stderr
    assert not (tmp_path / "a.mcap").exists()


def test_what_is_whole_of_a_damaged_journal_is_exported(journal: Path, tmp_path: Path) -> None:
    path = tmp_path / "damaged.journal"
    path.write_bytes(journal.read_bytes())
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("DELETE FROM events WHERE seq = 100")
    done = oath_("replay", path)
    assert done.exit_code == 2
    assert "event 100 is missing; restore it from a copy; events 0 to 99 are whole" in done.stderr
    assert oath_("replay", path, "--seq", "99", "--out", tmp_path / "e.jsonl").exit_code == 0
    assert len(event_log.read(tmp_path / "e.jsonl")) == 100


def test_an_empty_journal(tmp_path: Path) -> None:
    path = tmp_path / "new.journal"
    SqliteJournal.create(path, Origin.of(MAZE, allocator="lns")).close()
    assert oath_("replay", path).stdout.startswith(
        "maze-25-gates at 0.0 s, after 0 events: 0 of 25"
    )
    assert "it holds no event yet" in oath_("replay", path, "--seq", "0").stderr
    assert oath_("record", path, tmp_path / "new.mcap").exit_code == 0


def test_a_journal_becomes_a_recording(journal: Path, tmp_path: Path) -> None:
    file = tmp_path / "maze.mcap"
    done = oath_("record", journal, file)
    assert done.exit_code == 0
    assert done.stdout.endswith(f"see {file}\n")
    with file.open("rb") as stream:
        count = sum(1 for _ in make_reader(stream).iter_messages(topics="/events"))
    assert count == plain(journal)["events"]
    again = oath_("record", journal, file)
    assert again.exit_code == 2
    assert "exists already; name another file" in again.stderr


def test_a_run_is_recorded(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    done = oath_("run", "missions/maze-09.yaml", "--points", 300, "--record", file)
    assert done.exit_code == 0
    with file.open("rb") as stream:
        assert make_reader(stream).get_summary() is not None
    again = oath_("run", "missions/maze-09.yaml", "--points", 300, "--record", file)
    assert again.exit_code == 2
    nowhere = oath_("run", MAZE, "--points", 300, "--record", tmp_path / "none" / "a.mcap")
    assert nowhere.exit_code == 2
    assert "cannot be written" in nowhere.stderr


def test_recording_without_its_package(
    journal: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "foxglove", None)
    done = oath_("record", journal, tmp_path / "a.mcap")
    assert done.exit_code == 2
    assert "recordings need foxglove-sdk; pip install 'oath-fleet[record]'" in done.stderr
