"""The linear models of the offline interpreter, and what they say of an instruction."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oath.instruct.offline import features
from oath.instruct.offline.features import Concepts
from oath.instruct.offline.tokens import Token

WEIGHTS = "weights.npz"
"""What `train` writes and this module reads."""

NAMES = ("intent", "priority", "mention", "kind", "name", "clear")
"""The models."""


def key(feature: str) -> int:
    """The number that a feature is known by."""
    return zlib.crc32(feature.encode())


@dataclass(frozen=True, slots=True)
class Linear:
    """A softmax regression over sets of features: p ~ exp(bias + sum of the features' rows / c).

    `weights` has a row for each feature, in the order of its sorted `keys`, and a column for each
    class, in units of `scale`. With `mean`, c is the root of the number of known features, so that
    long instructions weigh as much as short ones; without, every feature weighs the same wherever
    it stands, and c is 10.
    """

    classes: tuple[str, ...]
    keys: NDArray[np.uint32]
    weights: NDArray[Any]
    bias: NDArray[np.float64]
    scale: float = 1.0
    mean: bool = True

    def __call__(self, found: Collection[str]) -> dict[str, float]:
        """The probability of each class."""
        score = self.bias.copy()
        if found and len(self.keys):
            wanted = np.fromiter(map(key, found), dtype=np.uint32, count=len(found))
            at = np.minimum(np.searchsorted(self.keys, wanted), len(self.keys) - 1)
            at = at[self.keys[at] == wanted]
            share = 1.0 / np.sqrt(max(len(at), 1)) if self.mean else 0.1
            score += self.weights[at].sum(axis=0, dtype=np.float64) * (self.scale * share)
        score -= score.max()
        odds = np.exp(score)
        return dict(zip(self.classes, (odds / odds.sum()).tolist(), strict=True))


@dataclass(frozen=True, slots=True)
class Models:
    """The trained models, the words that they know, and what words have in common."""

    intent: Linear
    priority: Linear
    mention: Linear
    kind: Linear
    name: Linear
    clear: Callable[[set[str]], dict[str, float]]
    everyday: frozenset[str]
    known: frozenset[str]
    concepts: Concepts
    data: str = ""
    """Tells the data that they were trained on."""

    def intents(self, tokens: Sequence[Token]) -> dict[str, float]:
        """How likely an instruction is one of each command's, or none's."""
        return self.intent(features.of_line(tokens, self.concepts))

    def priorities(self, tokens: Sequence[Token], intent: str, said: set[str]) -> dict[str, float]:
        """How likely an instruction asks for each priority, or for none."""
        line = features.of_line(tokens, self.concepts)
        return self.priority(features.of_priority(line, intent, said))

    def role(self, tokens: Sequence[Token], at: int, intent: str) -> dict[str, float]:
        """How likely what is named at an index is the pickup, the delivery, meant or another."""
        return self.mention(features.of_mention(tokens, at, self.concepts, intent))

    def kinds(self, tokens: Sequence[Token]) -> list[dict[str, float]]:
        """For each token how likely it is the noun that an obstacle is called, or goes with it."""
        return [
            self.kind(features.of_kind(tokens, n, self.concepts))
            if features.may_name(one)
            else {"no": 1.0}
            for n, one in enumerate(tokens)
        ]

    def label(self, before: Sequence[str], after: Sequence[str]) -> float:
        """How likely a word that is a label and an everyday word is the label here."""
        return self.name(features.of_name(before, after))["label"]

    def clarity(self, tokens: Sequence[Token], intent: str, signs: set[str]) -> float:
        """How likely an instruction is to be acted on as it was understood."""
        return self.clear(features.of_clarity(tokens, self.concepts, intent, signs))["act"]


@cache
def models() -> Models:
    """The models as shipped, read once."""
    data = files("oath.instruct.offline").joinpath(WEIGHTS).read_bytes()
    with np.load(BytesIO(data)) as arrays:
        return Models(
            **{name: _linear(arrays, name) for name in NAMES},
            everyday=frozenset(_text(arrays["everyday"])),
            known=frozenset(_text(arrays["known"])),
            concepts=_concepts(_text(arrays["concepts"])),
            data=_text(arrays["data"])[0],
        )


def _concepts(rows: Sequence[str]) -> Concepts:
    found: dict[str, list[tuple[tuple[str, ...], str]]] = {}
    for group, *phrase in (row.split("\t") for row in rows):
        found.setdefault(phrase[0], []).append((tuple(phrase), group))
    return {first: tuple(some) for first, some in found.items()}


def _linear(arrays: Mapping[str, NDArray[Any]], name: str) -> Linear:
    return Linear(
        tuple(_text(arrays[f"{name}_classes"])),
        arrays[f"{name}_keys"],
        arrays[f"{name}_weights"],
        arrays[f"{name}_bias"],
        float(arrays[f"{name}_scale"]),
        bool(arrays[f"{name}_mean"]),
    )


def _text(array: NDArray[Any]) -> list[str]:
    return array.tobytes().decode().split("\n")
