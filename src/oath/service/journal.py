"""A journal that forgets when the program ends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from oath.events import AnyEvent


class Memory:
    """Keeps events in memory only."""

    def __init__(self) -> None:
        self._events: list[AnyEvent] = []
        self._ids: dict[str, int] = {}

    def append(self, events: Sequence[AnyEvent], *, id: str | None = None) -> int:
        """Write events that happen together; return the number of the last."""
        self._events += events
        if id is not None:
            self._ids[id] = len(self._events) - 1
        return len(self._events) - 1

    def find(self, id: str) -> int | None:
        """The number that `append` returned for this id, if it was used."""
        return self._ids.get(id)

    def replay(self) -> Iterator[AnyEvent]:
        """All events from the first."""
        return iter(list(self._events))

    def close(self) -> None:
        """Nothing more will be written."""
