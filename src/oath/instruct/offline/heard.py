"""An instruction in the light of the live world, and what is understood of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from oath.commands import Live
from oath.instruct.offline.gates import as_line
from oath.instruct.offline.model import Models
from oath.instruct.offline.names import Names
from oath.instruct.offline.tokens import Token


@dataclass(frozen=True, slots=True)
class Heard:
    """An instruction in the light of the live world."""

    tokens: tuple[Token, ...]
    live: Live
    names: Names
    models: Models

    @property
    def line(self) -> str:
        """As one line of words and tags."""
        return as_line(self.tokens)

    def of(self, *kinds: str) -> list[Token]:
        """The tokens of some kinds, each value once."""
        found: list[Token] = []
        for token in self.tokens:
            same = [one for one in found if (one.kind, one.value) == (token.kind, token.value)]
            if token.kind in kinds and (not same or token.value is None):
                found.append(token)
        return found


@dataclass(slots=True)
class Filled:
    """What is known of a command.

    Attributes
    ----------
    several
        Values of the one parameter that a list in the instruction gives, e.g. of two labels.
    missing
        Parameters to ask for.
    trouble
        A question or reason that keeps it from being proposed.
    doubt
        The parameter to ask for, and how, if the instruction turns out to be unclear.
    signs
        What in the reading may make it doubtful, for the model of what is clear.
    """

    parameters: dict[str, Any] = field(default_factory=dict)
    several: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    trouble: str = ""
    doubt: tuple[str, str] | None = None
    signs: set[str] = field(default_factory=set)

    def object_to(self, why: str, parameter: str | None = None) -> None:
        """Ask about the first thing that is wrong."""
        self.trouble = self.trouble or why
        if parameter is not None and parameter not in self.missing:
            self.missing.append(parameter)
            self.parameters.pop(parameter, None)
