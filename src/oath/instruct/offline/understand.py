"""What an instruction asks for: one command or several, or a question about it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from pydantic import ValidationError

from oath.commands import COMMANDS, Command
from oath.instruct import Reply
from oath.instruct.offline import clear, gates, questions, slots, unheard
from oath.instruct.offline.heard import Filled, Heard
from oath.instruct.offline.names import NOUNS
from oath.instruct.offline.spelling import guarding
from oath.instruct.offline.tokens import Token

_ROOMY = ("add_task", "obstacle_update", "query_status")
"""Intents told with many words that do not matter, such as what is carried."""

_MANNERS = {
    "oh", "uh", "um", "er", "eh", "ah", "hmm", "huh", "yo", "both", "guys", "folks", "mate",
    "ta", "thx", "thnx", "ty", "tysm", "tks", "fr", "frfr", "ngl", "tbh", "lol", "lmao", "nvm",
    "omg", "bruh", "bro", "kk", "imo", "imho", "rn", "atm", "smh", "btw", "fyi", "aye", "och",
    "wee", "lad", "lads", "lassie", "poor", "dear", "bloody", "damn", "damned", "darn",
    "bleeding", "ruddy", "flipping", "freaking", "frigging", "stupid", "silly", "wretched",
    "pesky", "trusty", "faithful", "chaps", "gents", "chap", "fellas", "peeps", "yall", "lovely",
    "cheers", "sadly", "unfortunately", "alas", "luckily", "thankfully", "fortunately",
    "regrettably", "clearly", "obviously", "indeed", "literally", "simply", "kindly", "blasted",
    "blooming", "lousy", "rotten", "goddamn", "innit", "ye", "yer", "thee", "mon", "amigo",
    "amigos", "hombre", "cap'n", "skipper", "sarge", "guv", "gaffer", "squire", "milord",
    "ladies", "gentlemen", "team", "crew", "y'all",
}  # fmt: skip
"""Words that change nothing, wherever they stand."""

LIKELY = 0.6
"""How probable an intent must be to be acted on."""

SURE_PRIORITY = 0.8
"""How probable a change of priority must be for its wording alone to say which."""

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
    priority: str | None
    share: float
    second: str
    other: float


def meaning(heard: Heard) -> Meant:
    """What the trained model makes of an instruction."""
    shares: dict[str, float] = {}
    priorities: dict[str, float] = {}
    for name, share in heard.models.intents(heard.tokens).items():
        intent, _, priority = name.partition(":")
        shares[intent] = shares.get(intent, 0.0) + share
        if priority:
            priorities[priority] = share
    other = shares.pop("other", 0.0)
    ranked = sorted(shares, key=lambda one: -shares[one])
    priority = max(priorities, key=lambda one: priorities[one])
    sure = priorities[priority] >= 0.75 * sum(priorities.values())
    return Meant(ranked[0], priority if sure else None, shares[ranked[0]], ranked[1], other)


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
    if why := gates.conditional(heard.line):
        return Reply(status="clarification", message=f"{why} Say it plainly if it is meant.")
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
    if meant.other > max(meant.share, 0.4) or meant.share < 0.2:
        return nothing(heard)
    denied = gates.not_meant(heard.line, meant.intent)
    if denied is not None:
        kept = None if "not to do" in denied else meant.intent
        say = f"{denied} Say it plainly if I shall {ABOUT[meant.intent]}."
        return Reply(status="clarification", intent=kept, message=say)
    if why := clear.unclear(heard.line, meant.intent):
        say = f"{why} Say it plainly if I shall {ABOUT[meant.intent]}."
        return Reply(status="clarification", intent=meant.intent, message=say)
    if why := _in_one(heard, meant.intent):
        return Reply(status="clarification", intent=meant.intent, message=why)
    odd = len(unheard.strange(heard.tokens, heard.models.words)[0])
    foreign = meant.intent not in _ROOMY and unheard.foreign(
        heard.tokens,
        heard.models.words | guarding() | NOUNS["robot"] | _MANNERS,
        lambda clause: clear.means(clause, meant.intent),
    )
    if foreign:
        say = (
            f"I do not know the word '{foreign}'. Say it plainly if I shall {ABOUT[meant.intent]}."
        )
        return Reply(status="clarification", intent=meant.intent, message=say)
    doubt = meant.share < LIKELY + 0.1 * odd or gates.speaks_against(heard.line, meant.intent)
    if doubt:
        return Reply(
            status="clarification",
            intent=meant.intent,
            message=f"Shall I {ABOUT[meant.intent]} or {ABOUT[meant.second]}? Say it differently.",
        )
    told = meant.priority if meant.share >= SURE_PRIORITY else None
    filled = slots.fill(meant.intent, heard, told)
    if meant.intent == "add_task" and "priority" not in filled.parameters:
        _read_its_priority(heard, filled)
    return answer(heard, meant.intent, filled, sure=meant.share)


def _asides(heard: Heard) -> Iterator[Meant]:
    """What pieces mean that speak of *it* only, as ``then raise its priority``."""
    for piece in _pieces(heard.tokens)[1:]:
        words = {one.text for one in piece}
        if words & {"it", "its", "him", "that"} and all(
            one.kind in ("word", "mark") for one in piece
        ):
            meant = meaning(replace(heard, tokens=tuple(piece)))
            if meant.share > 0.6:
                yield meant


def _in_one(heard: Heard, intent: str) -> str | None:
    """Why an instruction that says two things of one is not clear."""
    alike = {intent, "add_task", "change_task_priority" if intent == "add_task" else intent}
    for meant in _asides(heard):
        if meant.intent not in alike and (meant.share > 0.8 or intent == "add_task"):
            return f"Shall I {ABOUT[intent]} or {ABOUT[meant.intent]}? One after the other, please."
    return None


def _read_its_priority(heard: Heard, filled: Filled) -> None:
    for meant in _asides(heard):
        if meant.intent == "change_task_priority":
            if meant.priority is None:
                filled.object_to("Which priority: low, normal or high?", "priority")
            else:
                filled.parameters["priority"] = meant.priority


def answer(heard: Heard, intent: str, filled: Filled, sure: float = 1.0) -> Reply:
    """A proposal if all is clear, else the question that comes first."""
    shown = dict(filled.parameters)
    asked = tuple(filled.missing)
    unclear = filled.trouble or gates.doubtful(heard.line, intent)
    if filled.trouble or (unclear and not asked):
        rest = [one for one in asked if not filled.trouble]
        say = " ".join(filter(None, (unclear, questions.ask(heard, rest))))
        return Reply(
            status="clarification", intent=intent, parameters=shown, missing=asked, message=say
        )
    if asked:
        return Reply(
            status="need_more_info",
            intent=intent,
            parameters=shown,
            missing=asked,
            message=_so_far(heard, intent, filled) + questions.ask(heard, asked),
        )
    if left := leftover(heard, intent):
        return Reply(status="clarification", intent=intent, parameters=shown, message=left)
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


def leftover(heard: Heard, intent: str) -> str | None:
    """What of an instruction no parameter has taken up, as a question."""
    points = sum(one.kind == "point" for one in heard.tokens)
    counted = {
        n
        for n, (one, behind) in enumerate(pairwise(heard.tokens))
        if one.value == points and behind.text in ("corners", "points", "vertices", "corner")
    }
    numbers = [
        one for n, one in enumerate(heard.tokens) if one.kind == "number" and n not in counted
    ]
    if numbers and intent not in ("query_status", "undo"):
        return (
            f"What is '{numbers[0].raw}'? I take points as pairs in metres, e.g. (5, 19.5); say it "
            "without other numbers."
        )
    odd, plain = unheard.strange(heard.tokens, heard.models.words)
    if len(odd) >= 3 or (len(odd) == 2 and plain <= 4):
        shown = ", ".join(repr(one) for one in odd[:4])
        return f"I do not know the words {shown}. Say it differently."
    return None


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
    first, second = (meaning(replace(heard, tokens=tuple(one))) for one in (before, piece))
    if second.share < 0.75 or first.share < 0.6:
        return False
    if not (_stands(first.intent, before) and _stands(second.intent, piece)):
        return False
    if first.intent != second.intent:
        return True
    if first.intent == "change_task_priority":
        return None not in (first.priority, second.priority) and first.priority != second.priority
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
    return replace(replies[0], commands=commands, message="Shall I do all of this?")
