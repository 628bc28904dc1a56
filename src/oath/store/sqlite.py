"""The journal in one SQLite file.

Tables: `origin` and `files` hold how the mission began, `events` one event a row, `commands` the
ids of commands with their answers. Each row of `events` carries the SHA-256 of the row before it
and its own text; the first one that of the origin. The file is in WAL mode and every append is
synced to the disk before it returns; a journal that was closed is one plain file.
"""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, fields
from pathlib import Path
from threading import Lock
from typing import Any

from pydantic_core import from_json

from oath.errors import BadInput, StoreError
from oath.events import AnyEvent
from oath.formats.event_log import rebuilt, to_line
from oath.store import Answer, Origin
from oath.store.versions import UPCASTERS, Upcasters, current, upcast

APPLICATION = int.from_bytes(b"OATH")
"""SQLite's application id of a journal."""
SCHEMA = 1
"""SQLite's user version of a journal: which tables it has."""

_TABLES = (
    "CREATE TABLE origin (settings TEXT NOT NULL)",
    "CREATE TABLE files (name TEXT NOT NULL, data BLOB NOT NULL)",
    "CREATE TABLE events (seq INTEGER PRIMARY KEY, t REAL NOT NULL, type TEXT NOT NULL, "
    "version INTEGER NOT NULL, data TEXT NOT NULL, hash BLOB NOT NULL)",
    "CREATE TABLE commands (id TEXT PRIMARY KEY, first INTEGER NOT NULL, count INTEGER NOT NULL, "
    "answer TEXT NOT NULL) WITHOUT ROWID",
)
_ROWS = (
    "SELECT seq, t, type, version, data, hash FROM events WHERE seq BETWEEN ? AND ? ORDER BY seq"
)
_DATA = "SELECT seq, version, data FROM events WHERE seq BETWEEN ? AND ? ORDER BY seq"
_END = 2**63 - 1
_SETTINGS = tuple(field.name for field in fields(Origin) if field.name != "files")


@dataclass(frozen=True, slots=True)
class Stored:
    """What a journal holds: how the mission began, and its events."""

    origin: Origin
    events: list[AnyEvent]


class SqliteJournal:
    """A journal in a file that this process owns until `close`: see `oath.store.Journal`.

    It may be used from several threads. Others may `read` the file meanwhile, but not own it.

    Attributes
    ----------
    origin
        How the mission began.
    """

    def __init__(self, path: str | Path, *, upcasters: Upcasters = UPCASTERS) -> None:
        """Open a journal that exists, after checking all of it.

        Raises
        ------
        BadInput
            If there is none, it is damaged, or another process owns it; nothing is changed then.
        """
        self.path, self._upcasters = Path(path), upcasters
        _require(self.path)
        self._owned = _own(self.path)
        try:
            with _reading(self.path, _alone(self.path)) as db:
                self.origin, begin = _origin(db, self.path)
                self._count, self._hash = _check(db, self.path, begin, upcasters)
            self._db = _writing(self.path)
        except BaseException:
            self._owned.close()
            raise
        self._lock = Lock()

    @classmethod
    def create(cls, path: str | Path, origin: Origin) -> SqliteJournal:
        """Begin a new journal and open it.

        Raises
        ------
        BadInput
            If there is a file of that name.
        StoreError
            If it cannot be written.
        """
        path = Path(path)
        _forbid(path)
        with closing(_own(path)):
            _forbid(path)
            # Under its own name a journal is whole from the beginning.
            draft = path.with_name(path.name + ".part")
            try:
                draft.unlink(missing_ok=True)
                with closing(_connect(draft.absolute().as_uri())) as db:
                    _begin(db, origin)
                os.replace(draft, path)
                _sync_folder(path.parent)
            except (OSError, sqlite3.Error) as error:
                raise StoreError(f"{path}: the journal cannot be created ({error})") from None
        return cls(path)

    def append(
        self, events: Sequence[AnyEvent], *, id: str | None = None, answer: object = None
    ) -> range:
        """Store events that happen together, all or none; return their sequence numbers."""
        with self._lock:
            seqs = range(self._count, self._count + len(events))
            rows, hash = [], self._hash
            for seq, event in zip(seqs, events, strict=True):
                t = float(event.t) + 0.0  # SQLite knows no -0.0
                row = (seq, t, event.type, current(self._upcasters), to_line(seq, event))
                hash = _link(hash, row)
                rows.append((*row, hash))
            text = _as_json(answer)
            if id is not None and self._answer(id) is not None:
                raise BadInput(f"a command with the id {id!r} was carried out already")
            with self._transaction(seqs) as db:
                db.executemany("INSERT INTO events VALUES (?, ?, ?, ?, ?, ?)", rows)
                if id is not None:
                    command = (id, seqs.start, len(seqs), text)
                    db.execute("INSERT INTO commands VALUES (?, ?, ?, ?)", command)
            self._count, self._hash = seqs.stop, hash
            return seqs

    @contextmanager
    def _transaction(self, seqs: range) -> Iterator[sqlite3.Connection]:
        try:
            self._db.execute("BEGIN IMMEDIATE")
            yield self._db
            self._db.execute("COMMIT")
        except BaseException as error:
            with suppress(sqlite3.Error):  # SQLite has rolled back already after some errors
                self._db.execute("ROLLBACK")
            if not isinstance(error, sqlite3.Error):
                raise
            raise StoreError(
                f"{self.path}: event {seqs.start} cannot be stored ({error}), so it has not "
                "happened; make room or repair the disk, then resume the mission"
            ) from None

    def replay(self, since: int = 0) -> list[AnyEvent]:
        """Return the events from a sequence number on."""
        with self._lock, self._asking():
            rows = self._db.execute(_DATA, (since, _END))
            return list(_events(rows, self.path, self._upcasters))

    def known(self, id: str) -> Answer | None:
        """Return what was answered to the command with this id; None if there was none."""
        with self._lock:
            return self._answer(id)

    def _answer(self, id: str) -> Answer | None:
        with self._asking():
            try:
                found = self._db.execute(
                    "SELECT first, count, answer FROM commands WHERE id = ?", (id,)
                ).fetchone()
            except UnicodeEncodeError:
                raise BadInput("the id is no text", field="id", remedy="use plain text") from None
        if found is None:
            return None
        first, count, answer = found
        return Answer(range(first, first + count), json.loads(answer))

    @contextmanager
    def _asking(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: cannot be read ({error})") from None

    def close(self) -> None:
        """Let go of the journal."""
        with self._lock:
            self._db.close()
            self._owned.close()


def read(path: str | Path, *, last: int | None = None, upcasters: Upcasters = UPCASTERS) -> Stored:
    """Read a journal that somebody else may own.

    Parameters
    ----------
    path
        The file.
    last
        Sequence number of the last event to be read; None = all of them. What comes later may be
        damaged.

    Raises
    ------
    BadInput
        If there is none, or it is damaged.
    """
    path = Path(path)
    _require(path)
    with _reading(path, "mode=ro") as db:
        origin, hash = _origin(db, path)
        _check(db, path, hash, upcasters, last)
        rows = db.execute(_DATA, (0, _END if last is None else last))
        return Stored(origin, list(_events(rows, path, upcasters)))


# -- the file


def _connect(uri: str) -> sqlite3.Connection:
    return sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False)


