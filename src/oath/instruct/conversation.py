"""From words to a change: proposals that are read back, and that only their operator confirms."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from oath.commands import Command, Live, QueryStatus, admit, to_plain
from oath.errors import BadInput
from oath.instruct import Dialogue, Draft, Interpreter, Reply

LIFETIME = 120.0
"""A proposal may be confirmed for so long [s, wall clock]."""

LENGTH = 2000
"""So much of what is said at once is listened to [characters]."""

YES = {
    *("yes", "y", "yes please", "yep", "yeah", "ok", "okay", "confirm", "confirmed", "i confirm"),
    *("do it", "yes do it", "go ahead", "yes go ahead", "affirmative", "approve", "approved"),
}
NO = {
    *("no", "n", "nope", "no thanks", "no thank you", "negative", "do not", "don't", "reject"),
    *("rejected", "discard", "drop it", "never mind", "nevermind", "forget it", "forget that"),
}
"""What confirms or rejects the proposal last read back; nothing else does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """Commands that wait for their operator.

    Attributes
    ----------
    id
        What confirms this proposal and no other.
    commands, says, effect
        The commands, each in plain words, and what they would do to the robots' routes.
    changes
        The world it was made for, see `State.changes`.
    expires
        Until when it may be confirmed [s, of the conversation's clock].
    """

    id: str
    commands: tuple[Command, ...]
    says: tuple[str, ...]
    effect: tuple[str, ...]
    changes: int
    expires: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What the operator hears: a reply, a proposal to confirm, or that something was done."""

    reply: Reply
    proposal: Proposal | None = None
    done: tuple[Command, ...] = ()


class Conversation:
    """One operator's dialogue with a running mission.

    Laws: a command is carried out only if its proposal is confirmed by its id or by a plain yes
    right after it was read back, once, before it expires, and while the world that it was made for
    has not changed; what makes things safer (`Command.immediate`) is carried out at once if it is
    plainly said.

    Parameters
    ----------
    interpreter
        Makes commands of words.
    live
        The mission as it is now.
    carry_out
        Applies commands that passed the gate; durable once it returns.
    preview
        Says what commands would do.
    clock
        Wall clock [s].
    """

    def __init__(
        self,
        interpreter: Interpreter,
        live: Callable[[], Live],
        carry_out: Callable[[Sequence[Command]], Any],
        *,
        preview: Callable[[Sequence[Command]], tuple[str, ...]] = lambda commands: (),
        clock: Callable[[], float] = time.monotonic,
        lifetime: float = LIFETIME,
    ) -> None:
        self._interpreter, self._live, self._carry_out = interpreter, live, carry_out
        self._preview, self._clock, self._lifetime = preview, clock, lifetime
        self._said: tuple[str, ...] = ()
        self._draft: Draft | None = None
        self.pending: Proposal | None = None
        self._read_back: Proposal | None = None  # what a plain yes or no is about

    def say(self, text: str) -> Answer:
        """Take up what the operator says."""
        heard = self.hear(text)
        return heard if isinstance(heard, Answer) else self.take(heard())

    def hear(self, text: str) -> Answer | Callable[[], Reply]:
        """Take up what the operator says, but leave the interpreting to the caller.

        Returns
        -------
        The answer, or what asks the interpreter: that may last, so it may be called in any thread.
        `take` makes the answer of its reply.
        """
        words = _plain(text)
        read_back, self._read_back = self._read_back, None
        if read_back is not None and _folded(words) in YES:
            return self._confirmed(read_back)
        if read_back is not None and _folded(words) in NO:
            self._drop()
            return Answer(reply=Reply(status="clarification", message="Dropped; nothing changed."))
        # Something else was said, so a yes from now on does not mean what was read back before:
        # that can still be confirmed by its id.
        self._said = (*self._said, words)[-20:]
        dialogue = Dialogue(said=self._said, draft=self._draft)
        return partial(self._interpreter.interpret, dialogue, self._live())

    def take(self, reply: Reply) -> Answer:
        """Propose what the interpreter understood, or let it ask."""
        answer = self._taken(reply)
        if not reply.note:
            return answer
        message = f"{reply.note} {answer.reply.message}"
        return replace(answer, reply=replace(answer.reply, message=message))

    def _taken(self, reply: Reply) -> Answer:
        if reply.status == "complete" and reply.commands:
            return self._propose(reply)
        self._drop()
        if reply.intent is not None:
            self._draft = Draft(
                intent=reply.intent, parameters=dict(reply.parameters), missing=reply.missing
            )
        else:
            self._said = ()
        return Answer(reply=reply)

    def propose(self, commands: Sequence[Command]) -> Answer:
        """Read commands back that came without words, as from the tools of a map."""
        self._said = ()
        return self._propose(_complete(commands))

    def confirm(self, id: str) -> Any:
        """Carry out the proposal with this id; return what `carry_out` returned.

        Raises
        ------
        BadInput
            If it is not the one last read back, was used or has expired, or if the world has
            changed since: then nothing has happened.
        """
        proposal = self.pending
        if proposal is None or not secrets.compare_digest(proposal.id.encode(), id.encode()):
            raise BadInput("there is no such proposal to confirm", remedy="say it again")
        self._drop()
        if self._clock() > proposal.expires:
            raise BadInput("the proposal has expired", remedy="say it again")
        if self._live().state.changes != proposal.changes:
            raise BadInput("the mission has changed since this was proposed", remedy="say it again")
        return self._carry_out(proposal.commands)

    def reject(self, id: str) -> None:
        """Drop the proposal with this id.

        Raises
        ------
        BadInput
            If it is not the one last read back.
        """
        if self.pending is None or self.pending.id != id:
            raise BadInput("there is no such proposal", remedy="nothing is to be done")
        self._drop()

    # -- inside

    def _drop(self) -> None:
        self.pending, self._read_back, self._draft = None, None, None

    def _confirmed(self, proposal: Proposal) -> Answer:
        reply = _complete(proposal.commands)
        try:
            self.confirm(proposal.id)
        except BadInput as error:
            again = self._propose(reply)
            message = f"{_sentence(error)} {again.reply.message}"
            return replace(again, reply=replace(again.reply, message=message))
        done = "Done: " + "; ".join(proposal.says) + "."
        return Answer(reply=replace(reply, message=done), done=proposal.commands)

    def _propose(self, reply: Reply) -> Answer:
        """Carry out what is immediate and plainly said or changes nothing; read the rest back."""
        at_once = tuple(one for one in reply.commands if self._is_immediate(one, reply))
        rest = tuple(one for one in reply.commands if one not in at_once)
        try:
            done = admit(self._live(), at_once)
            if done.events:
                self._carry_out(at_once)
                self._drop()
                self._note(done.commands)
            if not rest:
                return Answer(
                    reply=replace(reply, message="\n".join(done.says)), done=done.commands
                )
            admitted = admit(self._live(), rest)
            effect = self._preview(admitted.commands)
        except BadInput as error:
            self._drop()
            refusal = _refusal(error, reply)
            if refusal.missing:
                self._draft = Draft(
                    intent=reply.commands[0].intent,
                    parameters=refusal.parameters,
                    missing=refusal.missing,
                )
            return Answer(reply=refusal)
        self.pending = self._read_back = Proposal(
            id=secrets.token_urlsafe(12),
            commands=admitted.commands,
            says=admitted.says,
            effect=effect,
            changes=self._live().state.changes,
            expires=self._clock() + self._lifetime,
        )
        self._note(admitted.commands)
        lines = "; ".join((*done.says, *admitted.says, *effect))
        message = f"{lines[:1].upper()}{lines[1:]}. Confirm?"
        read_back = replace(reply, message=message, commands=admitted.commands)
        return Answer(reply=read_back, proposal=self.pending, done=at_once)

    def _is_immediate(self, command: Command, reply: Reply) -> bool:
        return command.immediate and (reply.plain or isinstance(command, QueryStatus))

    def _note(self, commands: Sequence[Command]) -> None:
        """Remember what may be corrected next: one command that was read back or done."""
        self._draft = None
        if len(commands) == 1:
            plain = to_plain(commands[0])
            self._draft = Draft(intent=plain["intent"], parameters=plain["parameters"])


def _plain(text: str) -> str:
    """Return what was said without control characters, cut to a length that is listened to."""
    return "".join(c if c.isprintable() else " " for c in text[:LENGTH]).strip()


def _folded(words: str) -> str:
    return " ".join(words.casefold().replace(",", " ").strip(" .!").split())


def _complete(commands: Sequence[Command]) -> Reply:
    """Return the reply that these commands are what is meant."""
    plain = to_plain(commands[0])
    return Reply(
        status="complete",
        message="",
        intent=plain["intent"],
        parameters=plain["parameters"],
        commands=tuple(commands),
        plain=True,
    )


def _refusal(error: BadInput, reply: Reply) -> Reply:
    """Return why commands cannot be carried out; what is wrong may be given anew."""
    single = len(reply.commands) == 1 and error.field in type(reply.commands[0]).model_fields
    open_ = single and getattr(reply.commands[0], str(error.field)) is None
    left = {key: value for key, value in reply.parameters.items() if key != error.field}
    return Reply(
        status="need_more_info" if open_ else "clarification",
        message=_sentence(error),
        intent=reply.intent,
        parameters=left if single else reply.parameters,
        missing=(str(error.field),) if single else (),
    )


def _sentence(error: BadInput) -> str:
    text = f"{error.problem}; {error.remedy}." if error.remedy else f"{error.problem}."
    return text[:1].upper() + text[1:]
