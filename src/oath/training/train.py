"""Trains the offline interpreter's models: ``python -m oath.training``.

The weights are the only minimum of strictly convex functions, so that whoever trains finds the
same; what is drawn has a fixed seed. Whether an instruction is clear is learnt from how those
were understood by models that had not seen their family.
"""

from __future__ import annotations

import hashlib
import io
import random
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from importlib.resources import files
from multiprocessing import get_context
from pathlib import Path

import click
import numpy as np

from oath.bench.utterances import Utterance, same, world
from oath.commands import Live
from oath.instruct import Dialogue, Reply
from oath.instruct.offline import Offline, features
from oath.instruct.offline.features import Concepts
from oath.instruct.offline.gates import as_line
from oath.instruct.offline.model import NAMES, WEIGHTS, Linear, Models, key
from oath.instruct.offline.names import Names, plain, tag
from oath.instruct.offline.new_task import said_priority
from oath.instruct.offline.spelling import nearest
from oath.instruct.offline.tokens import Token
from oath.training.said import (
    HERE,
    Aside,
    Heard,
    asides,
    corrected,
    kind_words,
    label_or_word,
    priority,
    roles,
    said,
    worlds,
)
from oath.training.templates import (
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

FOLDS = 4
"""Parts of the families; each is understood by models trained on the others."""

ASIDE, PLAIN = 0.3, 1.5
"""How much an utterance with an aside and one drawn of a template weigh in what is clear."""


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


Example = tuple[set[str], str]
"""Features, and the class that they belong to."""


def understanding(
    said: Sequence[Utterance], templates: Sequence[Drawn], there: Mapping[bool, Live]
) -> Models:
    """The models but for what is clear, which takes everything to be."""
    blank = _blank(said, list(there[False].state.tasks))
    called = {paused: Names.of(live, blank) for paused, live in there.items()}
    heard = [Heard(one, tuple(tag(one.turns[-1], called[one.resumes]))) for one in said]
    acting = [one for one in templates if one.line.intent != GATED]
    alike = blank.concepts
    return replace(
        blank,
        intent=_learn(_intents(heard, acting, alike)),
        priority=_learn(_priorities(heard, acting, alike)),
        mention=_learn(_mentions(heard, acting, alike, there)),
        kind=_learn(_kinds(heard, alike), strength=0.3, balance=0.3),
    )


def _learn(examples: Iterable[Example], strength: float = 0.05, balance: float = 0.5) -> Linear:
    rows, labels = zip(*examples, strict=True)
    return fit(rows, labels, strength=strength, balance=balance)


def _blank(said: Sequence[Utterance], labels: Sequence[str]) -> Models:
    """Models that know words, and labels from words, and nothing else."""
    rows, macros = lines()
    words = everyday(rows, macros)
    counts = Counter(
        word for one in said for word in {t.text for t in plain(one.turns[-1]) if t.kind == "word"}
    )
    known = words | {word for word, count in counts.items() if _is_word(word, count, words)}
    known |= {word for some in lexicon().values() for one in some for word in one.split()}
    return Models(
        intent=_EMPTY,
        priority=_EMPTY,
        mention=_EMPTY,
        kind=_EMPTY,
        name=_learn(label_or_word(said, labels), strength=0.3),
        clear=_EMPTY,
        everyday=words,
        known=frozenset(known),
        concepts=concepts(macros),
    )


def _intents(heard: Sequence[Heard], acting: Sequence[Drawn], alike: Concepts) -> Iterator[Example]:
    for one in heard:
        if one.said.intent or one.said.kind == "none":
            yield features.of_line(one.tokens, alike), one.said.intent or "other"
    for each in acting:
        yield features.of_line(each.tokens, alike), each.line.intent.partition(":")[0]


def _priorities(
    heard: Sequence[Heard], acting: Sequence[Drawn], alike: Concepts
) -> Iterator[Example]:
    def found(tokens: Sequence[Token], intent: str) -> set[str]:
        named = said_priority(as_line(tokens))
        return features.of_priority(features.of_line(tokens, alike), intent, named)

    for one in heard:
        if wanted := priority(one.said):
            yield found(one.tokens, one.said.intent), wanted
    for each in acting:
        intent, _, wanted = each.line.intent.partition(":")
        if wanted:
            yield found(each.tokens, intent), wanted


def _mentions(
    heard: Sequence[Heard], acting: Sequence[Drawn], alike: Concepts, there: Mapping[bool, Live]
) -> Iterator[Example]:
    for one in heard:
        for at, role in roles(one, there[one.said.resumes]):
            yield features.of_mention(one.tokens, at, alike, one.said.intent), role
    for each in acting:
        for at, role in each.roles:
            yield features.of_mention(each.tokens, at, alike, each.line.intent), role


def _kinds(heard: Sequence[Heard], alike: Concepts) -> Iterator[Example]:
    for one in heard:
        for at, part in kind_words(one) or ():
            yield features.of_kind(one.tokens, at, alike), part


def _is_word(word: str, count: int, everyday: frozenset[str]) -> bool:
    """Whether a word that was said is none that somebody mistyped."""
    return word.isalpha() and count > (1 if nearest(word, everyday) is None else 8)


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
    data = [HERE / name for name in ("said.csv", "asides.csv", LEXICON, SOURCE)]
    return hashlib.sha256(b"".join(file.read_bytes() for file in data)).hexdigest()


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
    Path(str(files("oath.instruct.offline") / WEIGHTS)).write_bytes(data)
    click.echo(f"{WEIGHTS}: {len(data)} bytes")
