"""The parameters of a task to add: where, where to, type, priority and label."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from oath.instruct.offline import questions
from oath.instruct.offline.gates import is_vague
from oath.instruct.offline.heard import Filled, Heard
from oath.instruct.offline.tokens import Token

_LOW = re.compile(
    r"\b(low(est|er)?( |-)?priority|priority (is |of |to |at |: |= )*(low\w*|minimum)|(not"
    r"|no longer|less|least|"
    r"isn't) (so |that |very |really |too )?(urgent|important|pressing|critical)|no (rush|hurry|"
    r"urgency|pressure)|low|(?<!not )(?<!hardly )(?<!never )can wait|at the end|lowest"
    r"|whenever (you|there|it)|unimportant|"
    r"take your time|all the time in the world|plenty of time|nothing important|depriorit\w+"
    r"|downgrad\w+|demot\w+|last|no stress|at (your|their) leisure"
    r"|when(ever)? (it is )?convenient|nothing urgent|in (your|their) own time"
    r"|not pressing|back burner|bottom of the (list|queue|pile|stack)|back of the (list|queue"
    r"|line)|no biggie"
    r"|(drop|lower|reduce|decrease|cut)( the| its)? priority"
    r"|in no (hurry|rush)|leisurely|(any|some) time will do|can be late|nothing pressing"
    r"|when (you have|there is) (some |)time|not in a hurry)\b"
)
_HIGH = re.compile(
    r"\b((?<!not )(?<!no longer )(?<!not so )(?<!not very )(?<!not that )(urgent(ly)?|asap"
    r"|critical|pressing|express)|"
    r"(high(est|er)?|top|maximum|first|max)( |-)?priority|priority (is |of |to |at |: "
    r"|= )*(high\w*|urgent|top|1|one)|"
    r"as soon as possible|immediately|right away|at once|emergency|rush|high|quickly|"
    r"(can|could|must|should|may) not wait|"
    r"(raise|increase|boost|bump up|up)( the| its)? priority|on the double|trumps everything"
    r"|beats everything|"
    r"pronto|stat|chop chop|snappy|sharpish|double quick|posthaste|post-haste|utmost"
    r"|(?<!no )(?<!not in a )(?<!any )hurry|(?<!no )(?<!not )urgency|in haste"
    r"|top of the (list|queue|pile|stack)"
    r"|front of the (list|queue|line|pile)|number one|(?<!not )time-critical|get a move on"
    r"|hammer down|step on it"
    r"|lickety-split|hot|hotfoot|tout de suite|this instant|this minute|this second"
    r"|life or death|now or never"
    r"|cannot wait|must not wait|can not wait|"
    r"with priority|straight away|without delay|before (all|everything|anything)( else"
    r"| others?)?)\b"
)
_NORMAL = re.compile(
    r"\b(normal|regular|standard|default|medium|usual) (priority|urgency)\b|\bpriority (is |of "
    r"|to |"
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
        line = _LOW.sub(" ", line)
    if _HIGH.search(line):
        found.add("high")
    return found


def asked_priority(heard: Heard, filled: Filled, intent: str) -> str | None:
    """The priority that an instruction asks for; None if none is."""
    shares = heard.models.priorities(heard.tokens, intent, said_priority(heard.line))
    if intent == "change_task_priority":
        shares = {one: share for one, share in shares.items() if one != "none"}
    best = max(shares, key=lambda one: shares[one])
    if (sure := shares[best] / sum(shares.values())) < 0.85:
        filled.signs.add("priority unsure" if sure > 0.6 else "priority very unsure")
    return None if best == "none" or sure < UNSURE_PRIORITY else best


UNSURE_PRIORITY = 0.5
"""How probable a priority must be at least to be taken."""

_TYPES_ELSEWHERE = frozenset(
    [
        "inspection",
        "inspect",
        "cleaning",
        "clean",
        "survey",
        "patrol",
        "scan",
        "scanning",
        "photo",
        "maintenance",
        "repair",
        "fragile",
        "heavy",
        "surveillance",
        "monitoring",
        "sampling",
        "measurement",
        "mapping",
        "welding",
        "painting",
        "refrigerated",
        "cold",
        "hazardous",
        "disinfection",
        "security",
        "guarding",
        "charging",
        "assembly",
    ]
)

_NEW_LABEL = re.compile(
    r"^(?:call(?:ed)? (?:it|this|that|the task|the job|this one|the new one"
    r"|the new task)(?: task| as)?"
    r"|nam(?:e|ed)(?: it| this| the task| as)?|label(?:l?ed)?(?: it| is| of| as| the task"
    r"| should be)?"
    r"|called|with (?:the )?(?:label|name|id)|(?:its )?(?:id|label|name) (?:is|should be"
    r"|shall be)|id|"
    r"tag(?:ged)?(?: it)?(?: as)?|under the (?:name|label)|identifier|known as"
    r"|labell?ed as)(?: :| =)?$"
)
_NO_LABEL = frozenset(
    [
        "a",
        "an",
        "the",
        "it",
        "this",
        "that",
        "as",
        "to",
        "at",
        "for",
        "with",
        "and",
        "or",
        "of",
        "in",
        "new",
        "task",
        "job",
        "high",
        "low",
        "normal",
        "urgent",
        "special",
        "please",
        "is",
        "from",
        "by",
        "on",
        "priority",
        "label",
        "name",
        "id",
        "called",
        "me",
        "us",
        "you",
    ]
)


def read_new_task(heard: Heard, filled: Filled) -> None:
    """Read the parameters of a task to add."""
    read_new_label(heard, filled)
    read_type(heard, filled)
    line = heard.line
    if priority := asked_priority(heard, filled, "add_task"):
        filled.parameters["priority"] = priority
    robots = [one for one in heard.of("robot", "unknown_robot") if one.value != "all"]
    if robots and not filled.trouble:
        filled.object_to(
            f"Which robot does a task is decided by the planner; I cannot give it to "
            f"{robots[0].raw}. Say it without the robot."
        )
    _places(heard, filled)
    for name in ("location", "delivery_point"):
        if name not in filled.parameters and name not in filled.missing:
            filled.missing.append(name)
    if not filled.trouble and re.search(r"\b(two|three|four|several|some|many|few|both) (\w+ )?"
                                        r"(tasks|jobs|orders|errands|deliveries)\b"
                                        r"|<number> (\w+ )?(tasks|jobs)",
                                        line):  # fmt: skip
        filled.object_to(
            "Several tasks at once: tell me one at a time, each with where and where to."
        )


def read_new_label(heard: Heard, filled: Filled) -> None:
    """Read the label that a task to add is given."""
    labels: list[str] = []
    for n, token in enumerate(heard.tokens):
        before = [
            one.text for one in heard.tokens[max(n - 5, 0) : n] if one.kind in ("word", "mark")
        ]
        after = " ".join(one.text for one in heard.tokens[n + 1 : n + 4])
        cued = bool(re.match(r"as (its |the |a )?(label|id|name|identifier)\b", after)) or any(
            _NEW_LABEL.match(" ".join(before[k:])) for k in range(len(before))
        )
        told = token.kind == "unknown_label" and (
            heard.models.role(heard.tokens, n, "add_task").get("meant", 0.0) > 0.5
        )
        if told or (
            cued
            and token.kind in ("word", "label", "place", "robot", "type", "number")
            and token.text not in _NO_LABEL
            and re.fullmatch(r"\w[\w.-]{0,63}", token.raw)
        ):
            labels.append(token.raw)
        elif token.kind == "label":
            filled.signs.add("label of another")
    if len(set(labels)) > 1:
        filled.object_to(f"Which label: {' or '.join(labels)}?", "task_label")
    elif not labels and (odd := _unused(heard)):
        filled.object_to(f"What is '{odd.raw}'? If it is the label, say 'label {odd.raw}'.")
    elif labels:
        filled.parameters["task_label"] = labels[0]
        known = {one.casefold(): one for one in heard.live.state.labels}
        if labels[0].casefold() in known:
            filled.object_to(
                f"The label {known[labels[0].casefold()]} is taken. Give another one.", "task_label"
            )


def _unused(heard: Heard) -> Token | None:
    """A word such as ``q9`` that can only be a label, but is not said to be."""
    for before, token in pairwise(heard.tokens):
        like = token.kind == "word" and re.fullmatch(r"[a-z]{1,4}[-_]?\d{1,4}", token.text)
        if like and before.text in ("add", "new", "create", "task", "job", "order"):
            return token
    return None


def read_type(heard: Heard, filled: Filled) -> None:
    """Read a task's type."""
    types = heard.of("type")
    known = heard.live.scene.mission.task_types
    if len(types) > 1:
        filled.object_to(
            f"Which type: {' or '.join(str(one.value) for one in types)}?", "task_type"
        )
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
    if len({str(heard.tokens[n].value) for n in spots}) > 2:
        filled.signs.add("many places")
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
    if is_vague(heard.tokens, at):
        ask = questions.ask_location if name == "location" else questions.ask_delivery
        filled.signs.add("vague")
        filled.doubt = (name, f"Where exactly? '{token.raw}' says only roughly. {ask(heard)}")
    if token.kind == "unknown_place":
        filled.object_to(questions.unknown_place(heard, token), name)
    elif token.kind == "place" and name == "delivery_point":
        filled.parameters[name] = token.value
    else:
        x, y = mission.places[token.value] if token.kind == "place" else token.value
        if why := questions.outside(heard, (x, y)):
            filled.object_to(why, name)
        else:
            filled.parameters[name] = [x, y]


def _roles(heard: Heard, at: int) -> dict[str, float]:
    share = heard.models.role(heard.tokens, at, "add_task")
    return {one: share.get(one, 0.0) + 1e-9 for one in ("pickup", "delivery", "other")}


SURE = 0.65
"""How likely a reading of the places must be to be proposed."""


def assign_roles(heard: Heard, spots: Sequence[int]) -> dict[int, str] | None:
    """The most likely roles of places and points, at most one of each; None if that is unsure."""
    share = [_roles(heard, at) for at in spots]
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
