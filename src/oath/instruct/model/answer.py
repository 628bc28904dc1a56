"""What is made of a language model's answer: commands that were said, or a question.

Nothing of what a model writes is taken over unseen. An answer is read strictly; a command is parsed
by its class, filled from the live world and traced back to the operator's words value by value.
What the operator is told is written here, never by the model.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from oath.commands import COMMANDS, Command, Live, parse, to_plain
from oath.errors import BadInput
from oath.instruct import Dialogue, Draft, Reply
from oath.instruct.model.grounding import (
    EVERY,
    along_axes,
    name_said,
    number_said,
    numbers,
    point_said,
    priority_said,
    words,
)
from oath.instruct.model.prompt import REFUSALS
from oath.model import Point, Priority

_NOT = re.compile(
    r"\b(?:do not|don['’]?t|must not|mustn['’]?t|never)\b"
    r"(?! (?:bother|care|count|forget|mind|need|rely|wait|want|worry)\b)",
    re.IGNORECASE,
)
"""What turns an instruction round; a model that overlooks it would do the opposite."""

MOST = 4
"""Commands taken from one instruction."""

_QUESTIONS = {
    "location": "Where is it picked up? For example: at (5, 19.5).",
    "delivery_point": "Where is it to be taken? For example: to {place}, or to (3, 4).",
    "obstacle_location": "Where exactly is it? For example: from (7, 5) to (8, 5), or the corners "
    "of its outline in order.",
    "task_label": "Which task is meant? For example: task {task}.",
    "task_type": "Of which type is it? For example: {type}.",
    "priority": "Which priority: low, normal or high?",
    "obstacle": "Which obstacle is meant? For example: {obstacle}.",
    "obstacle_type": "Of which kind is it? For example: wall.",
    "robot": "Which robot is meant? For example: {robot}, or all.",
}

_CUES = {
    "undo": frozenset(words("back reverse revert rollback scrap undo")),
    "query_status": frozenset(
        words(
            "doing done far going how left many progress report state status what when where "
            "which who"
        )
    ),
}
"""One of these must be said: these commands have no value that tells a mistake."""

_PLAINLY = {
    "undo": "undo the last change",
    "query_status": "status",
    "pause_robot": "pause {robot}",
}


class Unusable(Exception):
    """A model's answer has not the form that was asked for."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A model's answer, read but not believed: a verdict, and intents with parameters."""

    verdict: str
    continues: bool
    commands: tuple[tuple[str, dict[str, Any]], ...]


def read(text: str) -> Answer:
    """Read an answer.

    Raises
    ------
    Unusable
        If it is not of the form that was asked for.
    """
    try:
        # Python's integers have no bound that the rest of the code would expect.
        plain = json.loads(text, parse_int=float, parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise Unusable from None
    match plain:
        case {"verdict": str(verdict), "about": "new" | "draft" as about, "commands": list(found)}:
            pass
        case _:
            raise Unusable
    if verdict not in ("command", *REFUSALS) or len(found) > MOST:
        raise Unusable
    if (verdict == "command") != bool(found):
        raise Unusable
    return Answer(verdict, about == "draft", tuple(map(_read_command, found)))


def _no_number(name: str) -> float:
    raise ValueError(name)


def _read_command(found: Any) -> tuple[str, dict[str, Any]]:
    match found:
        case {"intent": str(intent), "parameters": dict(parameters), **rest} if not rest:
            if intent in COMMANDS and parameters.keys() <= COMMANDS[intent].model_fields.keys():
                given = {name: part for name, part in parameters.items() if part is not None}
                return intent, given
    raise Unusable


def judge(answer: Answer, dialogue: Dialogue, live: Live) -> Reply:
    """Make of an answer what may be proposed to the operator, or a question."""
    if answer.verdict != "command" or _NOT.search(dialogue.said[-1]):
        reason = "negated" if answer.verdict == "command" else answer.verdict
        return Reply(status="clarification", message=_with_names(REFUSALS[reason], live))
    draft = dialogue.draft
    said, commands = dialogue.said[-1], []
    for intent, parameters in answer.commands:
        base = draft if draft is not None and draft.intent == intent else None
        if base is not None and answer.continues and len(answer.commands) == 1:
            parameters = {**base.parameters, **parameters}
        outcome = _judge_one(intent, parameters, said, base, live)
        if isinstance(outcome, Reply):
            return outcome
        commands.append(outcome)
    if left := _left_out(said, commands, live):
        return Reply(
            status="clarification",
            message=f"I cannot place {left!r} in what you said. Please say it again, in one simple "
            "sentence for each thing to be done.",
        )
    first = to_plain(commands[0])
    return Reply(
        status="complete",
        intent=first["intent"],
        parameters=first["parameters"],
        message="",
        commands=tuple(commands),
    )


def settle(reply: Reply, other: Reply, live: Live) -> Reply:
    """Return a reply in the light of another interpreter's.

    What the other understood completely needs no question; but if both understood something and
    not the same, the operator is asked.
    """
    if reply.status == "need_more_info" and other.status == "complete":
        return other if other.intent == reply.intent else reply
    if reply.status != "complete" or other.status != "complete":
        return reply
    try:
        ways = [[one.filled(live) for one in way.commands] for way in (reply, other)]
        if ways[0] == ways[1]:
            return reply
        said = [", ".join(one.says(live) for one in way) for way in ways]
    except BadInput:
        return reply
    return Reply(
        status="clarification",
        message=f"I can read that in two ways: one {said[0]}; the other {said[1]}. Please say it "
        "in other words.",
    )


def _judge_one(
    intent: str, parameters: dict[str, Any], said: str, draft: Draft | None, live: Live
) -> Command | Reply:
    """The command that an operator said, or what to ask."""
    fields = COMMANDS[intent].model_fields
    known = draft.parameters if draft is not None else {}
    unsaid = [
        name
        for name, value in parameters.items()
        if not _said(intent, name, value, said, known.get(name))
    ]
    kept = {name: value for name, value in parameters.items() if name not in unsaid}
    missing = [name for name, field in fields.items() if field.is_required() and name not in kept]
    if missing or (
        unsaid and not _made_up(intent, kept, {name: parameters[name] for name in unsaid}, live)
    ):
        asked = tuple(dict.fromkeys([*missing, *unsaid]))
        return _ask(intent, kept, asked, live)
    try:
        command = parse({"intent": intent, "parameters": parameters})
        filled = command.filled(live)
        # What happens without a confirmation is not for a model to say.
        acts = command.immediate and filled.events(live)
    except BadInput as error:
        return _refuse(intent, kept, error, live)
    if intent == "change_task_priority" and not _said(
        intent, "priority", getattr(command, "priority", ""), said, known.get("priority")
    ):
        return _ask(intent, kept, ("priority",), live)
    asks = intent == "query_status" and "?" in said
    cued = asks or draft is not None or bool(_CUES.get(intent, frozenset()) & set(words(said)))
    if acts or (intent in _CUES and not cued):
        example = _with_names(_PLAINLY[intent], live)
        return Reply(
            status="clarification",
            message=f"If that is what you want, say it plainly, for example: {example}.",
        )
    # What was left open stays open: it is made up when the command is proposed.
    return filled.model_copy(update={name: None for name in fields if name not in _given(command)})


def _made_up(intent: str, kept: dict[str, Any], others: dict[str, Any], live: Live) -> bool:
    """Whether the other values are those that would be made up anyway."""
    try:
        filled = parse({"intent": intent, "parameters": kept}).filled(live)
    except BadInput:
        return False
    return all(getattr(filled, name) == value for name, value in others.items())


def _given(command: Command) -> set[str]:
    return {name for name in type(command).model_fields if getattr(command, name) is not None}


def _said(intent: str, name: str, value: Any, said: str, known: Any) -> bool:
    """Whether a parameter's value is in the words, or was in the draft before."""
    if name == "priority":
        default: Priority = COMMANDS[intent].model_fields["priority"].default or "normal"
        usual = value if value == known else default
        return value in get_args(Priority) and priority_said(value, usual, said)
    if value == known:
        return True
    if isinstance(value, str):
        if name == "robot" and value.casefold() == "all" and EVERY & set(words(said)):
            return True
        kind = name in ("task_type", "obstacle_type")
        return name_said(value, said, plural=kind)
    return _points_said(value, said, known)


