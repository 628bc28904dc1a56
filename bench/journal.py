"""What the journal costs: an acknowledged event, and a start on a long journal.

Run with ``python bench/journal.py [--events 100000] [--folder DIR]``, DIR on a real disk. Ratios
are to plain SQLite: the same rows, each in a synced transaction of its own and in turns with the
journal's, and one select of all of them; so that two machines, or a busy and an idle one, can be
compared.
"""

from __future__ import annotations

import argparse
import random
import sqlite3
import statistics
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import oath
from oath.events import AnyEvent, Moved
from oath.formats.event_log import to_line
from oath.store import Origin, replayed
from oath.store.sqlite import SqliteJournal

T = TypeVar("T")
MISSION = "missions/maze-25-gates.yaml"


def long_log(count: int) -> list[AnyEvent]:
    """Return a real beginning of a mission, then small moves of its robots."""
    runtime = oath.prepare(oath.load(MISSION), seed=1)
    runtime.start()
    runtime.advance(40.0)
    events, rng = list(runtime.events), random.Random(1)
    at = {id: robot.position for id, robot in runtime.state.robots.items()}
    t = events[-1].t
    while len(events) < count:
        robot = rng.choice(list(at))
        x, y = at[robot]
        to = (x + rng.uniform(-0.01, 0.01), y + rng.uniform(-0.01, 0.01))
        events.append(Moved(t=t + 0.1, robot=robot, from_=(x, y), to=to, start=t, end=t + 0.1))
        at[robot], t = to, t + 0.1
    return events[:count]


def plain(path: Path) -> sqlite3.Connection:
    """Open a table without anything but the text of events."""
    db = sqlite3.connect(path, isolation_level=None)
    db.execute("PRAGMA journal_mode = WAL")
    db.execute("PRAGMA synchronous = FULL")
    db.execute("CREATE TABLE events (seq INTEGER PRIMARY KEY, data TEXT NOT NULL)")
    return db


@dataclass(frozen=True)
class Seconds:
    """How long something took, and for how long a processor worked on it [s]."""

    wall: float
    cpu: float

    def __str__(self) -> str:
        return f"{self.wall:.2f} s ({self.cpu:.2f} s of a processor)"

    def __add__(self, other: Seconds) -> Seconds:
        return Seconds(self.wall + other.wall, self.cpu + other.cpu)


def timed(work: Callable[..., T], *args: Any, **options: Any) -> tuple[Seconds, T]:
    """Return how long something takes, and what it returns."""
    wall, cpu = time.perf_counter(), time.process_time()
    value = work(*args, **options)
    return Seconds(time.perf_counter() - wall, time.process_time() - cpu), value


def show(name: str, times: list[float]) -> None:
    """Print the median and the 95th percentile of times [s]."""
    p95 = statistics.quantiles(times, n=20)[-1]
    print(f"{name:28} p50 {statistics.median(times) * 1e3:7.3f} ms   p95 {p95 * 1e3:7.3f} ms")


def appends(folder: Path, origin: Origin, events: list[AnyEvent]) -> None:
    """Time single events, each durable before the next."""
    own, bare = [], []
    lines = [(seq, to_line(seq, event)) for seq, event in enumerate(events)]
    journal = SqliteJournal.create(folder / "appends.journal", origin)
    with closing(journal), closing(plain(folder / "plain.sqlite")) as db:
        for line, event in zip(lines, events, strict=True):
            # In turns, so that both see the same disk.
            bare.append(timed(db.execute, "INSERT INTO events VALUES (?, ?)", line)[0].wall)
            own.append(timed(journal.append, [event], id=f"c{line[0]}", answer=line[0])[0].wall)
    show("plain insert, synced", bare)
    show("command, acknowledged", own)
    ratio = statistics.median(own) / statistics.median(bare)
    print(f"{'ratio of the medians':28} {ratio:.2f}")


def start(folder: Path, origin: Origin, events: list[AnyEvent]) -> None:
    """Time a start: check all of the file, decode, and rebuild the state."""
    path = folder / "start.journal"
    with closing(SqliteJournal.create(path, origin)) as journal:
        journal.append(events)
    with closing(plain(folder / "long.sqlite")) as db:
        db.execute("BEGIN")
        rows = [(seq, to_line(seq, event)) for seq, event in enumerate(events)]
        db.executemany("INSERT INTO events VALUES (?, ?)", rows)
        db.execute("COMMIT")
        bare, _ = timed(lambda: db.execute("SELECT * FROM events ORDER BY seq").fetchall())
    check, opened = timed(SqliteJournal, path)
    with closing(opened):
        decode, decoded = timed(opened.replay)
    fold, _ = timed(replayed, origin.state(origin.mission()), decoded)
    print(f"\nstart on {len(events)} events, {path.stat().st_size / 1e6:.0f} MB")
    print(f"  check    {check}\n  decode   {decode}\n  both     {check + decode}")
    print(f"  rebuild  {fold}")
    print(f"  a plain select takes {bare}: ratio {(check + decode).cpu / bare.cpu:.1f}")


def main() -> None:
    """Print all figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--events", type=int, default=100_000)
    parser.add_argument("--appends", type=int, default=2_000)
    parser.add_argument("--folder", type=Path, help="where to write; a new folder by default")
    given = parser.parse_args()
    origin = Origin.of(MISSION, allocator="lns", seed=1)
    events = long_log(given.events)
    with TemporaryDirectory(dir=given.folder) as folder:
        appends(Path(folder), origin, events[: given.appends])
        start(Path(folder), origin, events)


if __name__ == "__main__":
    main()
