"""Follow-up turns: what was asked for is filled in, corrected or dropped."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from oath.commands import COMMANDS
from oath.errors import did_you_mean
from oath.instruct import Draft, Reply
from oath.instruct.offline import gates, new_task, questions, slots
from oath.instruct.offline.features import classes
from oath.instruct.offline.gates import as_line
from oath.instruct.offline.heard import Filled, Heard
from oath.instruct.offline.tokens import Token
from oath.instruct.offline.understand import NEEDS, answer, meaning, understand
from oath.model import Point

_DROP = re.compile(
    r"^(?:\W*(?:no|oh|ok|okay|well|ah|sorry|actually|please|just) )*\W*(?:never ?mind"
    r"|forget (?:it|that|about it"
    r"|about that)|drop (?:it|that)|scrap (?:it|that)|leave it|skip it|cancel (?:it|that|this)"
    r"|abort|stop asking|"
    r"no thanks?|no thank you|nothing|not needed|let it be|do not bother|i changed my mind"
    r"|discard (?:it|that)|scratch (?:it|that)|strike that|false alarm"
    r"|no|nope|cancel|dismiss|ignore (?:it|that))(?: (?:please|then|anymore|again|now|after all"
    r"|thanks|it is (still )?(there|needed|here)( after all)?|i was (wrong|mistaken)"
    r"|my mistake|leave it( as it (is|was))?|leave (things|everything)"
    r" as (they|it) (are|is)|it is (fine|ok|okay|good)( as it is)?|sorry|,|\.|!))*\W*$"
)

_CORRECTS = re.compile(
    r"\b(no|not|i mean|i meant|meant|rather|instead|sorry|actually|wrong|correct\w*|change"
    r"|should be|make (?:it|that)"
    r"|wait|oops|better|set it|it is|it should)\b"
)


_NOT_SO = re.compile(r"\b(not|instead of|rather than) (a )?(high|low|normal|urgent)( priority)?\b")


def follow_up(heard: Heard, draft: Draft) -> Reply:
    """Interpret words in the light of an open question or proposal."""
    if why := gates.refused(heard.line):
        return Reply(status="clarification", message=why)
    if _DROP.match(heard.line.strip()) or _takes_back(heard):
        return Reply(status="clarification", message="Dropped; nothing is changed.")
    heard = replace(heard, tokens=tuple(_by_number(heard, draft)))
    if _anew(heard, draft):
        return understand(heard)
    filled = Filled(parameters=dict(draft.parameters))
    if not _fill(heard, draft, filled):
        reply = understand(heard)
        empty = not (reply.parameters or reply.commands)
        same = reply.intent == draft.intent or len(heard.tokens) <= 4
        if reply.intent is None or (same and empty):
            return _again(heard, draft)
        return reply
    if _AXIS.search(heard.line):
        rest = tuple(one for one in heard.tokens if one.kind != "number")
        heard = replace(heard, tokens=rest)
    if why := gates.reason(heard.tokens, heard.models.concepts, gates.IN_ANSWERS):
        filled.object_to(f"{why} Say it plainly if that is meant.")
    return answer(heard, draft.intent, filled)


def _takes_back(heard: Heard) -> bool:
    """Whether words take back what was said, and name nothing else."""
    if any(one.kind not in ("word", "mark") for one in heard.tokens):
        return False
    ends = [n for n, one in enumerate(heard.tokens) if one.kind == "mark" and one.text in ",.;!-"]
    first = heard.tokens[: ends[0]] if ends else heard.tokens
    if len(first) > 1 and _DROP.match(as_line(first)):
        return True
    said = classes(heard.tokens, heard.models.concepts)
    return "@retract_" in said and not said & {"@urgent_", "@relaxed_", "@usual_", "@undoword_"}


def _by_number(heard: Heard, draft: Draft) -> list[Token]:
    """Read ``2`` as robot2 where a robot is asked for."""
    tokens = list(heard.tokens)
    if "robot" in COMMANDS[draft.intent].model_fields:
        robots = list(heard.live.state.robots)
        for n, token in enumerate(tokens):
            number = f"{token.value:g}" if token.kind == "number" and token.value else token.text
            fits = [one for one in robots if re.sub(r"\D", "", one) == number]
            if token.kind == "number" and len(fits) == 1:
                tokens[n] = replace(token, kind="robot", value=fits[0])
    return tokens


def _again(heard: Heard, draft: Draft) -> Reply:
    """Ask once more."""
    if not draft.missing:
        return Reply(
            status="clarification",
            intent=draft.intent,
            parameters=draft.parameters,
            message="I do not understand what is to be different. Say the new value, e.g. 'no, to "
            "(5, 16)', or 'never mind'.",
        )
    return Reply(
        status="need_more_info",
        intent=draft.intent,
        parameters=draft.parameters,
        missing=draft.missing,
        message="I do not understand that. " + questions.ask(heard, draft.missing),
    )


_ANSWERS = re.compile(
    r"(?:\W|(?:it|that|this|the|is|are|one|task|job|robot|number|no|nr|label|id|called|named"
    r"|please|thanks"
    r"|thank|you|with|for|i|mean|meant|want|take|make|of|course|would|be|called|my|mistake|sorry|ok"
    r"|okay|yes|um|uh|er|well|oh|a|an|kind|type|point|room|place|obstacle|at|in|to|from|and"
    r"|between|should|could|must|go|goes|over|there|then|at|has|have|runs|reaches|until|till|up"
    r"|let|say|try|choose|pick|just|only|name)\b|<\w+>)*"
)
"""Says no more than a value."""


def _anew(heard: Heard, draft: Draft) -> bool:
    """Whether words are an instruction of their own and no answer."""
    if draft.missing and _ANSWERS.fullmatch(heard.line) and _answers(heard, draft):
        return False
    words = [one for one in heard.tokens if one.kind == "word"]
    told = {"robot", "label", "obstacle"} & {one.kind for one in heard.tokens}
    if len(words) < 2 and not (words and (words[0].text in _ALONE or told)):
        return False
    meant = meaning(heard)
    if meant.share < (0.7 if len(words) > 1 else 0.9):
        return False
    if len(words) == 1 and (words[0].text in _NOUNS or _CORRECTS.search(heard.line)):
        return False
    kinds = {one.kind.removeprefix("unknown_") for one in heard.tokens}
    names = meant.intent not in NEEDS or bool(NEEDS[meant.intent] & kinds)
    if meant.intent != draft.intent:
        about = meant.intent == "change_task_priority" and draft.intent == "add_task"
        return names and not (about and not heard.of("label"))
    if _CORRECTS.search(heard.line):
        return False
    if draft.intent == "add_task":
        return sum(one.kind in ("point", "place") for one in heard.tokens) >= 2 and len(words) > 3
    return names and len(words) > 3


_VALUES: Mapping[str, frozenset[str]] = {
    "task_label": frozenset({"label", "unknown_label"}),
    "robot": frozenset({"robot", "unknown_robot"}),
    "obstacle": frozenset({"obstacle", "unknown_obstacle"}),
    "obstacle_location": frozenset({"point"}),
    "location": frozenset({"point", "place", "unknown_place"}),
    "delivery_point": frozenset({"point", "place", "unknown_place"}),
}
"""What tells the value of a parameter."""


def _answers(heard: Heard, draft: Draft) -> bool:
    """Whether words name just what was asked for."""
    asked = frozenset[str]().union(*(_VALUES.get(one, frozenset()) for one in draft.missing))
    named = {one.kind for one in heard.tokens} - {"word", "mark", "kind", "type"}
    return bool(named) and named <= asked


_ALONE = {"undo", "status", "stop", "halt", "freeze"}


def _fill(heard: Heard, draft: Draft, filled: Filled) -> bool:
    """Fill or correct parameters of the draft; False if the words give none."""
    heard = replace(heard, tokens=tuple(_not_denied(heard.tokens, draft)))
    before = dict(filled.parameters)
    match draft.intent:
        case "add_task":
            _fill_task(heard, draft, filled)
        case "obstacle_update":
            _fill_obstacle(heard, filled)
        case "change_task_priority" | "cancel_task":
            _fill_label(heard, draft, filled)
        case "remove_obstacle":
            _fill_name(heard, filled, "obstacle", list(heard.live.state.obstacles))
        case "pause_robot" | "resume_robot" | "robot_failed":
            _fill_name(heard, filled, "robot", list(heard.live.state.robots))
    found = filled.parameters != before or bool(filled.trouble)
    found = found or any(one.kind not in ("word", "mark", "number") for one in heard.tokens)
    if draft.intent == "change_task_priority" and "priority" not in filled.parameters:
        filled.missing.append("priority")
    fields = COMMANDS[draft.intent].model_fields
    for name in (*draft.missing, *(name for name, one in fields.items() if one.is_required())):
        short = name == "obstacle_location" and len(filled.parameters.get(name, ())) < 2
        if (name not in filled.parameters or short) and name not in filled.missing:
            filled.missing.append(name)
    return found


def _not_denied(tokens: Sequence[Token], draft: Draft) -> list[Token]:
    """Leave out what a correction takes back, as B in ``not B but C`` or ``C instead of B``."""
    kept: list[Token] = []
    for n, token in enumerate(tokens):
        before = [one.text for one in tokens[max(n - 3, 0) : n] if one.text not in _NOUNS][-2:]
        named = token.kind not in ("word", "mark")
        if named and ("not" in before or before in (["instead", "of"], ["rather", "than"])):
            continue
        kept.append(token)
    old = [str(list(v) if isinstance(v, (list, tuple)) else v) for v in draft.parameters.values()]
    spots = [one for one in kept if one.kind in _SPOTS]
    if len(spots) == 2:
        again = [one for one in spots if str(_plain(one)) in old]
        if len(again) == 1 and _CHANGES.search(as_line(kept)):
            kept.remove(again[0])
    return kept


_NOUNS = {"point", "room", "station", "task", "to", "at", "the", "place", "robot", "in"}
_SPOTS = ("point", "place", "unknown_place")
_CHANGES = re.compile(r"\b(change|replace|swap|instead|rather|switch|correct\w*|make)\b")


def _plain(token: Token) -> Any:
    return list(token.value) if token.kind == "point" else token.value


_TO = re.compile(
    r"\b(to|deliver\w*|destination|drop\w*|goes|bring|take|target|for|ends?|unload|towards|into)\b"
)
_FROM = re.compile(
    r"\b(from|pick\w*|collect|fetch|starts?|source|origin|location|located|get it|waits?)\b"
)


def _fill_task(heard: Heard, draft: Draft, filled: Filled) -> None:
    if _corrects_axis(heard, filled):
        return
    extra = Filled()
    new_task.read_new_label(heard, extra)
    new_task.read_type(heard, extra)
    filled.trouble = extra.trouble
    said = new_task.said_priority(_NOT_SO.sub(" ", heard.line))
    urgency = classes(heard.tokens, heard.models.concepts) & {"@urgent_", "@relaxed_"}
    if len(said) == 1:
        extra.parameters["priority"] = said.pop()
    elif urgency and not said and not heard.of(*_SPOTS):
        priority = new_task.asked_priority(heard, Filled(), "change_task_priority")
        extra.parameters |= {"priority": priority} if priority else {}
    filled.parameters |= extra.parameters
    words = [one for one in heard.tokens if one.kind not in ("mark",)]
    bare = len(words) == 1 and words[0].kind in ("word", "unknown_label")
    asked = "task_label" in draft.missing
    asked = asked or (bare and not draft.missing and words[0].text not in heard.models.known)
    if bare and asked and not extra.parameters and re.fullmatch(r"\w[\w.-]{0,31}", words[0].raw):
        filled.parameters["task_label"] = words[0].raw
    spots = [n for n, one in enumerate(heard.tokens) if one.kind in _SPOTS]
    if len(spots) > 2:
        filled.object_to("Which is where it is picked up, and which where it goes?")
    elif len(spots) == 2:
        roles = new_task.assign_roles(heard, spots) or {spots[0]: "pickup", spots[1]: "delivery"}
        for at, role in roles.items():
            name = "location" if role == "pickup" else "delivery_point"
            new_task.read_spot(heard, filled, name, at)
    elif spots:
        asked_for = _asked_spot(heard, draft, spots[0])
        if asked_for is None:
            raw = heard.tokens[spots[0]].raw
            filled.object_to(
                f"Is {raw} where it is picked up or where it goes? Say 'from {raw}' or 'to {raw}'."
            )
        else:
            new_task.read_spot(heard, filled, asked_for, spots[0])


_AXIS = re.compile(
    r"\b(x|y)(?: coordinate| value)?(?: (?:is|should|be|must|to|of|=|:|equals|must|needs"
    r"|actually|has))* "
    r"<number>[ .!]*$"
)


def _corrects_axis(heard: Heard, filled: Filled) -> bool:
    """Correct one coordinate of the only point of a task, as in ``x should be 9``."""
    axis = _AXIS.search(heard.line)
    numbers = heard.of("number")
    names = ("location", "delivery_point")
    points = [one for one in names if isinstance(filled.parameters.get(one), (list, tuple))]
    if axis is None or len(numbers) != 1 or numbers[0].value is None or len(points) != 1:
        return False
    x, y = filled.parameters[points[0]]
    at = (float(numbers[0].value), y) if axis[1] == "x" else (x, float(numbers[0].value))
    if why := questions.outside(heard, at):
        filled.object_to(why, points[0])
    else:
        filled.parameters[points[0]] = list(at)
    return True


def _asked_spot(heard: Heard, draft: Draft, at: int) -> str | None:
    """Which of a task's two ends one place or point is; None if that is not clear."""
    before = as_line(heard.tokens[:at])
    to, start = _TO.search(before), _FROM.search(before)
    if to and not start:
        return "delivery_point"
    if start and not to:
        return "location"
    asked = [one for one in ("location", "delivery_point") if one in draft.missing]
    if len(asked) == 1:
        return asked[0]
    point = heard.tokens[at].kind == "point"
    if asked:
        return "location" if point else None
    if isinstance(draft.parameters.get("delivery_point"), str):
        return "location" if point else "delivery_point"
    return None


