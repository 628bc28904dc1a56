"""What people said, and what of it the models learn: roles, names, kinds, priorities, corrections.

``said.csv`` holds utterances in families, each with what it means in the paper's maze, in the form
of `oath.bench.utterances`; ``asides.csv`` what people say around an instruction, which is harmless,
or holds it back.
"""

from __future__ import annotations

import csv
import io
import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from oath.bench.utterances import Utterance, read, world
from oath.commands import AddTask, ChangeTaskPriority, Live, ObstacleUpdate
from oath.instruct.offline import features
from oath.instruct.offline.features import SPOTS
from oath.instruct.offline.names import plain, single
from oath.instruct.offline.tokens import Token

HERE = Path(__file__).parent


@dataclass(frozen=True, slots=True)
class Heard:
    """An utterance with its tokens."""

    said: Utterance
    tokens: tuple[Token, ...]


def said() -> list[Utterance]:
    """What people said."""
    return read(HERE / "said.csv")


@dataclass(frozen=True, slots=True)
class Aside:
    """What is said before or after an instruction; it may hold it back."""

    text: str
    where: str
    kind: str


def asides() -> list[Aside]:
    """What people say around instructions."""
    text = (HERE / "asides.csv").read_text(encoding="utf-8")
    return [Aside(**row) for row in csv.DictReader(io.StringIO(text))]


def worlds() -> dict[bool, Live]:
    """The world that utterances are about, by whether robots are paused in it."""
    return {paused: world(paused=paused) for paused in (False, True)}


def named_in(said: Utterance, name: str) -> set[str]:
    """The values of a parameter in what is meant."""
    found = (getattr(command, name, None) for command in said.commands)
    return {one.casefold() for one in found if isinstance(one, str)}


def roles(heard: Heard, live: Live) -> Iterator[tuple[int, str]]:
    """What is named in an utterance of one kind of command, by index, and what for."""
    intents = {one.intent for one in heard.said.commands}
    if heard.said.kind == "ambiguous":
        yield from _unknown(heard)
    if heard.said.kind != "full" or len(intents) != 1:
        return
    meant = heard.said.commands[0]
    intent, places = intents.pop(), live.scene.mission.places
    for at, token in enumerate(heard.tokens):
        kind = token.kind
        if intent == "add_task" and kind in ("label", "unknown_label"):
            yield at, "meant" if token.text in named_in(heard.said, "task_label") else "other"
        elif isinstance(meant, AddTask) and kind in SPOTS and len(heard.said.commands) == 1:
            task = meant.filled(live)
            here = places[token.value] if kind == "place" else token.value
            there = task.delivery_point
            if here == task.location:
                yield at, "pickup"
            else:
                yield at, "delivery" if token.value == there or here == there else "other"
        elif intent == "obstacle_update" and kind == "point":
            told = [one for one in heard.said.commands if isinstance(one, ObstacleUpdate)]
            known = {point for one in told for point in one.obstacle_location}
            yield at, "meant" if token.value in known else "other"
        elif kind in ("label", "robot", "obstacle") and kind in _NAMED.get(intent, ()):
            name = "task_label" if kind == "label" else kind
            wanted = named_in(heard.said, name)
            yield at, "meant" if token.value in wanted or "all" in wanted else "other"
        elif kind.removeprefix("unknown_") in _NAMED.get(intent, ()):
            yield at, "other"


def _unknown(heard: Heard) -> Iterator[tuple[int, str]]:
    """What is named in an utterance that names nothing that exists."""
    kinds = _NAMED.get(heard.said.intent, ())
    known = any(one.kind in kinds for one in heard.tokens)
    for at, token in enumerate(heard.tokens):
        if token.kind.removeprefix("unknown_") in kinds and token.kind not in kinds and not known:
            yield at, "meant"


_NAMED = {
    "change_task_priority": ("label",),
    "cancel_task": ("label",),
    "pause_robot": ("robot",),
    "resume_robot": ("robot",),
    "robot_failed": ("robot",),
    "remove_obstacle": ("obstacle",),
}


