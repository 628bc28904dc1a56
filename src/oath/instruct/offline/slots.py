"""From the tokens of an instruction to the parameters of a command, or what to ask."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence

from oath.commands import Live
from oath.errors import did_you_mean
from oath.instruct.offline import questions
from oath.instruct.offline.gates import is_vague
from oath.instruct.offline.heard import Filled, Heard
from oath.instruct.offline.names import single
from oath.instruct.offline.new_task import asked_priority, read_new_task
from oath.instruct.offline.tokens import Token
from oath.model import Point


def fill(intent: str, heard: Heard) -> Filled:
    """Read the parameters of a command."""
    filled = Filled()
    _FILL[intent](heard, filled)
    if intent == "change_task_priority":
        _read_changed_priority(heard, filled)
    return filled


def meant(heard: Heard, filled: Filled, intent: str, kind: str) -> tuple[list[Token], list[Token]]:
    """The names of one kind that are meant, each value once: known ones and unknown ones."""
    found: dict[str, Token] = {}
    unknown: list[Token] = []
    for at, token in enumerate(heard.tokens):
        if token.kind.removeprefix("unknown_") != kind:
            continue
        share = heard.models.role(heard.tokens, at, intent).get("meant", 0.0)
        filled.signs.add(f"{kind} {'meant' if share > 0.5 else 'not meant'}")
        if 0.2 < share < 0.8:
            filled.signs.add(f"{kind} unsure")
        if share > 0.5:
            if token.kind == kind:
                found.setdefault(str(token.value), token)
            else:
                unknown.append(token)
    return list(found.values()), unknown


def read_task(heard: Heard, filled: Filled, intent: str = "change_task_priority") -> None:
    """Read which task is meant, by its label or by where it is."""
    labels, unknown = meant(heard, filled, intent, "label")
    if unknown:
        known = questions.open_tasks(heard.live)
        near = did_you_mean(unknown[0].text, known) if known else "no task is open"
        filled.object_to(f"There is no task '{unknown[0].raw}'; {near}", "task_label")
    if len(labels) == 1:
        filled.parameters["task_label"] = labels[0].value
    elif labels:
        filled.several = [str(one.value) for one in labels]
    elif (odd := _like_a_label(heard)) and not unknown:
        why = f"There is no task '{odd.raw}'. {questions.ask_label(heard)}"
        filled.object_to(why, "task_label")
    elif not unknown:
        _task_at(heard, filled)
    if (
        not filled.trouble
        and not labels
        and re.search(
            r"\b(all|every|each|both|several|many|some) (of )?(the |my |our )*"
            r"(tasks|jobs|orders|errands|deliveries|them|task|job)\b(?! else)",
            re.sub(
                r"\b(before|after|over|above|ahead of|than|like) (all|every|any)( of)? (the )?\w+",
                " ",
                heard.line,
            ),
        )
    ):
        filled.object_to("I change one task at a time. " + questions.ask_label(heard), "task_label")


def _like_a_label(heard: Heard) -> Token | None:
    """A word that can only be meant as a label."""
    for token in heard.tokens:
        strange = token.kind == "word" and token.text not in heard.models.known
        if strange and re.fullmatch(r"[a-z]{2,3}|[a-z]{1,6}[-_]?\d{1,4}", token.text):
            return token
    return None


def _task_at(heard: Heard, filled: Filled) -> None:
    """Find the task that is told by where it is."""
    spots = [n for n, one in enumerate(heard.tokens) if one.kind in ("point", "place")]
    if unknown := heard.of("unknown_place"):
        filled.object_to(
            questions.unknown_place(heard, unknown[0]) + " " + questions.ask_label(heard),
            "task_label",
        )
    if len(spots) != 1:
        filled.object_to(questions.ask_label(heard), "task_label")
        return
    token = heard.tokens[spots[0]]
    fits = tasks_at(heard.live, token)
    if len(fits) == 1 and not is_vague(heard.tokens, spots[0]):
        filled.parameters["task_label"] = fits[0]
        return
    if fits:
        filled.object_to(
            f"Which task is meant? With a stop at {token.raw}: {', '.join(fits)}", "task_label"
        )
    else:
        filled.object_to(
            f"No open task has a stop at {token.raw}. {questions.ask_label(heard)}", "task_label"
        )


def tasks_at(live: Live, spot: Token) -> list[str]:
    """Open tasks with a stop at a place or point."""
    places = live.scene.mission.places
    at = places[spot.value] if spot.kind == "place" else spot.value
    return [
        id
        for id in questions.open_tasks(live)
        if any(math.dist(stop.at, at) < 0.05 for stop in live.state.tasks[id].stops)
    ]


def _read_changed_priority(heard: Heard, filled: Filled) -> None:
    priority = asked_priority(heard, filled, "change_task_priority")
    if priority is None:
        filled.object_to("Which priority: low, normal or high?", "priority")
    else:
        filled.parameters["priority"] = priority


# -- obstacles


def _obstacle_to_add(heard: Heard, filled: Filled) -> None:
    points: list[Point] = []
    for n, token in enumerate(heard.tokens):
        if token.kind != "point":
            continue
        share = heard.models.role(heard.tokens, n, "obstacle_update").get("meant", 0.0)
        if 0.2 < share < 0.8:
            filled.signs.add("point unsure")
        if share < 0.5:
            filled.signs.add("point not meant")
            continue
        if is_vague(heard.tokens, n):
            why = f"Where exactly? '{token.raw}' says only roughly. {questions.ask_extent()}"
            filled.signs.add("vague")
            filled.doubt = ("obstacle_location", why)
        if not points or points[-1] != token.value:
            points.append(token.value)
    if kind := called(heard, filled):
        filled.parameters["obstacle_type"] = kind
    if unknown := heard.of("unknown_place"):
        filled.object_to(
            questions.unknown_place(heard, unknown[0]) + " " + questions.ask_extent(),
            "obstacle_location",
        )
    add_points(heard, filled, _corners(heard, points))


_NO_NOUN = frozenset({
    "obstacle", "obstruction", "blockage", "something", "thing", "object", "area", "zone",
    "region", "space", "stretch", "section", "spot", "way", "path", "passage", "passageway",
    "aisle", "corridor", "lane", "hall", "hallway", "gangway", "route", "road", "line",
    "segment", "rectangle", "square", "polygon", "triangle", "block", "hazard", "danger",
    "mess", "stuff",
})  # fmt: skip
"""Nouns that say where or that something is, and not what."""

NOUN, SURE_NOUN = 0.5, 0.8
"""How likely a noun must be what an obstacle is called to be taken, and not to be doubted."""


def called(heard: Heard, filled: Filled) -> str | None:
    """What an obstacle is called: the likeliest noun, with what goes with it."""
    shares = heard.models.kinds(heard.tokens)
    heads = sorted((share.get("noun", 0.0), n) for n, share in enumerate(shares))
    if not heads or heads[-1][0] < NOUN:
        return None
    best, end = heads[-1]
    if best < SURE_NOUN:
        filled.signs.add("kind unsure")
    start = end
    while start > 0 and shares[start - 1].get("with", 0.0) > 0.4:
        start -= 1
    words = [one.raw.casefold() for one in heard.tokens[start : end + 1]]
    last = heard.tokens[end]
    if single(last.text) in _NO_NOUN:
        return None
    return " ".join([*words[:-1], str(last.value) if last.kind == "kind" else single(words[-1])])


_BOX = re.compile(
    r"\b(rectang\w*|square|box|area|zone|region|opposite|diagonal\w*|corner to corner"
    r"|(bottom|lower|upper|top) (left|right))\b"
)


def _corners(heard: Heard, points: list[Point]) -> list[Point]:
    """The four corners of what is told by two opposite ones; a line's two ends stay."""
    boxes = {"box", "crate", "container", "cabinet", "room", "carton"}
    told = _BOX.search(heard.line) or any(one.value in boxes for one in heard.of("kind"))
    if len(points) != 2 or not told:
        return points
    (left, low), (right, high) = points
    if left == right or low == high:
        return points
    return [(left, low), (right, low), (right, high), (left, high)]


