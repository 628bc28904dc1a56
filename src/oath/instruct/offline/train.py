"""Trains the offline interpreter's models: ``python -m oath.instruct.offline.train``.

The weights are the only minimum of strictly convex functions, so that whoever trains finds the
same; what is drawn has a fixed seed. Whether an instruction is clear is learnt from how those
were understood by models that had not seen their family.
"""

from __future__ import annotations

import csv
import hashlib
import io
import random
import re
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import click
import numpy as np

from oath.bench.utterances import Utterance, read, same, world
from oath.commands import AddTask, ChangeTaskPriority, Live, ObstacleUpdate
from oath.instruct import Dialogue, Reply
from oath.instruct.offline import Offline, features
from oath.instruct.offline.corpus import (
    GATED,
    LEXICON,
    SOURCE,
    Drawn,
    concepts,
    drawn,
    everyday,
    lexicon,
    lines,
)
from oath.instruct.offline.features import SPOTS
from oath.instruct.offline.gates import as_line
from oath.instruct.offline.model import NAMES, WEIGHTS, Linear, Models, key
from oath.instruct.offline.names import Names, plain, single, tag
from oath.instruct.offline.new_task import said_priority
from oath.instruct.offline.spelling import nearest
from oath.instruct.offline.tokens import Token

FOLDS = 4
"""Parts of the families; each is understood by models trained on the others."""

ASIDE, PLAIN = 0.3, 1.5
"""How much an utterance with an aside and one drawn of a template weigh in what is clear."""


@dataclass(frozen=True, slots=True)
class Heard:
    """An utterance with its tokens."""

    said: Utterance
    tokens: tuple[Token, ...]


# -- fitting


def fit(
    rows: Sequence[set[str]],
    labels: Sequence[str],
    *,
    strength: float = 0.05,
    weights: Sequence[float] | None = None,
    balance: float = 0.5,
    mean: bool = True,
) -> Linear:
    """Softmax regression: least cross entropy plus ``strength / 2 |weights|^2``.

    Parameters
    ----------
    rows, labels
        The features of examples, and their classes.
    weights
        How much each example weighs.
    balance
        With 1 all classes weigh the same in sum, with 0 each example does.
    mean
        See `Linear`. Features of one example only are left out.
    """
    from scipy.optimize import minimize
    from scipy.sparse import csr_array

    counts = Counter(one for row in rows for one in row)
    names = sorted(one for one, count in counts.items() if count > 1)
    index = {name: n for n, name in enumerate(names)}
    classes = sorted(set(labels))
    at, columns, values = [0], [], []
    for row in rows:
        known = sorted(index[one] for one in row if one in index)
        columns += known
        values += [1.0 / np.sqrt(max(len(known), 1)) if mean else 0.1] * len(known)
        at.append(len(columns))
    x = csr_array((values, columns, at), shape=(len(rows), len(names)))
    back = x.T.tocsr()
    truth = np.zeros((len(rows), len(classes)))
    truth[np.arange(len(rows)), [classes.index(one) for one in labels]] = 1.0
    share = truth.sum(axis=0)
    weight = (truth @ (share.mean() / share) ** balance)[:, None]
    if weights is not None:
        weight = weight * np.asarray(weights)[:, None]

    def loss(flat: np.ndarray) -> tuple[float, np.ndarray]:
        table = flat.reshape(len(names) + 1, len(classes))
        score = x @ table[:-1] + table[-1]
        score -= score.max(axis=1, keepdims=True)
        total = np.log(np.exp(score).sum(axis=1, keepdims=True))
        value = -(weight * truth * (score - total)).sum() + strength / 2 * (table**2).sum()
        error = weight * (np.exp(score - total) - truth)
        gradient = np.vstack([back @ error, error.sum(axis=0)]) + strength * table
        return float(value), gradient.ravel()

    start = np.zeros((len(names) + 1) * len(classes))
    best = minimize(
        loss, start, jac=True, method="L-BFGS-B", options={"maxiter": 300, "ftol": 1e-8}
    )
    table = best.x.reshape(len(names) + 1, len(classes))
    keys = np.array([key(name) for name in names], dtype=np.uint32)
    order = np.argsort(keys)
    return Linear(tuple(classes), keys[order], table[:-1][order], table[-1], mean=mean)


# -- what was said


HERE = Path(__file__).parent


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


# -- training