def _fill_obstacle(heard: Heard, filled: Filled) -> None:
    kind = slots.called(heard, extra := Filled())
    if kind and not extra.signs:
        filled.parameters["obstacle_type"] = kind
    points: list[Point] = []
    for n, token in enumerate(heard.tokens):
        if token.kind == "point":
            if gates.is_vague(heard.tokens, n):
                filled.object_to(
                    f"That must be exact. {questions.ask_extent()}", "obstacle_location"
                )
                return
            points.append(token.value)
    known = [tuple(one) for one in filled.parameters.get("obstacle_location", ())]
    if len(points) == 1 and len(known) == 1 and points != known:
        points = [*known, *points]
    elif len(points) == 1 and len(known) == 2 and (end := _end(heard.line)) is not None:
        points = [*known[:end], *points, *known[end + 1 :]]
    elif len(points) == 1 and len(known) > 1:
        filled.object_to(f"Which point is that? {questions.ask_extent()}", "obstacle_location")
        return
    if points:
        slots.add_points(heard, filled, points)


def _end(line: str) -> int | None:
    """Which end of a line one point is said to be; None if that is not clear."""
    to = re.search(
        r"\b(to|until|till|ends?|end point|second|finish\w*|stops?|up to)\b.*<point>", line
    )
    start = re.search(r"\b(from|starts?|begins?|beginning|start point|first)\b.*<point>", line)
    return None if bool(to) == bool(start) else int(bool(to))


