"""The linear models: which command an instruction asks for, and what a place in it is for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oath.instruct.offline.tokens import Token

WEIGHTS = "weights.npz"
"""What `train` writes and this module reads."""

_FILLERS = frozenset(
    [
        "a",
        "an",
        "the",
        "please",
        "hey",
        "hi",
        "hello",
        "ok",
        "okay",
        "so",
        "well",
        "kindly",
        "thanks",
        "thank",
        "uh",
        "um",
        "er",
        "just",
    ]
)
_LONGEST = 80
"""Tokens that features are made of."""


def shapes(tokens: Sequence[Token]) -> list[str]:
    """Tokens as the models see them: entities as tags, runs of points as one, no fillers."""
    seen: list[str] = []
    for token in tokens[:_LONGEST]:
        if token.kind == "word":
            if token.text not in _FILLERS:
                seen.append(token.text)
        elif token.kind == "mark":
            if token.text in "?;":
                seen.append(token.text)
            elif token.text in ("->", "=>"):
                seen.append("to")
        else:
            shape = f"<{token.kind.removeprefix('unknown_')}>"
            if shape == "<robot>" and token.value == "all":
                shape = "<robots>"
            if shape == "<point>" and seen[-1:] in (["<point>"], ["<points>"]):
                seen[-1] = "<points>"
            elif shape == "<point>" and seen[-2:] in (["<point>", "and"], ["<points>", "and"]):
                seen[-2:] = ["<points>"]
            else:
                seen.append(shape)
    return seen


def stem(word: str) -> str:
    """A word without its usual endings: ``stopping`` and ``stopped`` are ``stop``."""
    for end in ("ing", "ed", "es", "s", "ly"):
        if word.endswith(end) and len(word) - len(end) >= 3 and not word.endswith("ss"):
            word = word[: -len(end)]
            break
    if len(word) > 3 and word[-1] == word[-2] and word[-1] not in "sl":
        word = word[:-1]
    return word.removesuffix("e") if len(word) > 3 else word


Concepts = Mapping[str, tuple[str, ...]]
"""For stems of words what they have in common with others, e.g. ``("@cancel",)``."""


def features(tokens: Sequence[Token], concepts: Concepts) -> set[str]:
    """Words, neighbours, pieces of words, and what words have in common with others."""
    seen = ["^", *shapes(tokens), "$"]
    found = set(seen[1:-1])
    found |= {f"{a} {b}" for a, b in pairwise(seen)}
    found |= {f"{a} _ {b}" for a, b in zip(seen, seen[2:], strict=False)}
    groups = [concepts.get(stem(one), ()) if one[0] != "<" else (one,) for one in seen]
    for n, group in enumerate(groups):
        found |= set(group)
        for one in group:
            for step in (1, 2):
                found |= {f"{one} {'_ ' * (step - 1)}{other}" for other in _at(groups, n + step)}
            if n > 0:
                found |= {f"{seen[n - 1]} {one}"}
            if n + 1 < len(seen):
                found |= {f"{one} {seen[n + 1]}"}
    for word in seen[1:-1]:
        if word[0] != "<" and len(word) > 3:
            whole = f"[{word}]"
            found |= {"~" + whole[n : n + 4] for n in range(len(whole) - 3)}
            found |= {"~" + whole[n : n + 5] for n in range(len(whole) - 4)}
    return found


def _at(groups: Sequence[tuple[str, ...]], n: int) -> tuple[str, ...]:
    return groups[n] if n < len(groups) else ()


def role_features(tokens: Sequence[Token], at: int) -> set[str]:
    """What stands around the place or point at an index."""
    seen: list[str] = []
    where = 0
    total = order = 0
    for n, token in enumerate(tokens):
        spot = token.kind in ("point", "place", "unknown_place")
        if n == at:
            where = len(seen)
            order = total
        total += spot
        if token.kind == "word" and token.text in _FILLERS:
            continue
        if token.kind == "mark" and token.text not in ("->", "=>", ";", ",", "."):
            continue
        text = token.text if token.kind in ("word", "mark") else f"<{token.kind}>"
        seen.append({"=>": "to", "->": "to", "<unknown_place>": "<place>"}.get(text, text))
    before = ["^", "^", "^", "^", *seen[:where]][-4:][::-1]
    after = [*seen[where + 1 :], "$", "$", "$"][:3]
    own = "place" if "place" in tokens[at].kind else "point"
    found = {f"is {own}", f"{order} of {total}", f"{own} {order} of {total}"}
    for n, word in enumerate(before):
        found |= {f"-{n} {word}", f"before {word}"}
    found |= {f"+{n} {word}" for n, word in enumerate(after)} | {f"after {w}" for w in after[:2]}
    found |= {f"-- {before[1]} {before[0]}", f"++ {after[0]} {after[1]}"}
    found |= {f"--- {before[2]} {before[1]} {before[0]}", f"-+ {before[0]} {after[0]}"}
    return found


@dataclass(frozen=True, slots=True)
class Linear:
    """A softmax regression over sets of features: p ~ exp(bias + mean of the features' rows).

    `weights` has a row for each feature and a column for each class, in units of `scale`.
    """

    classes: tuple[str, ...]
    rows: dict[str, int]
    weights: NDArray[Any]
    bias: NDArray[np.float64]
    scale: float = 1.0

    def __call__(self, found: set[str]) -> dict[str, float]:
        """The probability of each class."""
        at = [self.rows[one] for one in found if one in self.rows]
        score = self.bias.copy()
        if at:
            score += self.weights[at].sum(axis=0) * (self.scale / np.sqrt(len(at)))
        score -= score.max()
        share = np.exp(score)
        return dict(zip(self.classes, (share / share.sum()).tolist(), strict=True))


@dataclass(frozen=True, slots=True)
class Models:
    """The trained models and the words that they know."""

    intent: Linear
    role: Linear
    words: frozenset[str]
    concepts: Concepts

    def intents(self, tokens: Sequence[Token]) -> dict[str, float]:
        """How likely an instruction is one of each command's, or none's."""
        return self.intent(features(tokens, self.concepts))

    def roles(self, tokens: Sequence[Token], at: int) -> dict[str, float]:
        """How likely the place at an index is the pickup, the delivery or only mentioned."""
        return self.role(role_features(tokens, at))


@cache
def models() -> Models:
    """The models as shipped, read once."""
    data = files("oath.instruct.offline").joinpath(WEIGHTS).read_bytes()
    with np.load(BytesIO(data)) as arrays:
        return Models(
            _linear(arrays, "intent"),
            _linear(arrays, "role"),
            frozenset(_text(arrays["words"])),
            {row[0]: tuple(row[1:]) for row in map(str.split, _text(arrays["concepts"]))},
        )


def _linear(arrays: Mapping[str, NDArray[Any]], name: str) -> Linear:
    features = _text(arrays[f"{name}_features"])
    return Linear(
        tuple(_text(arrays[f"{name}_classes"])),
        dict(zip(features, range(len(features)), strict=True)),
        arrays[f"{name}_weights"],
        arrays[f"{name}_bias"],
        float(arrays[f"{name}_scale"]),
    )


def _text(array: NDArray[Any]) -> list[str]:
    return array.tobytes().decode().split("\n")
