"""Words to a clarified, confirmed command."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, Protocol

from oath.commands import Command, Live
from oath.errors import BadInput

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
    plain
        The words say nothing but the commands, so what is immediate may happen unconfirmed.
    note
        What the operator must hear besides, whatever becomes of the reply: that a language model
        did not answer.
    """

    status: Status
    message: str
    intent: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    missing: tuple[str, ...] = ()
    commands: tuple[Command, ...] = ()
    plain: bool = False
    note: str = ""


class Interpreter(Protocol):
    """Makes commands of words.

    Law: it changes nothing and confirms nothing, invents no value, and never raises for any text.
    """

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        """Interpret the newest words in the light of what is open."""
        ...


def chosen_interpreter(
    environ: Mapping[str, str],
    *,
    model: str | None = None,
    url: str | None = None,
    timeout: float | None = None,
    hosts: Iterable[str] = (),
) -> Interpreter:
    """The offline interpreter, or a language model before it if one is configured.

    Parameters
    ----------
    environ
        The environment: ``OATH_LLM_MODEL``, ``OATH_LLM_URL``, ``OATH_LLM_TIMEOUT``,
        ``OATH_LLM_HOSTS`` (separated by commas) stand in for what is not given; keys come from
        ``OATH_LLM_KEY`` or the provider's usual variable.
    model
        ``PROVIDER:NAME``; ``none`` for no model.
    url
        The model's address.
    timeout
        How long the model may take [s].
    hosts
        Hosts that may be sent words and keys, beyond those listed from the start.

    Raises
    ------
    BadInput
        If the configuration cannot be used, or the extra ``llm`` is not installed.
    """
    from oath.instruct.offline import Offline

    model = model or environ.get("OATH_LLM_MODEL") or "none"
    if model == "none":
        return Offline()
    try:
        from oath.instruct.model.endpoint import TIMEOUT, endpoint, opened, seconds

        listed = [*hosts, *environ.get("OATH_LLM_HOSTS", "").split(",")]
        where = endpoint(
            environ,
            model=model,
            url=url or environ.get("OATH_LLM_URL") or None,
            hosts=[host.strip() for host in listed if host.strip()],
        )
        within = timeout or seconds(environ.get("OATH_LLM_TIMEOUT") or str(TIMEOUT))
        from oath.instruct.model import ModelInterpreter

        return ModelInterpreter(lambda: opened(where), Offline(), timeout=within)
    except ImportError:
        raise BadInput(
            "language models need more than is installed",
            field="llm",
            remedy="install oath-fleet[llm], or choose the model none",
        ) from None
