"""A script of what is said and done during a mission: a YAML list of timed entries.

.. code-block:: yaml

    - {at: 12.5, say: "new task at (5, 19.5), take it to c"}
    - {at: 20, do: {intent: pause_robot, parameters: {robot: robot2}}}
    - {at: 25, say: "cancel task bb", confirm: false}
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import model_validator

from oath.formats.fields import Flag, Section, Text, number, validate, wrong
from oath.formats.yaml_document import Document, read_document


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """What happens at a time `at` [s]: words are said, or a command is given as plain data.

    A proposal that comes of it is confirmed, unless `confirm` is False. `where` names the file and
    the line.
    """

    at: float
    say: str | None
    do: dict[str, Any] | None
    confirm: bool
    where: str


class _Entry(Section):
    at: Annotated[float, number("s", least=0)]
    say: Text | None = None
    do: dict[str, Any] | None = None
    confirm: Flag = True

    @model_validator(mode="after")
    def _one(self) -> _Entry:
        if (self.say is None) == (self.do is None):
            raise wrong("must have either `say` or `do`", "write {at: 5, say: ...}")
        return self


def read(path: str | Path) -> list[Entry]:
    """Read a script; its entries come in the order of their times.

    Raises
    ------
    BadInput
        For the first thing that is wrong, with its line.
    """
    document = read_document(Path(path), what="script", top=yaml.SequenceNode)
    entries = []
    for value, node in zip(document.value, document.root.value, strict=True):
        part = Document(file=document.file, value=value, root=node)
        entry = validate(_Entry, part)
        entries.append(
            Entry(
                at=entry.at,
                say=entry.say,
                do=entry.do,
                confirm=entry.confirm,
                where=f"{document.file}:{node.start_mark.line + 1}",
            )
        )
    return sorted(entries, key=lambda entry: entry.at)
