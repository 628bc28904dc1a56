"""The journal's file: damage, crashes, full disks, other owners, other versions."""

from __future__ import annotations

import random
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from journals import ORIGIN, some

from oath.errors import BadInput, StoreError
from oath.events import RobotPaused
from oath.store import Answer, Origin
from oath.store.sqlite import APPLICATION, SqliteJournal, read
from oath.store.versions import Upcasters


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A closed journal with 50 events and two commands."""
    path = tmp_path / "a mission? #1.journal"
    journal = SqliteJournal.create(path, ORIGIN)
    for i in range(0, 50, 5):
        journal.append(some(5, i), id=f"c{i}" if i in (10, 45) else None, answer=i)
    journal.close()
    return path


LOCKS = (".lock", "-shm", "-wal")
"""What stands beside a journal that is in use; a reader leaves it there, empty."""


def snapshot(path: Path) -> dict[str, bytes]:
    """Return every file in the journal's folder that holds something."""
    found = {one.name: one.read_bytes() for one in path.parent.iterdir()}
    assert not any(found[name] for name in found if name.endswith((".lock", "-wal")))
    return {name: data for name, data in found.items() if not name.endswith(LOCKS)}


def tamper(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as db, db:
        db.execute(statement)
        db.commit()


# --- What it is -----------------------------------------------------------------------------


def test_it_opens_as_it_was_closed(path: Path) -> None:
    with closing(SqliteJournal(path)) as journal:
        assert journal.origin == ORIGIN
        assert journal.replay() == some(50)
        assert journal.append(some(2, 50)) == range(50, 52)
    assert read(path).events == some(52)


def test_only_the_lock_is_left_beside_a_closed_journal(path: Path) -> None:
    assert {one.name for one in path.parent.iterdir()} == {path.name, f"{path.name}.lock"}


def test_every_append_is_synced(path: Path) -> None:
    with closing(SqliteJournal(path)) as journal:
        modes = [journal._db.execute(f"PRAGMA {name}").fetchone()[0] for name in MODES]
    assert modes == ["wal", 2]


MODES = ("journal_mode", "synchronous")


def test_the_chain_can_be_followed_by_anyone(path: Path) -> None:
    """The hashes are what the document says they are, computed here from the text of it."""
    import hashlib

    with closing(sqlite3.connect(path)) as db:
        ((settings,),) = db.execute("SELECT settings FROM origin")
        whole = settings.encode()
        for name, data in db.execute("SELECT name, data FROM files"):
            whole += hashlib.sha256(name.encode()).digest() + hashlib.sha256(data).digest()
        hash = hashlib.sha256(whole).digest()
        for *row, stored in db.execute("SELECT * FROM events ORDER BY seq"):
            hash = hashlib.sha256(hash + "|".join(map(str, row)).encode()).digest()
            assert hash == stored


# --- One owner, many readers ----------------------------------------------------------------


def test_a_second_owner_is_refused(path: Path) -> None:
    with closing(SqliteJournal(path)) as journal:
        with pytest.raises(BadInput, match="in use by another process; stop the server"):
            SqliteJournal(path)
        code = f"from oath.store.sqlite import SqliteJournal; SqliteJournal({str(path)!r})"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert done.returncode == 1
        assert "in use by another process" in done.stderr
        journal.append(some(1, 50))
    SqliteJournal(path).close()


def test_a_refused_journal_is_free_again(path: Path) -> None:
    tamper(path, "UPDATE events SET t = 3.5 WHERE seq = 7")
    for _ in range(2):
        with pytest.raises(BadInput, match="event 7 "):
            SqliteJournal(path)


def test_others_read_what_is_owned(path: Path) -> None:
    with closing(SqliteJournal(path)) as journal:
        journal.append(some(3, 50))
        assert read(path).events == some(53)
        code = f"from oath.store.sqlite import read; print(len(read({str(path)!r}).events))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert (done.stdout, done.stderr) == ("53\n", "")
        journal.append(some(1, 53))
        assert read(path, last=9).events == some(10)
    assert read(path).events == some(54)


def test_a_reader_does_not_hold_up_the_owner(path: Path) -> None:
    journal = SqliteJournal(path)
    with closing(sqlite3.connect(path)) as reader:
        reader.execute("BEGIN")
        assert reader.execute("SELECT count(*) FROM events").fetchone() == (50,)
        journal.append(some(2, 50))
        journal.close()  # as it is, not as one plain file
        assert reader.execute("SELECT count(*) FROM events").fetchone() == (50,)
    with closing(SqliteJournal(path)) as again:
        assert again.replay() == some(52)
    test_only_the_lock_is_left_beside_a_closed_journal(path)


def test_a_crash_in_the_middle_of_a_checkpoint(tmp_path: Path) -> None:
    """The file's first page is new then, and says of pages that they are there."""
    path, crashed = tmp_path / "a.journal", tmp_path / "crashed.journal"
    with closing(SqliteJournal.create(path, ORIGIN)) as journal:
        journal.append(some(200))
        for end in ("", "-wal"):
            shutil.copy(f"{path}{end}", f"{crashed}{end}")
        journal._db.execute("PRAGMA wal_checkpoint")
        with crashed.open("r+b") as file:
            file.write(path.read_bytes()[:4096])
    assert crashed.stat().st_size < path.stat().st_size
    for _ in range(2):
        assert read(crashed).events == some(200)
    with closing(SqliteJournal(crashed)) as journal:
        assert journal.replay() == some(200)


@pytest.mark.parametrize("t", [0, 3, -0.0, 5e-324, 1e300, 0.1 + 0.2])
def test_any_time_is_read_back(t: float, tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    with closing(SqliteJournal.create(path, ORIGIN)) as journal:
        journal.append([RobotPaused(t=t, robot="ü\0\ud800")])
    assert read(path).events == [RobotPaused(t=t, robot="ü\0\ud800")]


def test_ids_are_text(path: Path) -> None:
    with closing(SqliteJournal(path)) as journal:
        for id in ("", "ü\0x", "'; DROP TABLE events"):
            assert journal.known(id) is None
            journal.append([], id=id, answer=id)
            assert journal.known(id) == Answer(range(50, 50), id)
        with pytest.raises(BadInput, match="the id is no text"):
            journal.append(some(1), id="\ud800")
        assert journal.replay() == some(50)


def test_an_interrupted_append_stores_nothing(path: Path) -> None:
    with closing(SqliteJournal(path)) as journal:
        with pytest.raises(KeyboardInterrupt), journal._transaction(range(50, 51)) as db:
            db.execute("DELETE FROM events")
            raise KeyboardInterrupt
        assert journal.append(some(1, 50)) == range(50, 51)
    assert read(path).events == some(51)


def test_create_never_overwrites(path: Path) -> None:
    before = snapshot(path)
    with pytest.raises(BadInput, match="exists already"):
        SqliteJournal.create(path, ORIGIN)
    assert snapshot(path) == before


def test_what_a_crash_left_of_a_creation_is_no_matter(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    (tmp_path / "a.journal.part").write_bytes(b"half")
    with closing(SqliteJournal.create(path, ORIGIN)) as journal:
        assert journal.replay() == []


# --- Damage ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("statement", "problem"),
    [
        ("DELETE FROM events WHERE seq = 20", "event 20 is missing"),
        ("DELETE FROM events WHERE seq = 0", "event 0 is missing"),
        ("DELETE FROM events WHERE seq >= 48", "event 48 is missing"),
        ("UPDATE events SET seq = 99 WHERE seq = 49", "event 49 is missing"),
        ("UPDATE events SET data = replace(data, 'r1', 'r2') WHERE seq = 8", "event 8 is not"),
        ("UPDATE events SET type = 'robot_failed' WHERE seq = 8", "event 8 is not"),
        ("UPDATE events SET version = 2 WHERE seq = 8", "event 8 is not"),
        ("UPDATE events SET data = x'ff' WHERE seq = 8", "event 8 "),
        ("UPDATE events SET hash = x'00' WHERE seq = 8", "event 8 is not"),
        ("UPDATE files SET data = x'00'", "event 0 is not"),
        ("UPDATE origin SET settings = replace(settings, '7', '8')", "event 0 is not"),
        ("UPDATE origin SET settings = '{}'", "how the mission began"),
        ("UPDATE origin SET settings = '{'", "how the mission began"),
        ("DELETE FROM origin", "how the mission began"),
        ("DROP TABLE events", "no such table"),
        ("DROP TABLE files", "no such table"),
    ],
)
def test_what_was_changed_is_found(path: Path, statement: str, problem: str) -> None:
    tamper(path, statement)
    before = snapshot(path)
    for use in (SqliteJournal, read):
        with pytest.raises(BadInput, match=problem) as caught:
            use(path)
        assert caught.value.file == str(path)
        assert caught.value.remedy.startswith("restore it from a copy")
    assert snapshot(path) == before


def test_what_comes_before_the_damage_can_be_read(path: Path) -> None:
    tamper(path, "UPDATE events SET t = 3.5 WHERE seq = 30")
    with pytest.raises(BadInput, match=r"events 0 to 29 are whole \(oath replay --seq 29\)"):
        read(path)
    assert read(path, last=29).events == some(30)


def test_swapped_events_are_found(path: Path) -> None:
    for old, new in ((8, 999), (16, 8), (999, 16)):
        tamper(path, f"UPDATE events SET seq = {new} WHERE seq = {old}")
    with pytest.raises(BadInput, match="event 8 is not what was written"):
        read(path)


@pytest.mark.parametrize("seed", range(40))
def test_flipped_bytes_never_pass_for_events(path: Path, seed: int) -> None:
    """Whatever happens to the file: it is refused, or it says what was written."""
    rng = random.Random(seed)
    content = bytearray(path.read_bytes())
    if seed % 4 == 0:
        del content[rng.randrange(len(content)) :]
    for _ in range(rng.choice([1, 1, 50]) * bool(content)):
        content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    path.write_bytes(content)
    before = snapshot(path)
    try:
        assert read(path).events == some(50)
    except BadInput as error:
        assert error.file == str(path)
        assert error.remedy
        with pytest.raises(BadInput):
            SqliteJournal(path)
        assert snapshot(path)[path.name] == before[path.name]


def foreign(path: Path) -> None:
    tamper(path, "CREATE TABLE photos (id)")


@pytest.mark.parametrize(
    "make",
    [
        lambda path: path.write_bytes(b""),
        lambda path: path.write_text("schema: oath/mission/1\n"),
        lambda path: path.write_bytes(b"SQLite format 3\0" + b"\xff" * 200),
        foreign,
    ],
)
def test_a_foreign_file_is_refused_and_left_alone(
    tmp_path: Path, make: Callable[[Path], object]
) -> None:
    path = tmp_path / "foreign"
    make(path)
    before = snapshot(path)
    for use in (SqliteJournal, read):
        with pytest.raises(BadInput, match="is no journal"):
            use(path)
    assert snapshot(path) == before
    with pytest.raises(BadInput, match="exists already"):
        SqliteJournal.create(path, ORIGIN)
    assert snapshot(path) == before


def test_a_missing_file_and_a_missing_folder(tmp_path: Path) -> None:
    for use in (SqliteJournal, read):
        with pytest.raises(BadInput, match="no such file"):
            use(tmp_path / "none.journal")
    with pytest.raises(BadInput, match="cannot be locked"):
        SqliteJournal.create(tmp_path / "none" / "a.journal", ORIGIN)
    assert list(tmp_path.iterdir()) == []


def test_a_journal_of_another_version_is_refused(path: Path) -> None:
    tamper(path, "PRAGMA user_version = 2")
    with pytest.raises(BadInput, match="version 2; this version of oath reads 1"):
        read(path)
    assert APPLICATION == 0x4F415448


# --- Full disks -----------------------------------------------------------------------------


def test_a_full_disk_is_said_and_nothing_is_half_stored(path: Path) -> None:
    with closing(SqliteJournal(path)) as journal:
        journal._db.execute("PRAGMA max_page_count = 1")  # SQLite takes what it has
        stored = 50
        with pytest.raises(StoreError, match=r"event \d+ cannot be stored .*full.*make room"):
            for _ in range(100):
                journal.append(some(20, stored), id=f"new{stored}")
                stored += 20
        assert journal.replay() == some(stored)
        assert journal.known(f"new{stored}") is None
        journal._db.execute("PRAGMA max_page_count = 10000")
        assert journal.append(some(20, stored)) == range(stored, stored + 20)
    assert read(path).events == some(stored + 20)


LIMITED = """
import resource, sys
sys.path.insert(0, "tests/store"), sys.path.insert(0, "tests")
from journals import some
from oath.errors import StoreError
from oath.store.sqlite import SqliteJournal
journal = SqliteJournal(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
stored = 50
try:
    while True:
        journal.append(some(7, stored))
        stored += 7
        print(stored, flush=True)
except StoreError as error:
    print(error, file=sys.stderr)
"""


def test_a_file_that_may_not_grow(path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(path)], capture_output=True, text=True, check=True
    )
    assert "cannot be stored" in done.stderr
    stored = int(done.stdout.split()[-1])
    assert stored > 100
    with closing(SqliteJournal(path)) as journal:
        assert journal.replay() == some(stored)
        assert journal.append(some(7, stored)) == range(stored, stored + 7)


def test_a_closed_journal_says_so(path: Path) -> None:
    journal = SqliteJournal(path)
    journal.close()
    with pytest.raises(StoreError):
        journal.append(some(1, 50))
    with pytest.raises(StoreError):
        journal.replay()


# --- Crashes --------------------------------------------------------------------------------

APPENDING = """
import sys
sys.path.insert(0, "tests/store"), sys.path.insert(0, "tests")
from journals import some
from oath.store.sqlite import SqliteJournal
journal = SqliteJournal(sys.argv[1])
stored = len(journal.replay())
for count in range(100_000):
    size = 1 + count % 5
    seqs = journal.append(some(size, stored), id=f"c{stored}", answer=size)
    stored = seqs.stop
    print(seqs.start, seqs.stop, flush=True)
"""


def kill_at_random(path: Path, rng: random.Random) -> list[range]:
    """Append in another process until it is killed; return what it said is stored."""
    command = [sys.executable, "-c", APPENDING, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = [process.stdout.readline() for _ in range(rng.randrange(1, 60))]
        process.kill()
        said += process.stdout.readlines()
    whole = [line.split() for line in said if line.endswith("\n")]
    return [range(int(first), int(end)) for first, end in whole]


@pytest.mark.slow
def test_kill_9_loses_nothing_that_was_acknowledged(tmp_path: Path) -> None:
    path, rng, stored = tmp_path / "a.journal", random.Random(9), 0
    SqliteJournal.create(path, ORIGIN).close()
    for round in range(30):
        said = kill_at_random(path, rng)
        assert said[0].start == stored, "it went on from somewhere else"
        if round % 3 == 0:  # readers come first, at a file that nobody closed
            assert len(read(path).events) >= said[-1].stop
        with closing(SqliteJournal(path)) as journal:
            stored = len(journal.replay())
            assert stored >= said[-1].stop
            for seqs in said:
                assert journal.known(f"c{seqs.start}") == Answer(seqs, len(seqs))
    assert read(path).events == some(stored)
    assert stored > 1000


# --- Versions -------------------------------------------------------------------------------

OLD: Upcasters = {
    ("robot_paused", 1): lambda line: {
        **{key: value for key, value in line.items() if key != "who"},
        "robot": line["who"],
    },
    ("robot_paused", 2): lambda line: {**line, "robot": line["robot"].lower()},
}


def as_written_before(path: Path, text: str) -> None:
    """Write one event of version 1 as an older program would have."""
    from oath.store import sqlite

    journal = SqliteJournal.create(path, ORIGIN)
    row = (0, 1.0, "robot_paused", 1, text)
    hash = sqlite._link(journal._hash, row)
    journal._db.execute("INSERT INTO events VALUES (?, ?, ?, ?, ?, ?)", (*row, hash))
    journal.close()


def test_old_events_are_brought_up_to_date(tmp_path: Path) -> None:
    path = tmp_path / "old.journal"
    as_written_before(path, '{"seq":0,"t":1.0,"type":"robot_paused","who":"R1"}')
    new = RobotPaused(t=2.0, robot="R2")
    with closing(SqliteJournal(path, upcasters=OLD)) as journal:
        journal.append([new])
        assert journal.replay() == [RobotPaused(t=1.0, robot="r1"), new]
    with closing(sqlite3.connect(path)) as db:
        assert [row[0] for row in db.execute("SELECT version FROM events")] == [1, 3]
    assert read(path, upcasters=OLD).events[1] == new
    with pytest.raises(BadInput, match="event 1 was written by a newer version; update oath"):
        read(path, upcasters={("robot_paused", 1): OLD["robot_paused", 1]})


@pytest.mark.parametrize(
    "text", ["{", "[]", "{}", '{"type":"robot_paused","t":1}', '{"type":"x"}', '{"who":1}']
)
def test_old_events_that_nobody_understands(tmp_path: Path, text: str) -> None:
    path = tmp_path / "old.journal"
    as_written_before(path, text)
    for upcasters in ({}, OLD):
        with pytest.raises(BadInput, match="event 0 "):
            read(path, upcasters=upcasters)


def test_text_that_is_no_text_elsewhere_is_read_back(path: Path) -> None:
    odd = RobotPaused(t=1.0, robot="half a \ud83d smile")
    with closing(SqliteJournal(path)) as journal:
        (seq,) = journal.append([odd])
        assert journal.replay(seq) == [odd]


# --- How a mission began --------------------------------------------------------------------


@pytest.mark.parametrize("name", ["maze-25-gates", "office", "warehouse"])
def test_a_journal_holds_its_mission(name: str, tmp_path: Path) -> None:
    import oath

    origin = Origin.of(f"missions/{name}.yaml", allocator="lns", makespan_weight=0.5, seed=3)
    path = tmp_path / "a.journal"
    SqliteJournal.create(path, origin).close()
    back = read(path).origin
    assert back == origin
    mission, original = back.mission(), oath.load(f"missions/{name}.yaml")
    assert mission.source == back.name == f"{name}.yaml"
    assert (mission.robots, mission.tasks) == (original.robots, original.tasks)
    if original.map.grid is not None:
        assert mission.map.grid is not None
        assert (mission.map.grid.occupied == original.map.grid.occupied).all()
    assert back.state(mission).reconsiders


def test_maps_in_other_folders_come_along(tmp_path: Path) -> None:
    for folder in ("plans/today", "maps/pictures"):
        (tmp_path / folder).mkdir(parents=True)
    text = Path("missions/office.yaml").read_text().replace("office-map", "../../maps/office-map")
    (tmp_path / "plans/today/office.yaml").write_text(text)
    map = Path("missions/office-map.yaml").read_text().replace("image: ", "image: pictures/")
    (tmp_path / "maps/office-map.yaml").write_text(map)
    shutil.copy("missions/office-map.pgm", tmp_path / "maps/pictures")
    origin = Origin.of(tmp_path / "plans/today/office.yaml", allocator="oath")
    assert list(origin.files) == [
        "plans/today/office.yaml",
        "maps/office-map.yaml",
        "maps/pictures/office-map.pgm",
    ]
    shutil.rmtree(tmp_path / "maps")
    assert origin.mission().map.grid is not None
    assert not origin.state(origin.mission()).reconsiders


@pytest.mark.parametrize("name", ["../outside.yaml", "/tmp/outside.yaml", "a/../../outside.yaml"])
def test_a_journal_writes_nothing_outside(name: str) -> None:
    with pytest.raises(BadInput, match="outside of its folder"):
        Origin(files={name: b"x"}, allocator="lns").mission()


def test_a_mission_that_this_version_does_not_read() -> None:
    with pytest.raises(BadInput, match=r"^later.yaml: schema: unknown schema 'oath/mission/9'"):
        Origin(files={"later.yaml": b"schema: oath/mission/9\n"}, allocator="lns").mission()


def test_the_origin_of_a_missing_mission(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such file"):
        Origin.of(tmp_path / "none.yaml", allocator="lns")
