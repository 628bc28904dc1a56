"""From the tokens of an instruction to the parameters of a command, or what to ask."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from oath.commands import Live
from oath.commands.command import show_point
from oath.errors import did_you_mean
from oath.instruct.offline.gates import as_line, is_vague
from oath.instruct.offline.model import Models
from oath.instruct.offline.names import Names
from oath.instruct.offline.tokens import Token
from oath.model import Point


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
    """

    parameters: dict[str, Any] = field(default_factory=dict)
    several: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    trouble: str = ""

    def object_to(self, why: str, parameter: str | None = None) -> None:
        """Ask about the first thing that is wrong."""
        self.trouble = self.trouble or why
        if parameter is not None and parameter not in self.missing:
            self.missing.append(parameter)
            self.parameters.pop(parameter, None)


def fill(intent: str, heard: Heard, priority: str | None = None) -> Filled:
    """Read the parameters of a command; `priority` is what the wording alone says."""
    filled = Filled()
    _FILL[intent](heard, filled)
    if intent == "change_task_priority":
        _read_changed_priority(heard, filled, priority)
    return filled


# -- tasks

_LOW = re.compile(
    r"\b(low(est|er)?( |-)?priority|priority (is |of |to |at |: |= )*(low\w*|minimum)|(not|no longer|less|least|"
    r"isn't) (so |that |very |really |too )?(urgent|important|pressing|critical)|no (rush|hurry|"
    r"urgency|pressure)|low|can wait|at the end|lowest|whenever (you|there|it)|unimportant|"
    r"take your time|last|when (you have|there is) (some |)time|not in a hurry)\b"
)
_HIGH = re.compile(
    r"\b((?<!not )(?<!no longer )(?<!not so )(?<!not very )(?<!not that )(urgent(ly)?|asap|critical|pressing|express)|"
    r"(high(est|er)?|top|maximum|first|max)( |-)?priority|priority (is |of |to |at |: |= )*(high\w*|urgent|top|1|one)|"
    r"as soon as possible|immediately|right away|at once|emergency|rush|high|quickly|"
    r"with priority|straight away|without delay|before (all|everything|anything)( else| others?)?)\b"
)
_NORMAL = re.compile(
    r"\b(normal|regular|standard|default|medium|usual) (priority|urgency)\b|\bpriority (is |of |to |"
    r"at |: |= )*(normal|standard|default|medium|regular)\b"
)


def said_priority(line: str) -> set[str]:
    """The priorities that the words name.

    Examples
    --------
    >>> said_priority("add a task , it is not urgent"), said_priority("priority high")
    ({'low'}, {'high'})
    """
    found = set()
    if _NORMAL.search(line):
        found.add("normal")
    if _LOW.search(line):
        found.add("low")
        line = re.sub(r"\bno (rush|hurry)\b", " ", line)
    if _HIGH.search(line):
        found.add("high")
    return found


_TYPES_ELSEWHERE = frozenset(
    "inspection inspect cleaning clean survey patrol scan scanning photo maintenance repair fragile "
    "heavy surveillance monitoring sampling measurement mapping welding painting refrigerated cold "
    "hazardous disinfection security guarding charging assembly".split()
)

_NEW_LABEL = re.compile(
    r"^(?:call(?:ed)? (?:it|this|that|the task|the job|this one|the new one|the new task)(?: task| as)?"
    r"|nam(?:e|ed)(?: it| this| the task| as)?|label(?:l?ed)?(?: it| is| of| as| the task| should be)?"
    r"|called|with (?:the )?(?:label|name|id)|(?:its )?(?:id|label|name) (?:is|should be|shall be)|id|"
    r"tag(?:ged)?(?: it)?(?: as)?|under the (?:name|label)|identifier|known as|labell?ed as)(?: :| =)?$"
)
_NO_LABEL = frozenset(
    "a an the it this that as to at for with and or of in new task job high low normal urgent special "
    "please is from by on priority label name id called me us you".split()
)