def _begin(db: sqlite3.Connection, origin: Origin) -> None:
    """Make the tables of a new journal."""
    settings = {name: getattr(origin, name) for name in _SETTINGS}
    db.execute("PRAGMA synchronous = FULL")
    db.execute("BEGIN")
    for table in _TABLES:
        db.execute(table)
    db.execute("INSERT INTO origin VALUES (?)", (_as_json(settings),))
    db.executemany("INSERT INTO files VALUES (?, ?)", origin.files.items())
    db.execute(f"PRAGMA application_id = {APPLICATION}")
    db.execute(f"PRAGMA user_version = {SCHEMA}")
    db.execute("COMMIT")
    db.execute("PRAGMA journal_mode = WAL")


def _forbid(path: Path) -> None:
    if path.exists():
        raise BadInput("exists already", file=str(path), remedy="resume it or name another")


def _sync_folder(folder: Path) -> None:
    """Make sure that a file's new name is on the disk."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _own(path: Path) -> sqlite3.Connection:
    """Keep every other process from owning a journal; the system lets go when this one ends."""
    # A file of its own: the journal itself stays open to readers.
    db: sqlite3.Connection | None = None
    try:
        db = _connect(Path(f"{path}.lock").absolute().as_uri())
        db.execute("PRAGMA busy_timeout = 0")
        db.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        if db is not None:
            db.close()
        if error.sqlite_errorcode == sqlite3.SQLITE_BUSY:
            raise BadInput(
                "is in use by another process",
                file=str(path),
                remedy="stop the server that runs this mission first",
            ) from None
        raise BadInput(
            f"cannot be locked ({error})", file=str(path), remedy="check the folder and its rights"
        ) from None
    return db


def _alone(path: Path) -> str:
    """Return how SQLite reads a file that nobody writes: without a trace, if nothing is left over.

    After a crash the file alone need not be whole; SQLite then reads what stands beside it.
    """
    return "mode=ro" if Path(f"{path}-wal").exists() else "immutable=1"


def _require(path: Path) -> None:
    """Refuse what is no journal, without touching it."""
    if not path.is_file():
        raise BadInput("no such file", file=str(path), remedy="check the path")
    try:
        with closing(_connect(f"{path.absolute().as_uri()}?{_alone(path)}")) as db:
            (application,) = db.execute("PRAGMA application_id").fetchone()
            (schema,) = db.execute("PRAGMA user_version").fetchone()
    except sqlite3.Error as error:
        raise BadInput(
            f"is no journal ({error})", file=str(path), remedy="name a journal of oath"
        ) from None
    if application != APPLICATION:
        raise BadInput("is no journal", file=str(path), remedy="name a journal of oath")
    if schema != SCHEMA:
        raise BadInput(
            f"is a journal of version {schema}",
            file=str(path),
            remedy=f"this version of oath reads {SCHEMA}",
        )


@contextmanager
def _reading(path: Path, how: str) -> Iterator[sqlite3.Connection]:
    """Open a journal so that nothing can be changed."""
    try:
        db = _connect(f"{path.absolute().as_uri()}?{how}")
        with closing(db):
            db.execute("BEGIN")  # what others append meanwhile is not seen
            yield db
    except sqlite3.Error as error:
        raise BadInput(
            f"cannot be read ({error})", file=str(path), remedy="restore it from a copy"
        ) from None


def _writing(path: Path) -> sqlite3.Connection:
    """Open a journal to append to it."""
    db = _connect(f"{path.absolute().as_uri()}?mode=rw")
    try:
        db.execute("PRAGMA synchronous = FULL")
        (mode,) = db.execute("PRAGMA journal_mode = WAL").fetchone()
        if mode != "wal":
            raise sqlite3.OperationalError(f"its journal mode stays {mode}")
    except sqlite3.Error as error:
        db.close()
        raise BadInput(
            f"cannot be written ({error})",
            file=str(path),
            remedy="check its rights; keep it on a local disk",
        ) from None
    return db


# -- its content


def _as_json(value: object) -> str:
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise BadInput(f"an answer has no JSON: {error}", remedy="use plain data") from None


def _link(hash: bytes, row: tuple[object, ...]) -> bytes:
    """Return the hash of a row (without its own) that follows the row with this hash."""
    seq, t, type, version, data = row
    text = f"{seq}|{t!r}|{type}|{version}|{data}"
    return hashlib.sha256(hash + text.encode()).digest()


def _origin(db: sqlite3.Connection, path: Path) -> tuple[Origin, bytes]:
    """Return how the mission began, and the hash that the first event follows."""
    try:
        ((settings,),) = db.execute("SELECT settings FROM origin")
        files = dict(db.execute("SELECT name, data FROM files ORDER BY rowid"))
        origin = Origin(files=files, **json.loads(settings))
    except (TypeError, ValueError) as error:
        raise _damaged(path, 0, f"how the mission began cannot be read ({error})") from None
    whole = hashlib.sha256(settings.encode())
    for name, data in files.items():
        for part in (name.encode(), data):
            whole.update(hashlib.sha256(part).digest())
    return origin, whole.digest()


def _check(
    db: sqlite3.Connection,
    path: Path,
    hash: bytes,
    upcasters: Upcasters,
    last: int | None = None,
) -> tuple[int, bytes]:
    """Check the chain, and the file if all of it is wanted; return the count and the last hash."""
    count, newest = 0, current(upcasters)
    try:
        for *row, stored in db.execute(_ROWS, (0, _END if last is None else last)):
            if row[0] != count:
                raise _damaged(path, count, f"event {count} is missing")
            hash = _link(hash, tuple(row))
            if hash != stored:
                raise _damaged(path, count, f"event {count} is not what was written")
            if row[3] > newest:
                raise BadInput(
                    f"event {count} was written by a newer version",
                    file=str(path),
                    remedy="update oath",
                )
            count += 1
        if last is None:
            found = db.execute("PRAGMA quick_check(1)").fetchone()[0]
            if found != "ok":
                raise _damaged(path, count, f"the file is damaged ({found})")
            (known,) = db.execute("SELECT max(first + count) FROM commands").fetchone()
            if known is not None and known > count:
                raise _damaged(path, count, f"event {count} is missing")
    except sqlite3.Error as error:
        raise _damaged(path, count, f"event {count} cannot be read ({error})") from None
    return count, hash


def _line(data: str) -> Any:
    """Read an event's text."""
    try:
        return from_json(data)  # three times as fast, but it does not take every text
    except ValueError:
        return json.loads(data)


def _damaged(path: Path, whole: int, problem: str) -> BadInput:
    remedy = "restore it from a copy"
    if whole:
        remedy += f"; events 0 to {whole - 1} are whole (oath replay --seq {whole - 1})"
    return BadInput(problem, file=str(path), remedy=remedy)


def _events(
    rows: Iterable[tuple[int, int, str]], path: Path, upcasters: Upcasters
) -> Iterator[AnyEvent]:
    now = current(upcasters)
    for seq, version, data in rows:
        try:
            line = _line(data)
            yield rebuilt(line if version == now else upcast(line, version, upcasters))
        except (KeyError, TypeError, ValueError, BadInput) as error:
            problem = f"event {seq} has data that cannot be read ({error})"
            raise _damaged(path, seq, problem) from None
