"""What happened, and how the mission stood after any of it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from oath.dispatch import fold
from oath.events import (
    AnyEvent,
    Moved,
    ObstacleFound,
    Planned,
    RobotFailed,
    StopServed,
    TaskAdded,
)
from oath.model import Mission
from oath.state import State

EVERY = 500
"""A checkpoint is kept after so many events."""

ALERTS = 50
"""So many of the newest alerts are kept."""


@dataclass(frozen=True, slots=True)
class Trace:
    """What a robot has done: heading [rad] and time [s] of its last report, driven [m], tasks."""

    heading: float = 0.0
    seen: float = 0.0
    driven: float = 0.0
    tasks: int = 0


@dataclass(frozen=True, slots=True)
class Alert:
    """What an operator should know of, and when it happened [s]."""

    t: float
    text: str


@dataclass(slots=True)
class Tally:
    """What the events say that the mission's state does not keep."""

    traces: dict[str, Trace]
    alerts: tuple[Alert, ...] = ()
    last_stops: dict[str, str] = field(default_factory=dict)
    """Of every task the stop that completes it."""

    @classmethod
    def of(cls, mission: Mission) -> Tally:
        """The tally before anything happened."""
        return cls(
            traces={robot.id: Trace() for robot in mission.robots},
            last_stops={task.id: task.stops[-1].name for task in mission.tasks},
        )

    def copy(self) -> Tally:
        """The same tally, to go on from."""
        return Tally(dict(self.traces), self.alerts, dict(self.last_stops))

    def add(self, event: AnyEvent) -> None:
        """Count an event in."""
        match event:
            case Moved():
                (x0, y0), (x1, y1) = event.from_, event.to
                trace = self.traces[event.robot]
                self.traces[event.robot] = Trace(
                    heading=math.atan2(y1 - y0, x1 - x0),
                    seen=event.t,
                    driven=trace.driven + math.hypot(x1 - x0, y1 - y0),
                    tasks=trace.tasks,
                )
            case StopServed():
                trace = self.traces[event.robot]
                done = trace.tasks + (self.last_stops[event.task] == event.stop)
                self.traces[event.robot] = replace(trace, seen=event.t, tasks=done)
            case TaskAdded():
                self.last_stops[event.task.id] = event.task.stops[-1].name
            case ObstacleFound():
                self._alert(event.t, f"{event.robot} found {event.obstacle}")
            case RobotFailed():
                trace = self.traces[event.robot]
                self.traces[event.robot] = replace(trace, seen=event.t)
                self._alert(event.t, f"{event.robot} failed")
            case Planned() if event.unreachable is not None:
                self._alert(event.t, f"{event.robot} has no way to task {event.unreachable}")
            case _:
                pass

    def _alert(self, t: float, text: str) -> None:
        self.alerts = (*self.alerts, Alert(t, text))[-ALERTS:]


class History:
    """All events so far, with checkpoints from which any moment is rebuilt.

    Parameters
    ----------
    mission
        The mission as its file says.
    reconsiders
        See `State`.
    """

    def __init__(self, mission: Mission, *, reconsiders: bool) -> None:
        self.events: list[AnyEvent] = []
        self.tally = Tally.of(mission)
        begin = State.of(mission, reconsiders=reconsiders)
        self._counts = [0]
        self._points = [(begin, self.tally.copy())]

    def add(self, events: Iterable[AnyEvent]) -> None:
        """Note events, in order."""
        for event in events:
            self.events.append(event)
            self.tally.add(event)

    def stands(self, state: State) -> None:
        """Note how the mission stands after the events so far, if a checkpoint is due."""
        if len(self.events) >= self._counts[-1] + EVERY:
            self._counts.append(len(self.events))
            self._points.append((state, self.tally.copy()))

    def at(self, seq: int) -> tuple[State, Tally]:
        """How the mission stood after the event with this number; -1 = before the first."""
        index = bisect_right(self._counts, seq + 1) - 1
        state, tally = self._points[index]
        tally = tally.copy()
        for events, after, _ in fold(state, self.events[self._counts[index] : seq + 1]):
            state = after
            for event in events:
                tally.add(event)
        return state, tally