def kind_words(heard: Heard) -> list[tuple[int, str]] | None:
    """For words of a new obstacle whether they say what it is: ``noun``, what goes ``with`` it.

    None if that is not known.
    """
    meant = heard.said.commands[0] if len(heard.said.commands) == 1 else None
    if heard.said.kind != "full" or not isinstance(meant, ObstacleUpdate):
        return None
    told = meant.obstacle_type or ""
    wanted = [single(one) for one in re.findall(r"[a-z0-9'-]+", told.casefold())]
    words = [single(one.text) for one in heard.tokens]
    starts = [n for n in range(len(words)) if words[n : n + len(wanted)] == wanted]
    if wanted and not starts:
        return None
    inside = range(starts[0], starts[0] + len(wanted)) if wanted else range(0)
    return [
        (n, "no" if n not in inside else "noun" if n == inside[-1] else "with")
        for n, one in enumerate(heard.tokens)
        if features.may_name(one)
    ]


def priority(said: Utterance) -> str | None:
    """The priority that an utterance asks for, ``none`` if none; None if it is not about one."""
    meant = said.commands[0] if len(said.commands) == 1 else None
    if said.kind != "full" or not isinstance(meant, AddTask | ChangeTaskPriority):
        return None
    return meant.priority or "none"


def label_or_word(
    said: Sequence[Utterance], known: Sequence[str]
) -> Iterator[tuple[set[str], str]]:
    """Words that may be labels, as ``be``, and which they are."""
    like = {one for one in known if one in ("be", "he")}
    for one in said:
        labels = named_in(one, "task_label")
        for text in _with_other_labels(one.turns[-1], labels, sorted(like)):
            words = [t.text if t.kind in ("word", "mark") else f"<{t.kind}>" for t in plain(text)]
            own = labels | (like if text != one.turns[-1] else set())
            for n, word in enumerate(words):
                if word in like and (one.kind == "full" or word not in labels):
                    found = features.of_name(words[max(n - 3, 0) : n], words[n + 1 : n + 4])
                    yield found, "label" if word in own else "word"


def _with_other_labels(text: str, labels: set[str], others: Sequence[str]) -> Iterator[str]:
    yield text
    if len(labels) == 1 and not labels & set(others):
        label = next(iter(labels))
        for other in others:
            if not re.search(rf"\b{other}\b", text, re.IGNORECASE):
                yield re.sub(rf"\b{label}\b", other, text, flags=re.IGNORECASE)


_INSTEAD = (
    "{0}, no, {1}", "{0}, sorry, {1}", "{0}... no wait, {1}", "{0}, I mean {1}", "{0}, er, {1}",
    "{0}, correction, {1}", "{0} - no, make that {1}", "{0}, or rather {1}", "{0}, no sorry, {1}",
    "not {0}, {1}", "{1} (not {0})", "{1}, not {0},", "{1} and not {0}", "{1} rather than {0}",
    "{0}, scratch that, {1}", "{0}, I meant {1}", "{0}, oops, {1}", "{0}, excuse me, {1}",
    "{0}, wait, {1}", "{0}, wrong, {1}", "{1}, leave {0} alone,", "{0}, no no, {1}",
)  # fmt: skip
"""How people correct a name while they speak."""

CORRECTED = 0.25
"""The share of what names one thing that is said again with a correction."""


def corrected(said: Sequence[Utterance], live: Live, seed: int = 0) -> Iterator[Utterance]:
    """Utterances in which a name is corrected at once; what is meant stays the same."""
    rng = random.Random(seed)
    others = {
        "task_label": [*live.state.tasks],
        "robot": [*live.state.robots],
        "obstacle": [*live.state.obstacles],
    }
    for one in said:
        values = {
            (name, value) for name in others for value in named_in(one, name) if value != "all"
        }
        if one.kind != "full" or len(one.commands) != 1 or len(values) != 1:
            continue
        name, value = values.pop()
        found = re.findall(rf"(?<![\w-]){re.escape(value)}(?![\w-])", one.turns[-1], re.IGNORECASE)
        if len(found) != 1 or rng.random() > CORRECTED:
            continue
        other = rng.choice([known for known in others[name] if known != value])
        text = one.turns[-1].replace(found[0], rng.choice(_INSTEAD).format(other, found[0]))
        yield replace(one, turns=(text,))