def train(said: Sequence[Utterance], templates: Sequence[Drawn], around: Sequence[Aside]) -> Models:
    """All models, from utterances and templates."""
    said = [*said, *corrected(said, world())]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        work = [pool.submit(judged, said, templates, around, n) for n in range(FOLDS)]
        models = understanding(said, templates, worlds())
        rows = [row for one in work for row in one.result()]
    clear = fit(
        [found for found, _, _ in rows],
        ["act" if right else "hold" for _, right, _ in rows],
        weights=[weight for _, _, weight in rows],
        mean=False,
    )
    return replace(models, clear=clear)


Judged = tuple[set[str], bool, float]
"""What an instruction looks like that could be acted on, whether that is right, its weight."""


def judged(
    said: Sequence[Utterance], templates: Sequence[Drawn], around: Sequence[Aside], part: int
) -> list[Judged]:
    """How one part of the families is understood by models trained on the others."""
    there = worlds()
    others = [one for one in said if _part(one.family) != part]
    own = [one for one in said if _part(one.family) == part]
    models = understanding(others, templates, there)
    rng = random.Random(part)
    told = Told(models)
    return [*understood(own, told, around, there, rng), *understood_drawn(told, there[False], part)]


def _part(family: str) -> int:
    return zlib.crc32(family.encode()) % FOLDS


_EMPTY = Linear(("act",), np.zeros(0, dtype=np.uint32), np.zeros((0, 1)), np.zeros(1))


def understanding(
    said: Sequence[Utterance], templates: Sequence[Drawn], there: Mapping[bool, Live]
) -> Models:
    """The models but for what is clear, which takes everything to be."""
    rows, macros = lines()
    alike, words = concepts(macros), everyday(rows, macros)
    labels = list(there[False].state.tasks)
    names = list(label_or_word(said, labels))
    name = fit([found for found, _ in names], [label for _, label in names], strength=0.3)
    counts = Counter(
        word for one in said for word in {t.text for t in plain(one.turns[-1]) if t.kind == "word"}
    )
    known = words | {word for word, count in counts.items() if _is_word(word, count, words)}
    known |= {word for some in lexicon().values() for one in some for word in one.split()}
    blank = Models(
        intent=_EMPTY,
        priority=_EMPTY,
        mention=_EMPTY,
        kind=_EMPTY,
        name=name,
        clear=_EMPTY,
        everyday=words,
        known=frozenset(known),
        concepts=alike,
    )
    called = {paused: Names.of(live, blank) for paused, live in there.items()}
    heard = [Heard(one, tuple(tag(one.turns[-1], called[one.resumes]))) for one in said]
    drawn_ = [one for one in templates if one.line.intent != GATED]

    line = {id(one): features.of_line(one.tokens, alike) for one in heard}
    line |= {id(one): features.of_line(one.tokens, alike) for one in drawn_}
    told = [one for one in heard if one.said.intent or one.said.kind == "none"]
    intents = [_intent(one.said) for one in told]
    intent = fit(
        [line[id(one)] for one in (*told, *drawn_)],
        [*intents, *(one.line.intent.partition(":")[0] for one in drawn_)],
    )

    asked = [(one, what) for one in heard if (what := priority(one.said))]
    changes = [one for one in drawn_ if one.line.intent.startswith("change_task_priority:")]
    rates = [
        features.of_priority(line[id(one)], one.said.intent, said_priority(as_line(one.tokens)))
        for one, _ in asked
    ]
    rates += [
        features.of_priority(
            line[id(one)], "change_task_priority", said_priority(as_line(one.tokens))
        )
        for one in changes
    ]
    wanted = [what for _, what in asked] + [one.line.intent.partition(":")[2] for one in changes]
    rate = fit(rates, wanted)

    spots = [
        (features.of_mention(one.tokens, at, alike, one.said.intent), role)
        for one in heard
        for at, role in roles(one, there[one.said.resumes])
    ]
    placed = [
        (features.of_mention(one.tokens, at, alike, one.line.intent), role)
        for one in drawn_
        for at, role in one.roles
    ]
    mention = fit(
        [found for found, _ in (*spots, *placed)],
        [role for _, role in (*spots, *placed)],
    )

    words_of = [
        (features.of_kind(one.tokens, at, alike), part)
        for one in heard
        for at, part in kind_words(one) or ()
    ]
    kind = fit(
        [found for found, _ in words_of],
        [label for _, label in words_of],
        strength=0.3,
        balance=0.3,
    )
    return replace(blank, intent=intent, priority=rate, mention=mention, kind=kind)


