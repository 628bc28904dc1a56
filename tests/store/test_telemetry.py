"""Telemetry is kept for a while, and losing it does not matter."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from oath.store.telemetry import Seen, Telemetry


def test_the_last_poses_are_known_after_a_restart(tmp_path: Path) -> None:
    path = tmp_path / "a.telemetry"
    with closing(Telemetry(path)) as telemetry:
        assert telemetry.last() == {}
        telemetry.write(0.0, {"r1": (1.0, 2.0, 0.5), "r2": (3.0, 4.0, 0.0)})
        telemetry.write(0.1, {"r1": (1.1, 2.0, 0.5), "r2": (3.0, 4.0, 0.0)})
    with closing(Telemetry(path)) as telemetry:
        assert telemetry.last() == {"r1": Seen(0.1, 1.1, 2.0, 0.5), "r2": Seen(0.1, 3.0, 4.0, 0.0)}


def test_poses_are_kept_for_some_time_only(tmp_path: Path) -> None:
    with closing(Telemetry(tmp_path / "a.telemetry", keep=10.0)) as telemetry:
        for tick in range(1000):
            telemetry.write(tick / 10, {"r": (float(tick), 0.0, 0.0)})
        times = [t for t, _ in telemetry.between(0.0, 1000.0)]
        assert times == sorted(times)
        assert times[-1] == 99.9
        assert 10.0 <= times[-1] - times[0] <= 12.0
        assert [t for t, _ in telemetry.between(95.0, 95.3)] == [95.0, 95.1, 95.2, 95.3]


@pytest.mark.parametrize("content", [b"", b"nonsense" * 100, b"SQLite format 3\0" + b"\xff" * 200])
def test_what_is_no_telemetry_is_begun_anew(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.telemetry"
    path.write_bytes(content)
    with closing(Telemetry(path)) as telemetry:
        assert telemetry.last() == {}
        telemetry.write(1.0, {"r": (1.0, 2.0, 3.0)})
        assert telemetry.last() == {"r": Seen(1.0, 1.0, 2.0, 3.0)}


def test_any_damage_is_survived(tmp_path: Path) -> None:
    path = tmp_path / "a.telemetry"
    with closing(Telemetry(path)) as telemetry:
        for tick in range(300):
            telemetry.write(float(tick), {"r": (1.0, 2.0, 3.0)})
    whole = path.read_bytes()
    for cut in range(0, len(whole), 997):
        path.write_bytes(whole[:cut] + bytes(50) + whole[cut + 50 :])
        with closing(Telemetry(path)) as telemetry:
            telemetry.last()
            telemetry.write(400.0, {"r": (1.0, 2.0, 3.0)})
            telemetry.between(0.0, 500.0)


@pytest.mark.parametrize("row", ["[]", "{", '{"r": 5}', '{"r": [1]}'])
def test_rows_that_nobody_wrote(tmp_path: Path, row: str) -> None:
    path = tmp_path / "a.telemetry"
    Telemetry(path).close()
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("INSERT INTO poses VALUES (0.0, ?)", (row,))
    with closing(Telemetry(path)) as telemetry:
        assert telemetry.last() == {}


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path: Path) -> None:
    with closing(Telemetry(tmp_path / "none" / "a.telemetry")) as telemetry:
        telemetry.write(0.0, {"r": (1.0, 2.0, 3.0)})
        assert telemetry.last() == {}
    telemetry.write(0.0, {"r": (1.0, 2.0, 3.0)})
    telemetry.close()
    with closing(Telemetry(tmp_path)) as folder:
        assert folder.last() == {}


def test_two_servers_do_not_wait_for_each_other(tmp_path: Path) -> None:
    path = tmp_path / "a.telemetry"
    with closing(Telemetry(path)) as one, closing(Telemetry(path)) as other:
        one.write(0.0, {"r": (1.0, 2.0, 3.0)})
        other.write(0.1, {"r": (1.0, 2.0, 4.0)})
        assert one.last() == other.last() == {"r": Seen(0.1, 1.0, 2.0, 4.0)}
