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
from oath.instruct.offline.new_task import read_new_task, said_priority
from oath.instruct.offline.tokens import Token
from oath.model import Point


def fill(intent: str, heard: Heard, priority: str | None = None) -> Filled:
    """Read the parameters of a command; `priority` is what the wording alone says."""
    filled = Filled()
    _FILL[intent](heard, filled)
    if intent == "change_task_priority":
        _read_changed_priority(heard, filled, priority)
    return filled


def read_task(heard: Heard, filled: Filled) -> None:
    """Read which task is meant, by its label or by where it is."""
    labels = heard.of("label")
    if unknown := heard.of("unknown_label"):
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
    if not filled.trouble and re.search(
        r"\b(all|every|each|both|several|many|some) (of )?(the |my |our )*"
        r"(tasks|jobs|orders|errands|deliveries|them|task|job)\b(?! else)",
        re.sub(
            r"\b(before|after|over|above|ahead of|than|like) (all|every|any)( of)? (the )?\w+",
            " ",
            heard.line,
        ),
    ):
        filled.object_to("I change one task at a time. " + questions.ask_label(heard), "task_label")


def _like_a_label(heard: Heard) -> Token | None:
    """A word that can only be meant as a label."""
    for token in heard.tokens:
        strange = token.kind == "word" and token.text not in heard.models.words
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


def _read_changed_priority(heard: Heard, filled: Filled, meant: str | None) -> None:
    said = said_priority(heard.line)
    if any(one.kind == "type" and one.text == "normal" for one in heard.tokens):
        said.add("normal")
    if len(said) == 1 and (meant in said or meant is None):
        filled.parameters["priority"] = said.pop()
    elif not said and meant is not None:
        filled.parameters["priority"] = meant
    else:
        filled.object_to("Which priority: low, normal or high?", "priority")


# -- obstacles


_THING = re.compile(
    r"\b(?:a|an|some) (?:big |large |huge |broken |small |long )?([a-z]{3,20}) (?:is|has|was"
    r"|blocks?"
    r"|blocking|lying|lies|stands?|standing|sits?|sitting|from|across|between|along|in|on|at"
    r"|fell)\b"
)
"""An obstacle told by a noun that nobody foresaw."""


def _obstacle_to_add(heard: Heard, filled: Filled) -> None:
    points: list[Point] = []
    vague = None
    for n, token in enumerate(heard.tokens):
        if token.kind == "point":
            if is_vague(heard.tokens, n):
                vague = vague or token
            elif not points or points[-1] != token.value:
                points.append(token.value)
    kinds = sorted({str(one.value) for one in heard.of("kind")})
    if len(kinds) == 1:
        filled.parameters["obstacle_type"] = kinds[0]
    elif kinds:
        filled.object_to(f"Which kind: {' or '.join(kinds)}?", "obstacle_type")
    elif (noun := _THING.search(heard.line)) and noun[1] not in heard.models.words:
        filled.parameters["obstacle_type"] = noun[1]
    if unknown := heard.of("unknown_place"):
        filled.object_to(
            questions.unknown_place(heard, unknown[0]) + " " + questions.ask_extent(),
            "obstacle_location",
        )
    elif vague is not None:
        why = f"Where exactly? '{vague.raw}' says only roughly. {questions.ask_extent()}"
        filled.object_to(why, "obstacle_location")
        return
    add_points(heard, filled, _corners(heard, points))


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
    named = heard.of("obstacle")
    if len(named) == 1:
        filled.parameters["obstacle"] = named[0].value
        return
    if named:
        filled.several = [str(one.value) for one in named]
        return
    if unknown := heard.of("unknown_obstacle"):
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


def _robot(heard: Heard, filled: Filled) -> None:
    robots = heard.of("robot")
    if unknown := heard.of("unknown_robot"):
        known = ", ".join(heard.live.state.robots)
        filled.object_to(f"There is no robot '{unknown[0].raw}'. Known: {known}.", "robot")
    elif len(robots) == 1:
        filled.parameters["robot"] = robots[0].value
    elif any(one.value == "all" for one in robots):
        filled.object_to("All robots, or some? " + questions.ask_robot(heard), "robot")
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
        _robot(heard, filled)


def _failed_robot(heard: Heard, filled: Filled) -> None:
    _robot(heard, filled)
    if filled.parameters.get("robot") == "all":
        filled.object_to("Which robot failed? " + questions.ask_robot(heard), "robot")


def _nothing(heard: Heard, filled: Filled) -> None:
    return None


_FILL: Mapping[str, Callable[[Heard, Filled], None]] = {
    "add_task": read_new_task,
    "obstacle_update": _obstacle_to_add,
    "change_task_priority": read_task,
    "cancel_task": read_task,
    "remove_obstacle": _obstacle_to_remove,
    "pause_robot": _paused_robot,
    "resume_robot": _robot,
    "robot_failed": _failed_robot,
    "query_status": _nothing,
    "undo": _nothing,
}