def _is_word(word: str, count: int, everyday: frozenset[str]) -> bool:
    """Whether a word that was said is none that somebody mistyped."""
    return word.isalpha() and count > (1 if nearest(word, everyday) is None else 8)


def _intent(said: Utterance) -> str:
    if said.kind == "none":
        return said.intent or "other"
    return said.intent


class Told:
    """An interpreter that takes everything to be clear, and what it was asked about."""

    def __init__(self, models: Models) -> None:
        self.models = models
        self.asked: list[set[str]] = []
        self._offline = Offline(replace(models, clear=self))

    def __call__(self, found: set[str]) -> dict[str, float]:
        """See `Linear`."""
        self.asked.append(found)
        return {"act": 1.0}

    def hear(self, text: str, live: Live) -> Reply:
        """Interpret; `asked` is empty if nothing would be proposed."""
        self.asked = []
        reply = self._offline.interpret(Dialogue(said=(text,)), live)
        if reply.status != "complete":
            self.asked = []
        return reply


def understood(
    said: Sequence[Utterance],
    told: Told,
    around: Sequence[Aside],
    there: Mapping[bool, Live],
    rng: random.Random,
) -> Iterator[Judged]:
    """How utterances, alone and with something around them, look if they are acted on."""
    for one in said:
        text, live = one.turns[-1], there[one.resumes]
        right = _right(one, told.hear(text, live), live)
        alone = told.asked
        for found in alone:
            yield found, right, 1.0
        if not alone:
            continue
        for aside in rng.sample(around, 2 if right else 1):
            if aside.kind == "hold" and not right:
                continue
            before = aside.where == "before"
            longer = f"{aside.text} {text}" if before else text + aside.text
            still = _right(one, told.hear(longer, live), live)
            for found in told.asked:
                yield found, still and aside.kind == "harmless", ASIDE


def understood_drawn(told: Told, live: Live, seed: int) -> Iterator[Judged]:
    """How utterances drawn of templates look if they are acted on."""
    for one in drawn(seed, 2, Names.of(live, told.models)):
        intent = one.line.intent.partition(":")[0]
        right = told.hear(one.text, live).intent == intent
        for found in told.asked:
            yield found, right, PLAIN


def _right(one: Utterance, reply: Reply, live: Live) -> bool:
    if one.kind == "none" and one.intent == "query_status":
        return all(command.intent == "query_status" for command in reply.commands)
    return one.kind == "full" and same(reply.commands, one.commands, live, kinds=False)


LEAST = 3
"""Features whose weights are less than so many 127ths of the greatest are left out."""


def digest() -> str:
    """Tells the data, so that weights that were made of other data are found out."""
    files = [HERE / name for name in ("said.csv", "asides.csv", LEXICON, SOURCE)]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def pack(models: Models) -> bytes:
    """The models as the file that is shipped."""
    alike = [
        "\t".join((group, *phrase)) for some in models.concepts.values() for phrase, group in some
    ]
    arrays: dict[str, np.ndarray] = {
        "everyday": _text(sorted(models.everyday)),
        "known": _text(sorted(models.known)),
        "concepts": _text(alike),
        "data": _text([digest()]),
    }
    for name in NAMES:
        one: Linear = getattr(models, name)
        scale = np.abs(one.weights).max() / 127.0
        table = np.rint(one.weights / scale).astype(np.int8)
        keep = np.abs(table).max(axis=1) >= LEAST
        arrays[f"{name}_classes"] = _text(one.classes)
        arrays[f"{name}_keys"] = one.keys[keep]
        arrays[f"{name}_weights"] = table[keep]
        arrays[f"{name}_bias"] = one.bias.round(4)
        arrays[f"{name}_scale"] = np.array(scale)
        arrays[f"{name}_mean"] = np.array(one.mean)
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _text(words: Sequence[str]) -> np.ndarray:
    return np.frombuffer("\n".join(words).encode(), dtype=np.uint8)


def main() -> None:
    """Train on the shipped utterances and write the weights beside them."""
    known, templates = said(), list(drawn())
    click.echo(f"{len(known)} utterances, {len(templates)} drawn of templates")
    data = pack(train(known, templates, asides()))
    (HERE / WEIGHTS).write_bytes(data)
    click.echo(f"{WEIGHTS}: {len(data)} bytes")


if __name__ == "__main__":
    main()