def _task_to_add(heard: Heard, filled: Filled) -> None:
    read_new_label(heard, filled)
    read_type(heard, filled)
    line = heard.line
    said = said_priority(line)
    if len(said) == 1:
        filled.parameters["priority"] = said.pop()
    elif said:
        filled.object_to(f"Which priority: {' or '.join(sorted(said))}?")
    if (robots := heard.of("robot", "unknown_robot")) and not filled.trouble:
        filled.object_to(
            f"Which robot does a task is decided by the planner; I cannot give it to "
            f"{robots[0].raw}. Say it without the robot."
        )
    _places(heard, filled)
    for name in ("location", "delivery_point"):
        if name not in filled.parameters and name not in filled.missing:
            filled.missing.append(name)
    if not filled.trouble and re.search(r"\b(two|three|four|several|some|many|few|both) (\w+ )?"
                                        r"(tasks|jobs|orders|errands|deliveries)\b|<number> (\w+ )?(tasks|jobs)",
                                        line):  # fmt: skip
        filled.object_to("Several tasks at once: tell me one at a time, each with where and where to.")


def read_new_label(heard: Heard, filled: Filled) -> None:
    """Read the label that a task to add is given."""
    labels: list[str] = []
    for n, token in enumerate(heard.tokens):
        before = [one.text for one in heard.tokens[max(n - 5, 0) : n] if one.kind in ("word", "mark")]
        cued = any(_NEW_LABEL.match(" ".join(before[k:])) for k in range(len(before)))
        if token.kind == "unknown_label" or (
            cued
            and token.kind in ("word", "label", "place", "robot", "type", "number")
            and token.text not in _NO_LABEL
            and re.fullmatch(r"\w[\w.-]{0,63}", token.raw)
        ):
            labels.append(token.raw)
        elif token.kind == "label":
            filled.object_to(
                f"There is a task {token.value} already. Give the new one another label, or "
                f"leave it out.",
            )
    if len(set(labels)) > 1:
        filled.object_to(f"Which label: {' or '.join(labels)}?", "task_label")
    elif labels:
        filled.parameters["task_label"] = labels[0]
        known = {one.casefold(): one for one in heard.live.state.labels}
        if labels[0].casefold() in known:
            filled.object_to(
                f"The label {known[labels[0].casefold()]} is taken. Give another one.", "task_label"
            )


def read_type(heard: Heard, filled: Filled) -> None:
    """Read a task's type."""
    types = heard.of("type")
    known = heard.live.scene.mission.task_types
    if len(types) > 1:
        filled.object_to(f"Which type: {' or '.join(str(one.value) for one in types)}?", "task_type")
    elif types:
        filled.parameters["task_type"] = types[0].value
        return
    for n, token in enumerate(heard.tokens):
        after = [one.text for one in heard.tokens[n + 1 : n + 3]]
        if token.kind == "word" and token.text in _TYPES_ELSEWHERE:
            same = [one for one in known if token.text[:5] == one.casefold()[:5]]
            if len(same) == 1:
                filled.parameters["task_type"] = same[0]
            elif {"task", "job", "order", "assignment"} & set(after):
                filled.object_to(
                    f"There is no task type '{token.raw}'. Known: {', '.join(known)}.", "task_type"
                )


def _places(heard: Heard, filled: Filled) -> None:
    """What of the places and points is the pickup and what the delivery."""
    spots = []
    for n, token in enumerate(heard.tokens):
        if token.kind in ("point", "place", "unknown_place") and not _names_a_label(filled, token):
            spots.append(n)
    if len(spots) > 2:
        different = {str(heard.tokens[n].value) for n in spots}
        if len(different) > 2:
            filled.object_to("Which is where it is picked up, and which where it goes?")
            return
    roles = assign_roles(heard, spots)
    if roles is None:
        filled.object_to(
            "Which is where it is picked up, and which where it goes? For example: from (5, 19.5) "
            "to (6, 3)"
        )
        return
    for at, role in roles.items():
        read_spot(heard, filled, "location" if role == "pickup" else "delivery_point", at)


