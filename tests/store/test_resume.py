"""A mission whose process dies goes on from its journal: nothing is lost or done twice."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from journals import ORIGIN

import oath
from missions import CELL_DOOR, cell, delivery, gate, random_mission, robot, visit
from oath.allocate import Budget
from oath.allocate import allocator as named
from oath.commands import Command, parse
from oath.errors import BadInput
from oath.events import AnyEvent, Commanded, MissionFinished
from oath.fleet.sim import SimFleet
from oath.model import Mission
from oath.runtime import Result, Runtime
from oath.scene import prepare, require_reachable
from oath.state import State
from oath.store import replayed
from oath.store.sqlite import SqliteJournal, read
from oath.verify import verify
from oath.world.roadmap import Params

Cut = tuple[int, bool]
"""After how many events the process dies, and whether the next batch is stored before it does."""

Script = Sequence[tuple[float, Command]]


class Died(Exception):
    """The process is gone."""


@dataclass
class Pen:
    """Writes into the journal until the process dies."""

    journal: SqliteJournal
    cut: Cut | None
    command: str | None = None

    def write(self, events: Sequence[AnyEvent]) -> None:
        left, stores = self.cut or (10**9, True)
        if left >= len(events) or stores:
            own = isinstance(events[0], Commanded)
            self.journal.append(events, id=self.command if own else None, answer=len(events))
        self.cut = (left - len(events), stores)
        if left < len(events):
            raise Died


def carry_on(mission: Mission, pen: Pen, script: Script, allocator: str, points: int) -> Result:
    """What a server does from its start to the mission's end; commands are sent until answered."""
    chosen, past = named(allocator), pen.journal.replay()
    begin = State.of(mission, reconsiders=chosen.reconsiders)
    state = replayed(begin, past)
    unknown = {one.id for one in mission.map.obstacles if not one.known}
    fleet = SimFleet(
        mission,
        now=state.t,
        positions={id: robot.position for id, robot in state.robots.items()},
        found=unknown - state.hidden.keys(),
    )
    scene = prepare(mission, Params(points=points))
    runtime = Runtime(
        scene,
        fleet,
        name=allocator,
        allocator=chosen,
        budget=Budget(iterations=50),
        seed=0,
        journal=pen.write,
    )
    if past:
        runtime.resume(past)
    else:
        runtime.start()
    for i, (at, command) in enumerate(script):
        pen.command = f"command {i}"
        if pen.journal.known(pen.command) or runtime.state.finished:
            continue
        runtime.advance(at)
        try:
            runtime.command([command], pen.command)
        except BadInput:
            continue
    runtime.advance()
    if not runtime.state.finished:
        runtime.finish()
    end = runtime.events[-1]
    assert isinstance(end, MissionFinished)
    assert runtime.state == replayed(begin, runtime.events)
    return Result(dict(end.summary), tuple(runtime.events), scene)


def live(
    mission: Mission,
    path: Path,
    cuts: Iterable[Cut],
    script: Script = (),
    *,
    allocator: str = "lns",
    points: int = 100,
) -> Result:
    """Run a mission in a process that dies again and again, and judge the whole of it."""
    SqliteJournal.create(path, ORIGIN).close()
    remaining: Iterator[Cut] = iter(cuts)
    while True:
        with closing(SqliteJournal(path)) as journal:
            pen = Pen(journal, next(remaining, None))
            try:
                result = carry_on(mission, pen, script, allocator, points)
            except Died:
                continue
            answered = [i for i in range(len(script)) if journal.known(f"command {i}")]
            break
    assert read(path).events == list(result.events)
    sources = [event.source for event in result.events if isinstance(event, Commanded)]
    assert sorted(sources) == sorted(f"command {i}" for i in answered)
    summary = result.summary
    assert summary["completed"] + len(summary["unserved"]) == summary["tasks"]
    assert "not finished" not in summary["unserved"].values()
    return result


def check(mission: Mission, result: Result) -> None:
    for violation in verify(mission, result.events).violations:
        # Nobody is sent anywhere only because a rule obliges him, and the route on which he would
        # have fulfilled it may be another robot's after a crash or a command.
        assert violation.rule == "mission_rule", violation
        assert "still not fulfilled" in violation.message, violation


def commands(*plain: tuple[float, str, dict[str, Any]]) -> Script:
    return [(t, parse({"intent": intent, "parameters": given})) for t, intent, given in plain]


# --- One mission, cut after every event -----------------------------------------------------


def small() -> Mission:
    return cell(
        [robot("r1", (2, 5), capacity=2), robot("r2", (5, 1), motion="drone")],
        [delivery("a", (3, 3), (9, 9)), visit("b", (1, 1), service_time=2.0), visit("c", (9, 1))],
        obstacles=(gate("gate-1", (CELL_DOOR[0], (7.1, 4.0), (7.1, 4.8), (6.9, 4.8))),),
        places={"p": (5.0, 9.0)},
        task_types=("carry", "inspect", "normal"),
    )


