"""Events to store, and a journal in memory."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from typing import Any

from missions import delivery
from oath.errors import BadInput
from oath.events import (
    Allocated,
    AnyEvent,
    Commanded,
    MissionStarted,
    Moved,
    ObstacleFound,
    Planned,
    StopServed,
    TaskAdded,
)
from oath.formats.event_log import to_line
from oath.model import RouteStop
from oath.store import Answer, Origin

ORIGIN = Origin(files={"yard.yaml": b"schema: oath/mission/1\n"}, allocator="lns", seed=7)


def event(i: int) -> AnyEvent:
    """Return some event, another one for each number."""
    rng = random.Random(i)
    t, point = float(i), (rng.random(), rng.random())
    route = (RouteStop(task="a", stop="pickup"), RouteStop(task="a", stop="delivery"))
    kinds: list[AnyEvent] = [
        Moved(t=t, robot="r1", from_=point, to=(1.5, 2.0), start=t - 0.25, end=t),
        StopServed(t=t, robot="r1", task="a", stop="pickup", at=point),
        Planned(t=t, robot="r1", seconds=rng.random(), length=None, reason="command"),
        Allocated(t=t, round=i, seconds=0.1, routes={"r1": route, "r2": ()}, unassigned={"b": "ü"}),
        TaskAdded(t=t, task=delivery(f"t{i}", point, (3.0, 4.0), service_time=2.0)),
        ObstacleFound(t=t, robot="r1", obstacle="o", polygon=((0.0, 0.0), (1.0, 0.0), point)),
        Commanded(t=t, command={"intent": "undo", "parameters": {}}, source="operator"),
        MissionStarted(t=t, mission="yard", allocator="lns", seed=i),
    ]
    return kinds[i % len(kinds)]


def some(count: int, begin: int = 0) -> list[AnyEvent]:
    """Return events in order of time."""
    return [event(i) for i in range(begin, begin + count)]


class MemoryJournal:
    """Keeps everything in memory, as text like a file would."""

    def __init__(self) -> None:
        self.events: list[AnyEvent] = []
        self.answers: dict[str, Answer] = {}

    def append(
        self, events: Sequence[AnyEvent], *, id: str | None = None, answer: Any = None
    ) -> range:
        seqs = range(len(self.events), len(self.events) + len(events))
        for seq, one in zip(seqs, events, strict=True):
            to_line(seq, one)
        try:
            text = json.dumps(answer, allow_nan=False)
        except (TypeError, ValueError):
            raise BadInput("no JSON") from None
        if id is not None and id in self.answers:
            raise BadInput("used before")
        self.events += events
        if id is not None:
            self.answers[id] = Answer(seqs, json.loads(text))
        return seqs

    def replay(self, since: int = 0) -> list[AnyEvent]:
        return self.events[since:]

    def known(self, id: str) -> Answer | None:
        return self.answers.get(id)

    def close(self) -> None:
        pass
