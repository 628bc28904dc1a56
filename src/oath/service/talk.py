"""Conversations of operators with the mission, one for each of their windows."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from pydantic_core import to_jsonable_python

from oath.commands import Command, to_plain
from oath.errors import BadInput
from oath.instruct import Interpreter, Reply
from oath.instruct.conversation import Answer, Conversation
from oath.service.owner import Owner

WINDOWS = 64
"""So many conversations are kept; the one silent for longest is forgotten first."""


class Talks:
    """The conversations with a mission; to be used in the mission's thread only.

    Parameters
    ----------
    owner
        Runs the mission.
    interpreter
        Makes an interpreter of words, for each conversation its own.
    """

    def __init__(self, owner: Owner, interpreter: Callable[[], Interpreter]) -> None:
        self._owner, self._interpreter = owner, interpreter
        self._talks: dict[str, Conversation] = {}
        self._id: str | None = None

    def hear(self, window: str, text: str) -> dict[str, Any] | Callable[[], Reply]:
        """Take up what an operator says; return the reply as plain data, or what makes it.

        That may last, so it is to be called in another thread; `take` makes plain data of it.
        """
        self._open()
        heard = self._of(window).hear(text)
        return self._plain(heard) if isinstance(heard, Answer) else heard

    def take(self, window: str, reply: Reply) -> dict[str, Any]:
        """Propose what was understood, or ask; return the reply as plain data."""
        self._open()
        return self._plain(self._of(window).take(reply))

    def propose(self, window: str, commands: Sequence[Command]) -> dict[str, Any]:
        """Read typed commands back; return the reply as plain data."""
        self._open()
        return self._plain(self._of(window).propose(commands))

    def confirm(self, window: str, proposal: str) -> tuple[int, bool]:
        """Carry out a proposal; return the number of the event that ends it.

        Raises
        ------
        BadInput
            If it cannot be confirmed, or not any more.
        """
        self._open()
        self._id = f"proposal:{proposal}"
        try:
            if (known := self._owner.known(self._id)) is not None:
                raise BadInput(f"it was confirmed already, as event {known}", remedy="say it again")
            self._of(window).confirm(proposal)
        finally:
            self._id = None
        return self._owner.last, False

    def reject(self, window: str, proposal: str) -> None:
        """Drop a proposal.

        Raises
        ------
        BadInput
            If there is none of this id.
        """
        self._of(window).reject(proposal)

    def _open(self) -> None:
        if self._owner.runtime.state.finished:
            raise BadInput("the mission is over", remedy="start another")

    def _of(self, window: str) -> Conversation:
        talk = self._talks.pop(window, None)
        if talk is None:
            runtime = self._owner.runtime
            talk = Conversation(
                self._interpreter(), runtime.live, self._carry_out, preview=runtime.preview
            )
        self._talks[window] = talk
        if len(self._talks) > WINDOWS:
            del self._talks[next(iter(self._talks))]
        return talk

    def _carry_out(self, commands: Sequence[Command]) -> tuple[int, bool]:
        return self._owner.command(commands, source="operator", id=self._id)

    def _plain(self, answer: Answer) -> dict[str, Any]:
        reply, proposal = answer.reply, answer.proposal
        return {
            "status": reply.status,
            "intent": reply.intent,
            "parameters": _jsonable(reply.parameters),
            "missing": list(reply.missing),
            "message": reply.message,
            "proposal": proposal
            and {
                "id": proposal.id,
                "commands": [to_plain(command) for command in proposal.commands],
                "says": list(proposal.says),
                "effect": list(proposal.effect),
                "expires_in": max(round(proposal.expires - time.monotonic(), 1), 0.0),
            },
            "done": {"seq": self._owner.last} if answer.done else None,
        }


def _jsonable(parameters: Any) -> dict[str, Any]:
    plain: dict[str, Any] = to_jsonable_python(dict(parameters))
    return plain
