"""A journal that forgets when the program ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from oath.events import AnyEvent


@dataclass(frozen=True, slots=True)
class Answer:
    """What a command was answered, and the sequence numbers of its own events."""

    events: range
    value: Any


class Memory:
    """Keeps events in memory only."""

    def __init__(self) -> None:
        self._events: list[AnyEvent] = []
        self._answers: dict[str, Answer] = {}

    def append(
        self, events: Sequence[AnyEvent], *, id: str | None = None, answer: object = None
    ) -> range:
        """Store events that happen together; return their sequence numbers."""
        seqs = range(len(self._events), len(self._events) + len(events))
        self._events += events
        if id is not None:
            self._answers[id] = Answer(seqs, answer)
        return seqs

    def replay(self, since: int = 0) -> list[AnyEvent]:
        """Return the events from a sequence number on."""
        return self._events[since:]

    def known(self, id: str) -> Answer | None:
        """Return what was answered to the command with this id; None if there was none."""
        return self._answers.get(id)

    def close(self) -> None:
        """Nothing more will be stored."""