def _names_a_label(filled: Filled, token: Token) -> bool:
    return token.kind == "place" and filled.parameters.get("task_label") == token.raw


def read_spot(heard: Heard, filled: Filled, name: str, at: int) -> None:
    """Give a task's location or delivery point the value of the place or point at an index."""
    token, mission = heard.tokens[at], heard.live.scene.mission
    ask = ask_location if name == "location" else ask_delivery
    if token.kind == "unknown_place":
        filled.object_to(unknown_place(heard, token), name)
    elif is_vague(heard.tokens, at):
        filled.object_to(f"Where exactly? '{token.raw}' says only roughly. {ask(heard)}", name)
    elif token.kind == "place" and name == "delivery_point":
        filled.parameters[name] = token.value
    else:
        x, y = mission.places[token.value] if token.kind == "place" else token.value
        if why := outside(heard, (x, y)):
            filled.object_to(why, name)
        else:
            filled.parameters[name] = [x, y]


SURE = 0.65
"""How likely a reading of the places must be to be proposed."""


def assign_roles(heard: Heard, spots: Sequence[int]) -> dict[int, str] | None:
    """The most likely roles of places and points, at most one of each; None if that is unsure."""
    share = [heard.models.roles(heard.tokens, at) for at in spots]
    if not spots:
        return {}
    if len(spots) == 1:
        best = max(share[0], key=lambda role: share[0][role])
        if best == "other" or share[0][best] < SURE:
            best = "pickup" if heard.tokens[spots[0]].kind == "point" else best
            rest = share[0]["pickup"] + share[0]["delivery"]
            if best == "other":
                best = "pickup" if share[0]["pickup"] > share[0]["delivery"] else "delivery"
            if rest and share[0][best] / rest < SURE:
                return None
        return {spots[0]: best}
    scores: dict[tuple[int, int], float] = {}
    for a, first in enumerate(share):
        for b, second in enumerate(share):
            if a != b:
                scores[a, b] = first["pickup"] * second["delivery"]
    (a, b), best_score = max(scores.items(), key=lambda item: item[1])
    if best_score / (best_score + scores.get((b, a), 0.0) + 1e-12) < SURE:
        return None
    return {spots[a]: "pickup", spots[b]: "delivery"}


def outside(heard: Heard, at: Point) -> str | None:
    """Why a point cannot be on the map."""
    x0, y0, x1, y1 = heard.live.scene.mission.map.bounds
    if x0 <= at[0] <= x1 and y0 <= at[1] <= y1:
        return None
    return (
        f"{show_point(at)} lies outside the map, which reaches from {show_point((x0, y0))} to "
        f"{show_point((x1, y1))}. Give a point inside."
    )


def unknown_place(heard: Heard, token: Token) -> str:
    """There is no such place, but these."""
    known = ", ".join(heard.live.scene.mission.places) or "(none)"
    return f"There is no place '{token.raw}'. Known places: {known}; a point such as (5, 19.5) will do."


def open_tasks(live: Live) -> list[str]:
    """Tasks that are not done."""
    return [id for id in live.state.tasks if id not in live.state.completed]


def read_task(heard: Heard, filled: Filled) -> None:
    """Read which task is meant, by its label or by where it is."""
    labels = heard.of("label")
    if unknown := heard.of("unknown_label"):
        known = open_tasks(heard.live)
        near = did_you_mean(unknown[0].text, known) if known else "no task is open"
        filled.object_to(f"There is no task '{unknown[0].raw}'; {near}", "task_label")
    if len(labels) == 1:
        filled.parameters["task_label"] = labels[0].value
    elif labels:
        filled.several = [str(one.value) for one in labels]
    elif not unknown:
        _task_at(heard, filled)
    if not filled.trouble and re.search(
        r"\b(all|every|each|both|any|several|many|some) (of )?(the |my |our |other )*"
        r"(tasks|jobs|orders|errands|deliveries|them|task|job)\b(?! else)",
        re.sub(r"\b(before|after|over|above|ahead of|than) (all|every|any)( of)? (the )?\w+", " ", heard.line),
    ):
        filled.object_to("I change one task at a time. " + ask_label(heard), "task_label")