def _points_said(value: Any, text: str, known: Any) -> bool:
    points, before = _points(value), _points(known) or []
    if points is None:
        return False
    said, (xs, ys) = numbers(text), along_axes(text)
    found = [
        point in before
        or _corrected(point, before, said)
        or (number_said(point[0], xs) and number_said(point[1], ys))
        or (point_said(point, said) and not number_said(point[0], ys))
        for point in points
    ]
    if len(points) == 4 and (all(found[::2]) or all(found[1::2])):
        # Two opposite corners say a rectangle.
        return all(found) or len({x for x, _ in points}) == len({y for _, y in points}) == 2
    return all(found)


def _corrected(point: Point, before: Sequence[Point], said: Sequence[float]) -> bool:
    """Whether one coordinate is that of an earlier point and the other was said."""
    return any(
        (old[0] == point[0] and number_said(point[1], said))
        or (old[1] == point[1] and number_said(point[0], said))
        for old in before
    )


def _points(value: Any) -> list[Point] | None:
    """The points in a parameter, be it one or several; None if it holds something else."""
    match value:
        case [int() | float() as x, int() | float() as y]:
            return [(float(x), float(y))]
        case [[_, _], *_]:
            found = [_points(part) for part in value]
            return [part[0] for part in found if part is not None] if all(found) else None
    return None


