"""Words to a clarified, confirmed command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, Protocol

from oath.commands import Command, Live

Status = Literal["complete", "need_more_info", "clarification"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """What the dialogue is about so far: a question is open, or a proposal not yet confirmed."""

    intent: str
    parameters: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    missing: tuple[str, ...] = ()
    """Parameters that were asked for; empty if a proposal awaits confirmation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialogue:
    """What an operator has said, the newest last, and what is open."""

    said: tuple[str, ...]
    draft: Draft | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """What an interpreter makes of the newest words.

    Attributes
    ----------
    status
        ``complete``: `commands` say what is meant. ``need_more_info``: `missing` parameters are
        asked for. ``clarification``: something is ambiguous, unknown or not to be done; with no
        `intent`, the dialogue starts anew.
    intent, parameters
        Of the first command, as far as they are understood; values are those of the live world.
    message
        To the operator: a question about exactly what is missing, with an example, or a reason.
    commands
        Several, if one sentence asks for several. They have not passed the gate yet.
    """

    status: Status
    message: str
    intent: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    missing: tuple[str, ...] = ()
    commands: tuple[Command, ...] = ()


class Interpreter(Protocol):
    """Makes commands of words.

    Law: it changes nothing and confirms nothing, invents no value, and never raises for any text.
    """

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        """Interpret the newest words in the light of what is open."""
        ...
