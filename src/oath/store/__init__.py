"""The journal: what happened in a mission, on disk before it is applied.

A journal begins with its origin, all that is needed to run the mission again: its files and
settings. The events follow. Folding `oath.dispatch.advance` over them gives every state there was.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from oath.allocate import allocator as named
from oath.dispatch import fold
from oath.errors import BadInput
from oath.events import AnyEvent
from oath.formats import mission as mission_file
from oath.formats.yaml_document import read_bytes
from oath.model import Mission
from oath.state import State


class Journal(Protocol):
    """What keeps the events of one mission: SQLite by default, or a database server.

    Laws: event i of `replay` has the sequence number i; what `append` returned for is there after
    any crash, what it raised for is not there at all; an id is stored with its events or not.
    """

    def append(
        self, events: Sequence[AnyEvent], *, id: str | None = None, answer: object = None
    ) -> range:
        """Store events that happen together, all or none; return their sequence numbers.

        Parameters
        ----------
        events
            In order; may be empty.
        id, answer
            The id of the command that they carry out, and what is answered to it, as JSON has it:
            `known` gives it to whoever sends the command again.

        Raises
        ------
        BadInput
            If the id was used before, or a value has no JSON.
        StoreError
            If they cannot be stored.
        """
        ...

    def replay(self, since: int = 0) -> list[AnyEvent]:
        """Return the events from a sequence number on."""
        ...

    def known(self, id: str) -> Answer | None:
        """Return what was answered to the command with this id; None if there was none."""
        ...

    def close(self) -> None:
        """Let go of the journal; may be called twice."""
        ...


@dataclass(frozen=True, slots=True)
class Answer:
    """What a command was answered, and the sequence numbers of its own events."""

    events: range
    value: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """How a mission began.

    Attributes
    ----------
    files
        The mission file, then the files of its map, by their paths relative to each other.
    allocator, makespan_weight, seconds, seed, points
        As for `oath.run`.
    """

    files: Mapping[str, bytes]
    allocator: str
    makespan_weight: float | None = None
    seconds: float | None = None
    seed: int = 0
    points: int = 1000

    @classmethod
    def of(cls, path: str | Path, **settings: Any) -> Origin:
        """Take up a mission file, the files of its map, and the settings.

        Raises
        ------
        BadInput
            If a file is missing or broken.
        """
        # Their places relative to each other are kept, for they name each other so.
        paths = [Path(os.path.abspath(one)) for one in mission_file.files(path)]
        folder = os.path.commonpath([one.parent for one in paths])
        files = {one.relative_to(folder).as_posix(): read_bytes(one) for one in paths}
        return cls(files=files, **settings)

    @property
    def name(self) -> str:
        """Path of the mission file."""
        return next(iter(self.files))

    def mission(self) -> Mission:
        """Read the mission.

        Raises
        ------
        BadInput
            If it is none.
        """
        with TemporaryDirectory() as folder:
            for name, data in self.files.items():
                if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
                    raise BadInput(f"holds a file outside of its folder: {name!r}")
                path = Path(folder, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(data)
            try:
                mission = mission_file.load(Path(folder, self.name))
            except BadInput as error:
                raise BadInput(
                    error.problem, file=self.name, field=error.field, remedy=error.remedy
                ) from None
            return replace(mission, source=self.name)

    def state(self, mission: Mission) -> State:
        """Return the state before anything happened."""
        chosen = named(self.allocator, makespan_weight=self.makespan_weight)
        return State.of(mission, reconsiders=chosen.reconsiders)


def replayed(state: State, events: Iterable[AnyEvent]) -> State:
    """Return the state after events.

    Law: ``replayed(replayed(s, a), b) == replayed(s, a + b)``.
    """
    for _, after, _ in fold(state, events):
        state = after
    return state