def _ask(intent: str, kept: dict[str, Any], asked: tuple[str, ...], live: Live) -> Reply:
    return Reply(
        status="need_more_info",
        intent=intent,
        parameters=kept,
        missing=asked,
        message=" ".join(_with_names(_QUESTIONS[name], live) for name in asked),
    )


def _refuse(intent: str, kept: dict[str, Any], error: BadInput, live: Live) -> Reply:
    field = (error.field or "").split(".")[0]
    missing = (field,) if field in COMMANDS[intent].model_fields else ()
    return Reply(
        status="need_more_info" if missing and field not in kept else "clarification",
        intent=intent,
        parameters={name: value for name, value in kept.items() if name not in missing},
        missing=missing,
        message=f"{error.problem}; {error.remedy}",
    )


def _with_names(text: str, live: Live) -> str:
    """A question with names of the live world as examples."""
    mission, state = live.scene.mission, live.state
    examples = {
        "place": next(iter(mission.places), "(3, 4)"),
        "type": ", ".join(mission.task_types),
        "task": next(iter(state.open_tasks()), "aa"),
        "obstacle": next(iter(state.obstacles), "wall-1"),
        "robot": next(iter(state.robots), "robot1"),
    }
    for key, example in examples.items():
        text = text.replace("{" + key + "}", example)
    return text


def _left_out(said: str, commands: Sequence[Command], live: Live) -> str | None:
    """A number or a task type that was said and is in none of the commands."""
    used = list(_numbers_of([to_plain(command)["parameters"] for command in commands]))
    used.append(float(len(commands)))
    used += [float(len(getattr(one, "obstacle_location", ()))) for one in commands]
    spare = list(numbers(said))
    for value in spare:
        if not number_said(value, used) and value != 1.0:
            return f"{value:g}"
    types = {getattr(command.filled(live), "task_type", None) for command in commands}
    adding = any(command.intent == "add_task" for command in commands)
    for type_ in live.scene.mission.task_types if adding else ():
        if type_ not in types and name_said(type_, said, plural=True):
            return type_
    return None


def _numbers_of(value: Any) -> list[float]:
    """All numbers in plain data, also those in names."""
    if isinstance(value, str):
        return numbers(" ".join(part for part in _digits(value)))
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list):
        return [number for part in value for number in _numbers_of(part)]
    return [float(value)] if isinstance(value, int | float) else []


def _digits(text: str) -> list[str]:
    return "".join(c if c.isdecimal() else " " for c in text).split()