def add_points(heard: Heard, filled: Filled, points: Sequence[Point]) -> None:
    """Give an obstacle its points, or ask for more."""
    for at in points:
        if why := questions.outside(heard, at):
            filled.object_to(why, "obstacle_location")
            return
    if points:
        filled.parameters["obstacle_location"] = [[x, y] for x, y in points]
    if len(points) < 2 and "obstacle_location" not in filled.missing:
        filled.missing.append("obstacle_location")


def _obstacle_to_remove(heard: Heard, filled: Filled) -> None:
    known = heard.live.state.obstacles
    named, unknown = meant(heard, filled, "remove_obstacle", "obstacle")
    if len(named) == 1:
        filled.parameters["obstacle"] = named[0].value
        return
    if named:
        filled.several = [str(one.value) for one in named]
        return
    if unknown:
        filled.object_to(
            f"There is no obstacle '{unknown[0].raw}'. {questions.ask_obstacle(heard)}", "obstacle"
        )
        return
    kinds = {one.value for one in heard.of("kind")}
    points = [one.value for one in heard.of("point")]
    fits = [
        id
        for id, one in known.items()
        if (not kinds or one.kind in kinds) and all(_touches(one.polygon, at) for at in points)
    ]
    told = kinds or points or re.search(r"\b(obstacle|obstruction|blockage|barrier)\b", heard.line)
    some = re.search(
        r"\b(a|an|any|some|one of|all|every)( of)?( the)? (<kind>|obstacles?)", heard.line
    )
    if told and not some and len(fits) == 1:
        filled.parameters["obstacle"] = fits[0]
    else:
        filled.object_to(questions.ask_obstacle(heard, fits), "obstacle")


