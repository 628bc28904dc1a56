"""Where robots were lately: a file of its own that may be lost.

What happened is in the journal; this only keeps what a server would like to show again after it was
started anew, such as where a robot was seen last. It is written without waiting for the disk, and a
file that cannot be read is begun anew.
"""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

_TABLES = (
    "CREATE TABLE IF NOT EXISTS poses (t REAL NOT NULL, poses TEXT NOT NULL)",
    "CREATE INDEX IF NOT EXISTS by_time ON poses (t)",
)


@dataclass(frozen=True, slots=True)
class Seen:
    """Where a robot was at some time.

    Attributes
    ----------
    t
        Mission clock [s].
    x, y
        Position [m; world frame].
    heading
        [rad, from the x axis].
    """

    t: float
    x: float
    y: float
    heading: float


class Telemetry:
    """Keeps poses for some time.

    Nothing here raises because of the file: poses that cannot be written are dropped.

    Parameters
    ----------
    path
        The file; anything that is no telemetry is replaced.
    keep
        For how long poses are kept [s, mission clock].
    """

    def __init__(self, path: str | Path, *, keep: float = 600.0) -> None:
        self._path, self._keep = Path(path), keep
        self._swept = -math.inf
        self._db: sqlite3.Connection | None = None
        with suppress(sqlite3.Error, OSError):
            self._db = self._opened()

    def _opened(self) -> sqlite3.Connection:
        try:
            return self._prepared()
        except sqlite3.Error:
            for end in ("", "-wal", "-shm", "-journal"):
                Path(f"{self._path}{end}").unlink(missing_ok=True)
            return self._prepared()

    def _prepared(self) -> sqlite3.Connection:
        db = sqlite3.connect(self._path, isolation_level=None, check_same_thread=False, timeout=0)
        try:
            db.execute("PRAGMA synchronous = OFF")
            db.execute("PRAGMA journal_mode = MEMORY")
            for table in _TABLES:
                db.execute(table)
            db.execute("SELECT t, poses FROM poses LIMIT 1").fetchall()
        except sqlite3.Error:
            db.close()
            raise
        return db

    def write(self, t: float, poses: Mapping[str, tuple[float, float, float]]) -> None:
        """Keep where all robots are (x, y [m], heading [rad]) at a time [s]."""
        if self._db is None or not poses:
            return
        with suppress(sqlite3.Error):
            self._db.execute("INSERT INTO poses VALUES (?, ?)", (t, json.dumps(poses)))
            if t - self._swept > self._keep / 10:
                self._swept = t
                self._db.execute("DELETE FROM poses WHERE t < ?", (t - self._keep,))

    def between(self, begin: float, end: float) -> list[tuple[float, dict[str, Seen]]]:
        """Return where robots were from one time to another [s], in order."""
        return self._read("WHERE t BETWEEN ? AND ? ORDER BY t", (begin, end))

    def last(self) -> dict[str, Seen]:
        """Return what was written last."""
        found = self._read("ORDER BY t DESC LIMIT 1", ())
        return found[0][1] if found else {}

    def _read(self, which: str, values: tuple[float, ...]) -> list[tuple[float, dict[str, Seen]]]:
        if self._db is None:
            return []
        try:
            rows = self._db.execute(f"SELECT t, poses FROM poses {which}", values).fetchall()
            return [
                (t, {robot: Seen(t, *pose) for robot, pose in json.loads(poses).items()})
                for t, poses in rows
            ]
        except (sqlite3.Error, ValueError, TypeError, AttributeError):
            return []

    def close(self) -> None:
        """Let go of the file."""
        if self._db is not None:
            with suppress(sqlite3.Error):
                self._db.close()
            self._db = None