def _fill_label(heard: Heard, draft: Draft, filled: Filled) -> None:
    if draft.intent == "change_task_priority":
        said = new_task.said_priority(_NOT_SO.sub(" ", heard.line))
        plain = _NOT_SO.sub(" ", " ".join(one.text for one in heard.tokens))
        said |= set(re.findall(r"\b(low|normal|high)\b", plain))
        if len(said) == 1:
            filled.parameters["priority"] = said.pop()
        elif said:
            filled.object_to("Which priority: low, normal or high?", "priority")
    told = ("label", "unknown_label", "point", "place")
    if heard.of(*told):
        filled.parameters.pop("task_label", None)
        slots.read_task(heard, filled, draft.intent)
    elif words := _strange_name(heard):
        filled.object_to(
            f"There is no task '{words.raw}'. {questions.ask_label(heard)}", "task_label"
        )


def _strange_name(heard: Heard) -> Token | None:
    """The one word of an answer, if it is none that is known."""
    words = [one for one in heard.tokens if one.kind == "word"]
    known = heard.models.known
    return words[0] if len(words) == 1 and words[0].text not in known else None


def _fill_name(heard: Heard, filled: Filled, name: str, known: Sequence[str]) -> None:
    named = heard.of(name)
    named = [one for one in named if one.value != "all"] or named
    if len(named) == 1:
        filled.parameters[name] = named[0].value
    elif named:
        filled.several = [str(one.value) for one in named]
        filled.parameters.pop(name, None)
        filled.parameters[name] = filled.several[0]
    elif word := next(iter(heard.of(f"unknown_{name}")), None) or _strange_name(heard):
        filled.object_to(
            f"There is no {name} '{word.raw}'; {did_you_mean(word.text, list(known))}", name
        )