def _touches(polygon: Sequence[Point], at: Point) -> bool:
    """Whether a point is within a polygon's bounding box, or 0.3 m of it."""
    xs, ys = [x for x, _ in polygon], [y for _, y in polygon]
    return min(xs) - 0.3 <= at[0] <= max(xs) + 0.3 and min(ys) - 0.3 <= at[1] <= max(ys) + 0.3


# -- robots


def _robot(heard: Heard, filled: Filled, intent: str) -> None:
    robots, unknown = meant(heard, filled, intent, "robot")
    if unknown:
        known = ", ".join(heard.live.state.robots)
        filled.object_to(f"There is no robot '{unknown[0].raw}'. Known: {known}.", "robot")
    elif len(robots) == 1:
        filled.parameters["robot"] = robots[0].value
    elif any(one.value == "all" for one in robots):
        filled.object_to("All robots, or some? " + questions.ask_robot(heard), "robot")
    elif len(robots) == len(heard.live.state.robots) > 2:
        filled.parameters["robot"] = "all"
    elif robots:
        filled.several = [str(one.value) for one in robots]
    elif len(heard.live.state.robots) == 1 and re.search(r"\bthe robot\b", heard.line):
        filled.parameters["robot"] = next(iter(heard.live.state.robots))
    else:
        filled.missing.append("robot")


_EMERGENCY = re.compile(
    r"\b(emergency stop|e-stop|estop|stop (all|everything|everybody|everyone))\b"
)


def _paused_robot(heard: Heard, filled: Filled) -> None:
    if not heard.of("robot", "unknown_robot") and _EMERGENCY.search(heard.line):
        filled.parameters["robot"] = "all"
    else:
        _robot(heard, filled, "pause_robot")


def _resumed_robot(heard: Heard, filled: Filled) -> None:
    _robot(heard, filled, "resume_robot")


def _failed_robot(heard: Heard, filled: Filled) -> None:
    _robot(heard, filled, "robot_failed")
    if filled.parameters.get("robot") == "all":
        filled.object_to("Which robot failed? " + questions.ask_robot(heard), "robot")


def _cancelled_task(heard: Heard, filled: Filled) -> None:
    read_task(heard, filled, "cancel_task")


def _nothing(heard: Heard, filled: Filled) -> None:
    return None


_FILL: Mapping[str, Callable[[Heard, Filled], None]] = {
    "add_task": read_new_task,
    "obstacle_update": _obstacle_to_add,
    "change_task_priority": read_task,
    "cancel_task": _cancelled_task,
    "remove_obstacle": _obstacle_to_remove,
    "pause_robot": _paused_robot,
    "resume_robot": _resumed_robot,
    "robot_failed": _failed_robot,
    "query_status": _nothing,
    "undo": _nothing,
}