ORDERS = commands(
    (0.5, "add_task", {"location": [4, 8], "delivery_point": "p", "task_type": "carry"}),
    (1.0, "obstacle_update", {"obstacle_location": [[3.2, 1.0], [3.2, 2.5]]}),
    (1.5, "change_task_priority", {"task_label": "c", "priority": "high"}),
    (2.0, "pause_robot", {"robot": "r1"}),
    (3.0, "cancel_task", {"task_label": "b"}),
    (4.0, "undo", {}),
    (4.5, "resume_robot", {"robot": "r1"}),
    (6.0, "robot_failed", {"robot": "r2"}),
)


def whole(tmp_path: Path) -> Result:
    """The mission without a crash."""
    result = live(small(), tmp_path / "whole.journal", [], ORDERS)
    check(small(), result)
    assert result.summary["unserved"] == {}
    assert len([e for e in result.events if isinstance(e, Commanded)]) == len(ORDERS)
    return result


def cut_after_every(events: range, stores: bool, tmp_path: Path) -> None:
    for k in events:
        result = live(small(), tmp_path / f"{k}.journal", [(k, stores)], ORDERS)
        check(small(), result)
        assert result.summary["unserved"] == {}, k


@pytest.mark.parametrize("stores", [True, False], ids=["stored", "lost"])
def test_a_mission_with_commands_survives_a_crash(stores: bool, tmp_path: Path) -> None:
    last = len(whole(tmp_path).events)
    cut_after_every(range(stores, last, 7), stores, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("stores", [True, False], ids=["stored", "lost"])
def test_a_mission_with_commands_survives_a_crash_after_any_event(
    stores: bool, tmp_path: Path
) -> None:
    cut_after_every(range(len(whole(tmp_path).events)), stores, tmp_path)


def test_a_mission_survives_a_crash_every_few_events(tmp_path: Path) -> None:
    for step in (2, 3, 5):
        # The first events of a life are its plans: a shorter one would never get anywhere.
        cuts: Iterable[Cut] = ((step + 2 + i % 2, i % 3 == 0) for i in count())
        result = live(small(), tmp_path / f"{step}.journal", cuts, ORDERS)
        check(small(), result)
        assert result.summary["unserved"] == {}


# --- Any mission, any crash -----------------------------------------------------------------


def random_script(mission: Mission, rng: random.Random) -> Script:
    """Commands at random times; many of them are refused."""

    def spot() -> list[float]:
        return [round(rng.uniform(0.5, 9.5), 2), round(rng.uniform(0.5, 9.5), 2)]

    def one() -> tuple[str, dict[str, Any]]:
        robot = rng.choice(mission.robots).id
        task = rng.choice(mission.tasks).id if mission.tasks else "none"
        return rng.choice(
            [
                ("add_task", {"location": spot(), "delivery_point": "p", "task_type": "carry"}),
                ("obstacle_update", {"obstacle_location": [spot(), spot()]}),
                ("remove_obstacle", {"obstacle": "wall-1"}),
                ("change_task_priority", {"task_label": task, "priority": "high"}),
                ("cancel_task", {"task_label": task}),
                ("pause_robot", {"robot": robot}),
                ("resume_robot", {"robot": "all"}),
                ("robot_failed", {"robot": robot}),
                ("undo", {}),
            ]
        )

    times = sorted(rng.uniform(0.0, 20.0) for _ in range(rng.randrange(6)))
    script = [(t, *one()) for t in times]
    return commands(*script, (25.0, "resume_robot", {"robot": "all"}))


def check_random(seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    mission = random_mission(seed)
    try:
        require_reachable(prepare(mission, Params(points=100)))
    except BadInput:
        return
    cuts = [(rng.randrange(25), rng.random() < 0.5) for _ in range(rng.randrange(1, 6))]
    script = random_script(mission, rng)
    path = folder / f"{seed}.journal"
    path.unlink(missing_ok=True)
    result = live(mission, path, cuts, script, allocator=rng.choice(["lns", "oath"]))
    check(mission, result)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_random_missions_survive_random_crashes(
    seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    check_random(seed, tmp_path_factory.mktemp("journals"))


@pytest.mark.slow
def test_many_random_missions_survive_random_crashes(tmp_path: Path) -> None:
    for seed in range(200):
        check_random(seed, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["maze-25-gates", "office"])
def test_shipped_missions_survive_crashes(name: str, tmp_path: Path) -> None:
    mission = oath.load(f"missions/{name}.yaml")
    rng = random.Random(name)
    cuts = [(rng.randrange(2, 60), rng.random() < 0.5) for _ in range(10)]
    result = live(mission, tmp_path / "a.journal", cuts, points=1000)
    check(mission, result)
    assert result.summary["unserved"] == {}
