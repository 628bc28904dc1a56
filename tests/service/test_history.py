"""Any moment of the past is rebuilt from the events."""

from __future__ import annotations

import math

import pytest

import oath
from oath.dispatch import State, advance
from oath.events import AnyEvent, Moved, ObstacleFound, StopServed
from oath.model import Mission
from oath.service import history
from oath.service.history import History


@pytest.fixture(scope="module")
def mission() -> Mission:
    return oath.load("missions/maze-25-gates.yaml")


@pytest.fixture(scope="module")
def events(mission: Mission) -> tuple[AnyEvent, ...]:
    return oath.run(mission, allocator="greedy").events


def test_every_moment(
    mission: Mission, events: tuple[AnyEvent, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(history, "EVERY", 50)
    past, state = History(mission, reconsiders=False), State.of(mission)
    states = [state]
    for event in events:
        past.add([event])
        state, _ = advance(state, event)
        states.append(state)
        past.stands(state)
    for seq in (-1, 0, 1, 48, 49, 50, 51, 99, 100, len(events) - 1):
        assert past.at(seq)[0] == states[seq + 1]


def test_what_robots_have_done(mission: Mission, events: tuple[AnyEvent, ...]) -> None:
    past = History(mission, reconsiders=False)
    past.add(events)
    _, tally = past.at(len(events) - 1)
    assert tally.traces == past.tally.traces
    for robot in mission.robots:
        moves = [e for e in events if isinstance(e, Moved) and e.robot == robot.id]
        served = [e for e in events if isinstance(e, StopServed) and e.robot == robot.id]
        trace = tally.traces[robot.id]
        assert trace.driven == pytest.approx(sum(math.dist(m.from_, m.to) for m in moves))
        assert trace.tasks == sum(e.stop == "delivery" for e in served)
        assert trace.seen == max(e.t for e in [*moves, *served])
    found = [e for e in events if isinstance(e, ObstacleFound)]
    assert found
    assert [a.t for a in tally.alerts if "found" in a.text] == [e.t for e in found]


def test_before_anything_happened(mission: Mission) -> None:
    state, tally = History(mission, reconsiders=True).at(-1)
    assert state == State.of(mission, reconsiders=True)
    assert all(trace.tasks == 0 for trace in tally.traces.values())