def _task_at(heard: Heard, filled: Filled) -> None:
    """Find the task that is told by where it is."""
    spots = [n for n, one in enumerate(heard.tokens) if one.kind in ("point", "place")]
    if unknown := heard.of("unknown_place"):
        filled.object_to(unknown_place(heard, unknown[0]) + " " + ask_label(heard), "task_label")
    if len(spots) != 1:
        filled.object_to(ask_label(heard), "task_label")
        return
    token = heard.tokens[spots[0]]
    fits = tasks_at(heard.live, token)
    if len(fits) == 1 and not is_vague(heard.tokens, spots[0]):
        filled.parameters["task_label"] = fits[0]
        return
    if fits:
        filled.object_to(f"Which task is meant? With a stop at {token.raw}: {', '.join(fits)}", "task_label")
    else:
        filled.object_to(f"No open task has a stop at {token.raw}. {ask_label(heard)}", "task_label")


def tasks_at(live: Live, spot: Token) -> list[str]:
    """Open tasks with a stop at a place or point."""
    places = live.scene.mission.places
    at = places[spot.value] if spot.kind == "place" else spot.value
    return [
        id
        for id in open_tasks(live)
        if any(math.dist(stop.at, at) < 0.05 for stop in live.state.tasks[id].stops)
    ]


def _read_changed_priority(heard: Heard, filled: Filled, meant: str | None) -> None:
    said = said_priority(heard.line)
    if len(said) == 1 and meant in said:
        filled.parameters["priority"] = meant
    elif not said and meant is not None:
        filled.parameters["priority"] = meant
    else:
        filled.object_to("Which priority: low, normal or high?", "priority")


# -- obstacles


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
    if unknown := heard.of("unknown_place"):
        filled.object_to(unknown_place(heard, unknown[0]) + " " + ask_extent(), "obstacle_location")
    elif vague is not None:
        filled.object_to(f"Where exactly? '{vague.raw}' says only roughly. {ask_extent()}",
                         "obstacle_location")  # fmt: skip
        return
    add_points(heard, filled, points)


def add_points(heard: Heard, filled: Filled, points: Sequence[Point]) -> None:
    """Give an obstacle its points, or ask for more."""
    for at in points:
        if why := outside(heard, at):
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
        filled.object_to(f"There is no obstacle '{unknown[0].raw}'. {ask_obstacle(heard)}", "obstacle")
        return
    kinds = {one.value for one in heard.of("kind")}
    points = [one.value for one in heard.of("point")]
    fits = [
        id
        for id, one in known.items()
        if (not kinds or one.kind in kinds)
        and all(_touches(one.polygon, at) for at in points)
    ]
    told = kinds or points or re.search(r"\b(obstacle|obstruction|blockage|barrier)\b", heard.line)
    some = re.search(r"\b(a|an|any|some|one of|all|every)( of)?( the)? (<kind>|obstacles?)", heard.line)
    if told and not some and len(fits) == 1:
        filled.parameters["obstacle"] = fits[0]
    else:
        filled.object_to(ask_obstacle(heard, fits), "obstacle")


def _touches(polygon: Sequence[Point], at: Point) -> bool:
    """Whether a point is within a polygon's bounding box, or 0.3 m of it."""
    xs, ys = [x for x, _ in polygon], [y for _, y in polygon]
    return (
        min(xs) - 0.3 <= at[0] <= max(xs) + 0.3 and min(ys) - 0.3 <= at[1] <= max(ys) + 0.3
    )


