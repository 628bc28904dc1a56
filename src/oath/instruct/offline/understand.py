"""What an instruction asks for: one command or several, or a question about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pydantic import ValidationError

from oath.commands import COMMANDS, Command
from oath.instruct import Reply
from oath.instruct.offline import gates, questions, slots
from oath.instruct.offline.features import classes
from oath.instruct.offline.heard import Filled, Heard
from oath.instruct.offline.new_task import asked_priority, said_priority
from oath.instruct.offline.tokens import Token

CLEAR = 0.8
"""How probably clear an instruction must be to be acted on, if it is no order in plain words."""

LONGEST, SURE = 12, 0.9
"""Tokens of an order in plain words at most, and how sure its intent must be."""

ABOUT = {
    "add_task": "add a task",
    "obstacle_update": "mark an obstacle",
    "change_task_priority": "change a task's priority",
    "cancel_task": "cancel a task",
    "remove_obstacle": "remove an obstacle",
    "pause_robot": "pause a robot",
    "resume_robot": "let a robot go on",
    "robot_failed": "count out a robot that failed",
    "query_status": "tell the status",
    "undo": "undo the last change",
}

NEEDS: Mapping[str, frozenset[str]] = {
    "add_task": frozenset({"point", "place"}),
    "obstacle_update": frozenset({"point"}),
    "change_task_priority": frozenset({"label"}),
    "cancel_task": frozenset({"label"}),
    "remove_obstacle": frozenset({"obstacle"}),
    "pause_robot": frozenset({"robot"}),
    "resume_robot": frozenset({"robot"}),
    "robot_failed": frozenset({"robot"}),
}
"""What an instruction of its own names, by intent."""


@dataclass(frozen=True, slots=True)
class Meant:
    """The intent of words: the most probable one that acts, and how sure that is."""

    intent: str
    share: float
    second: str
    other: float


def meaning(heard: Heard) -> Meant:
    """What the trained model makes of an instruction."""
    shares = heard.models.intents(heard.tokens)
    other = shares.pop("other", 0.0)
    ranked = sorted(shares, key=lambda one: -shares[one])
    return Meant(ranked[0], shares[ranked[0]], ranked[1], other)


def understand(heard: Heard) -> Reply:
    """Make commands of an instruction that stands on its own, or ask."""
    if why := gates.refused(heard.line):
        return Reply(status="clarification", message=why)
    if not any(one.kind not in ("mark", "number") for one in heard.tokens):
        return nothing(heard)
    heard = replace(heard, tokens=gates.without_rest(heard.tokens))
    parts = commands_of(heard)
    if len(parts) == 1:
        return _one(parts[0])
    return _several(parts)


def nothing(heard: Heard) -> Reply:
    """Say what can be said."""
    place = next(iter(heard.live.scene.mission.places), "(6, 3)")
    return Reply(
        status="clarification",
        message="I take no instruction from that. I can add or cancel a task, change its priority, "
        "mark or remove an obstacle, pause or resume a robot, count out a failed one, tell the "
        f"status, and undo; e.g. 'new task at (5, 19.5), take it to {place}'.",
    )


def _one(heard: Heard) -> Reply:
    """One command, or a question about it."""
    meant = meaning(heard)
    if meant.other > max(meant.share, 0.7) or meant.share < 0.2:
        return nothing(heard)
    filled = slots.fill(meant.intent, heard)
    reply = answer(heard, meant.intent, filled)
    if reply.status != "complete":
        return reply
    plain = meant.intent == "pause_robot" and _is_plain(heard)
    if plain or is_clear(heard, meant, filled):
        return replace(reply, plain=plain)
    if filled.doubt is not None:
        filled.object_to(filled.doubt[1], filled.doubt[0])
        return answer(heard, meant.intent, filled)
    why = gates.reason(heard.tokens, heard.models.concepts) or "I am not sure of that."
    return Reply(
        status="clarification",
        intent=meant.intent,
        parameters=reply.parameters,
        message=f"{why} Say it plainly if I shall {ABOUT[meant.intent]}.",
    )


_PLAIN = frozenset({
    "stop", "pause", "halt", "hold", "freeze", "wait", "stand", "still", "stay", "where", "you",
    "are", "it", "put", "on", "position", "now", "please", "robot", "robots", "immediately",
    "at", "once", "right", "away", "emergency",
})  # fmt: skip
"""Words of a pause that says nothing else."""


def _is_plain(heard: Heard) -> bool:
    return all(
        one.kind == "robot" or (one.text in _PLAIN if one.kind == "word" else one.text in ",.!")
        for one in heard.tokens
    )


def is_clear(heard: Heard, meant: Meant, filled: Filled) -> bool:
    """Whether an instruction is to be acted on as it was understood."""
    if gates.forbids(heard.line, meant.intent):
        return False
    if meant.share > SURE and _is_plain_order(heard, meant.intent):
        return True
    return heard.models.clarity(heard.tokens, meant.intent, signs(heard, meant, filled)) > CLEAR


_ORDERS: Mapping[str, frozenset[str]] = {
    "add_task": frozenset({"point", "place", "type", "kind"}),
    "change_task_priority": frozenset({"label", "point", "place", "type"}),
    "cancel_task": frozenset({"label", "point", "place", "type"}),
    "pause_robot": frozenset({"robot"}),
    "resume_robot": frozenset({"robot"}),
    "undo": frozenset(),
}
"""Intents that are orders, and what they may name."""

_ASK = frozenset({
    "is", "are", "am", "was", "does", "did", "has", "have", "do", "who", "what", "why", "which",
    "how", "should", "shall",
})  # fmt: skip
"""Words with which a question begins."""

_NOT_PLAIN = frozenset({
    "never", "not", "no", "nobody", "did", "does", "was", "were", "had", "would", "should",
    "could", "might", "may", "must", "if", "when", "while", "once", "said", "says", "told", "think",
    "thinks", "almost", "nearly", "hardly", "ever", "tomorrow", "yesterday", "ago", "already",
    "used", "moment", "there", "soon", "later", "everything", "what", "it", "them", "stops",
    "stopped", "waits", "waited", "pauses", "paused", "keeps", "others",
})  # fmt: skip
"""Words with which an order may be none, or not a plain one."""


def _is_plain_order(heard: Heard, intent: str) -> bool:
    """Whether an instruction is a short order in words of the templates that raise no doubt."""
    trained = heard.models
    words = [one.text for one in heard.tokens if one.kind == "word"]
    named = {one.kind for one in heard.tokens} - {"word", "mark"}
    if intent == "change_task_priority" and not _says_priority(heard):
        return False
    return (
        intent in _ORDERS
        and named <= _ORDERS[intent]
        and len(heard.tokens) <= LONGEST
        and all(one in trained.everyday and one not in _NOT_PLAIN for one in words)
        and heard.tokens[0].text not in _ASK
        and all(one.text != "?" for one in heard.tokens)
        and gates.reason(heard.tokens, trained.concepts) is None
    )


_PRIORITIES = {"@urgent_", "@relaxed_", "@usual_", "@more_", "@less_"}


def _says_priority(heard: Heard) -> bool:
    """Whether words name a priority, or say which way it changes."""
    return bool(
        said_priority(heard.line) or _PRIORITIES & classes(heard.tokens, heard.models.concepts)
    )


def signs(heard: Heard, meant: Meant, filled: Filled) -> set[str]:
    """What may make an instruction unclear, besides its words."""
    found = {f"!{one}" for one in filled.signs}
    found |= {f"!sure {step}" for step in (0.5, 0.7, 0.85, 0.95, 0.99) if meant.share < step}
    if meant.other > 0.1:
        found.add("!other")
    numbers = sum(one.kind == "number" for one in heard.tokens)
    strange = sum(
        one.kind == "word" and one.text.isalpha() and one.text not in heard.models.known
        for one in heard.tokens
    )
    found |= {f"!numbers {n}" for n in range(1, min(numbers, 3) + 1)}
    found |= {f"!strange {n}" for n in range(1, min(strange, 4) + 1)}
    if any(one.quoted for one in heard.tokens):
        found.add("!quoted")
    return found


def answer(heard: Heard, intent: str, filled: Filled) -> Reply:
    """A proposal if all is known, else the question that comes first."""
    shown = dict(filled.parameters)
    asked = tuple(filled.missing)
    if filled.trouble:
        return Reply(
            status="clarification",
            intent=intent,
            parameters=shown,
            missing=asked,
            message=filled.trouble,
        )
    if asked:
        return Reply(
            status="need_more_info",
            intent=intent,
            parameters=shown,
            missing=asked,
            message=_so_far(heard, intent, filled) + questions.ask(heard, asked),
        )
    try:
        commands = _commands(intent, filled)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        return Reply(
            status="clarification",
            intent=intent,
            parameters=shown,
            message=f"{where}: {first['msg']}. Say it in other words.",
        )
    return Reply(
        status="complete",
        intent=intent,
        parameters=shown or _first(commands),
        commands=commands,
        message=f"Shall I {ABOUT[intent]}?",
    )


def _first(commands: Sequence[Command]) -> dict[str, Any]:
    return commands[0].model_dump(mode="json", exclude_none=True)


def _so_far(heard: Heard, intent: str, filled: Filled) -> str:
    points = filled.parameters.get("obstacle_location", [])
    if intent == "obstacle_update" and len(points) == 1:
        x, y = points[0]
        return f"One point, ({x:g}, {y:g}), is not enough. "
    return ""


def _commands(intent: str, filled: Filled) -> tuple[Command, ...]:
    """The commands of one instruction: one for each value of a list."""
    make = COMMANDS[intent].model_validate
    if not filled.several:
        return (make(filled.parameters),)
    name = next(
        one for one in ("task_label", "robot", "obstacle") if one in COMMANDS[intent].model_fields
    )
    return tuple(make({**filled.parameters, name: one}) for one in filled.several)


# -- several commands in one sentence

_BREAKS = {".", ";", "!", ","}
_LINKS = {"and", "then", "also", "plus", "but", "next", "furthermore", "additionally"}


def commands_of(heard: Heard) -> list[Heard]:
    """Divide an instruction where another command begins."""
    pieces = _pieces(heard.tokens)
    groups: list[list[Token]] = []
    for piece in pieces:
        if groups and _begins(heard, groups[-1], piece):
            groups.append([one for one in piece if one.text not in _LINKS])
        elif groups:
            groups[-1] += piece
        else:
            groups.append(list(piece))
    return [replace(heard, tokens=tuple(group)) for group in groups]


def _pieces(tokens: Sequence[Token]) -> list[list[Token]]:
    pieces: list[list[Token]] = [[]]
    for n, token in enumerate(tokens):
        ends = token.kind in ("mark", "word") and token.text in _BREAKS | _LINKS
        if (
            ends
            and token.text in _LINKS
            and pieces[-1]
            and len(pieces) < 12
            and n + 1 < len(tokens)
        ):
            pieces.append([token])
        elif ends and token.text in _BREAKS and pieces[-1] and len(pieces) < 12:
            pieces[-1].append(token)
            pieces.append([])
        else:
            pieces[-1].append(token)
    return [piece for piece in pieces if piece]


def _begins(heard: Heard, before: Sequence[Token], piece: Sequence[Token]) -> bool:
    """Whether a piece of an instruction is a command of its own, and so is what stands before."""
    if sum(one.kind == "word" and one.text not in _LINKS for one in piece) < 1:
        return False
    while piece and piece[0].text in _LINKS:
        piece = piece[1:]
    parts = [replace(heard, tokens=tuple(one)) for one in (before, piece)]
    first, second = map(meaning, parts)
    if second.share < (0.75 if second.intent in NEEDS else 0.95) or first.share < 0.6:
        return False
    if not (_stands(first.intent, before) and _stands(second.intent, piece)):
        return False
    if first.intent != second.intent:
        return True
    if first.intent == "change_task_priority":
        asked = [asked_priority(one, Filled(), first.intent) for one in parts]
        return None not in asked and asked[0] != asked[1]
    return first.intent == "add_task" and _whole(before) and _whole(piece)


def _stands(intent: str, tokens: Sequence[Token]) -> bool:
    kinds = {one.kind.removeprefix("unknown_") for one in tokens}
    if intent == "obstacle_update":
        return sum(one.kind == "point" for one in tokens) >= 2
    if intent == "add_task":
        return _whole(tokens)
    return intent not in NEEDS or bool(NEEDS[intent] & kinds)


def _whole(tokens: Sequence[Token]) -> bool:
    return sum(one.kind in ("point", "place", "unknown_place") for one in tokens) >= 2


def _several(parts: Sequence[Heard]) -> Reply:
    """Several commands, or a question about the first that is not clear."""
    replies = [_one(part) for part in parts]
    for reply in replies:
        if reply.status != "complete":
            others = [ABOUT[one.intent] for one in replies if one is not reply and one.intent]
            say = (
                f"{reply.message} Then all at once: besides, {', '.join(others)}."
                if others
                else reply.message
            )
            return replace(reply, status="clarification", message=say)
    commands = tuple(command for reply in replies for command in reply.commands)
    plain = all(reply.plain for reply in replies if reply.intent == "pause_robot")
    return replace(replies[0], commands=commands, message="Shall I do all of this?", plain=plain)
