"""What everybody is told: events, states and poses, each made ready once for all who listen."""

from __future__ import annotations

import asyncio
import json
from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from oath.events import AnyEvent
from oath.formats.event_log import to_line
from oath.scene import Scene
from oath.service.history import History
from oath.service.snapshot import Moment, state_of

PAGE = 1000
"""At most so many events are told at once."""


class Feed:
    """The newest of everything; lives in the event loop.

    Whoever listens has a cursor into the events and takes the newest poses and state when it is
    ready for them, so nothing piles up for those who are slow.

    Parameters
    ----------
    scene
        The mission that runs.
    history
        What has happened so far.
    """

    def __init__(self, scene: Scene, history: History) -> None:
        self.scene, self.history = scene, history
        self.moment: Moment | None = None
        self.poses, self.poses_at = b"", 0.0
        self.moment_at = 0.0
        self.ended = False
        self._lines: dict[int, str] = {}
        self._known_at = array("d")
        self._state: tuple[Moment, str] | None = None
        self._frame: tuple[Moment, str] | None = None
        self._page: tuple[int, int, str] | None = None
        self._wakes: set[asyncio.Event] = set()

    @property
    def last(self) -> int:
        """Number of the last event; -1 = none yet."""
        return len(self.history.events) - 1

    def known_at(self, seq: int) -> float | None:
        """When an event became known [s, wall clock]; None = before the server started."""
        index = seq - len(self.history.events) + len(self._known_at)
        return self._known_at[index] if index >= 0 else None

    @contextmanager
    def listening(self) -> Iterator[asyncio.Event]:
        """An event that is set whenever there is something new."""
        wake = asyncio.Event()
        wake.set()
        self._wakes.add(wake)
        try:
            yield wake
        finally:
            self._wakes.discard(wake)

    @property
    def listeners(self) -> int:
        """How many listen."""
        return len(self._wakes)

    # -- what comes in

    def happened(self, events: Sequence[AnyEvent], at: float) -> None:
        """Events follow those that are known."""
        self.history.add(events)
        self._known_at.extend([at] * len(events))
        self._wake()

    def moved(self, poses: bytes, at: float) -> None:
        """Robots are somewhere else since `at` [s, wall clock]."""
        self.poses, self.poses_at = poses, at
        self._wake()

    def stands(self, moment: Moment, at: float) -> None:
        """The mission stands so since `at` [s, wall clock], after all the events so far."""
        self.moment, self.moment_at = moment, at
        self.history.stands(moment.state)
        self._wake()

    def end(self) -> None:
        """Nothing more will come."""
        self.ended = True
        self._wake()

    def _wake(self) -> None:
        for wake in self._wakes:
            wake.set()

    # -- what goes out

    def line(self, seq: int) -> str:
        """An event as JSON."""
        line = self._lines.get(seq)
        if line is None:
            line = self._lines[seq] = to_line(seq, self.history.events[seq])
        return line

    def page(self, since: int, limit: int = PAGE) -> tuple[int, str]:
        """Events after number `since` as a JSON list, at most `limit`, and the last one's number.

        Those who are up to date all ask for the same page, which is put together once.
        """
        last = min(since + limit, self.last)
        if self._page is None or self._page[:2] != (since, last):
            text = "[" + ",".join(map(self.line, range(since + 1, last + 1))) + "]"
            self._page = (since, last, text)
        return last, self._page[2]

    def state(self, moment: Moment) -> str:
        """A present moment as JSON."""
        if self._state is None or self._state[0] is not moment:
            plain = state_of(self.scene, moment, self.history.tally)
            self._state = moment, to_json(plain)
        return self._state[1]

    def state_frame(self, moment: Moment) -> str:
        """A present moment as it goes through a socket."""
        if self._frame is None or self._frame[0] is not moment:
            self._frame = moment, f'{{"type":"state","state":{self.state(moment)}}}'
        return self._frame[1]

    def past(self, seq: int) -> str:
        """How the mission stood after an event, as JSON."""
        state, tally = self.history.at(seq)
        now = self.moment
        moment = Moment(
            seq=seq,
            t=state.t,
            state=state,
            speed=now.speed if now else 1.0,
            paused=now.paused if now else False,
        )
        return to_json(state_of(self.scene, moment, tally))


def to_json(value: Any) -> str:
    """Return plain data as JSON without spaces."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