# -- robots


def _robot(heard: Heard, filled: Filled) -> None:
    robots = heard.of("robot")
    if unknown := heard.of("unknown_robot"):
        known = ", ".join(heard.live.state.robots)
        filled.object_to(f"There is no robot '{unknown[0].raw}'. Known: {known}.", "robot")
    elif len(robots) == 1:
        filled.parameters["robot"] = robots[0].value
    elif any(one.value == "all" for one in robots):
        filled.object_to("All robots, or some? " + ask_robot(heard), "robot")
    elif robots:
        filled.several = [str(one.value) for one in robots]
    elif len(heard.live.state.robots) == 1 and re.search(r"\bthe robot\b", heard.line):
        filled.parameters["robot"] = next(iter(heard.live.state.robots))
    else:
        filled.missing.append("robot")


def _failed_robot(heard: Heard, filled: Filled) -> None:
    _robot(heard, filled)
    if filled.parameters.get("robot") == "all":
        filled.object_to("Which robot failed? " + ask_robot(heard), "robot")


def _nothing(heard: Heard, filled: Filled) -> None:
    return None


_FILL: Mapping[str, Callable[[Heard, Filled], None]] = {
    "add_task": _task_to_add,
    "obstacle_update": _obstacle_to_add,
    "change_task_priority": read_task,
    "cancel_task": read_task,
    "remove_obstacle": _obstacle_to_remove,
    "pause_robot": _robot,
    "resume_robot": _robot,
    "robot_failed": _failed_robot,
    "query_status": _nothing,
    "undo": _nothing,
}

# -- questions


def ask_location(heard: Heard) -> str:
    """Ask where a task is picked up."""
    return "Where is it picked up? Give a point in metres, e.g. (5, 19.5)."


def ask_delivery(heard: Heard) -> str:
    """Ask where a task goes."""
    places = list(heard.live.scene.mission.places)
    known = f"Places: {', '.join(places)}; e.g. 'to {places[0]}'." if places else "E.g. 'to (6, 3)'."
    return f"Where does it go? {known}"


def ask_extent() -> str:
    """Ask for the points of an obstacle."""
    return (
        "Where does it reach? Give its two ends, e.g. from (7, 5) to (8, 5), or its corners, e.g. "
        "(7, 5), (8, 5), (8, 4)."
    )


def ask_label(heard: Heard) -> str:
    """Ask which task is meant."""
    labels = open_tasks(heard.live)
    shown = ", ".join(labels[:30]) + (", ..." if len(labels) > 30 else "")
    return f"Which task? Say its label, e.g. 'task {labels[0]}'. Open: {shown}" if labels else "No task is open."


def ask_obstacle(heard: Heard, fits: Sequence[str] = ()) -> str:
    """Ask which obstacle is meant."""
    known = list(fits) or list(heard.live.state.obstacles)
    if not known:
        return "No obstacle is known that could be removed."
    return f"Which obstacle? Say its name, e.g. '{known[0]}'. Known: {', '.join(known[:30])}"


def ask_robot(heard: Heard) -> str:
    """Ask which robot is meant."""
    robots = list(heard.live.state.robots)
    return f"Which robot? E.g. '{robots[0]}'. Known: {', '.join(robots[:30])}"


def ask(heard: Heard, missing: Sequence[str]) -> str:
    """Ask for parameters."""
    questions = {
        "location": ask_location,
        "delivery_point": ask_delivery,
        "obstacle_location": lambda _: ask_extent(),
        "task_label": ask_label,
        "obstacle": ask_obstacle,
        "robot": ask_robot,
        "priority": lambda _: "Which priority: low, normal or high?",
        "task_type": lambda h: f"Which type? {', '.join(h.live.scene.mission.task_types)}",
        "obstacle_type": lambda _: "Which kind is it, e.g. wall?",
    }
    return " ".join(questions[one](heard) for one in missing)
