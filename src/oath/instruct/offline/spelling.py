"""Letters told by words, as ``bravo`` for b, and slips of the typing hand."""

from __future__ import annotations

import string
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

from oath.instruct.offline.tokens import Token

ALPHABET = {
    word: word[0]
    for word in (
        *("alpha", "alfa", "bravo", "charlie", "delta", "echo", "foxtrot", "golf", "hotel"),
        *("india", "juliett", "juliet", "kilo", "lima", "mike", "november", "oscar", "papa"),
        *("quebec", "romeo", "sierra", "tango", "uniform", "victor", "whiskey", "whisky"),
        *("xray", "x-ray", "yankee", "zulu"),
    )
}
"""Words of the radio alphabet, and the letters that they stand for."""


def spelled(part: Sequence[Token]) -> str | None:
    """The letters that words of the radio alphabet spell; None if one is none of them."""
    if any(one.kind != "word" or one.quoted for one in part):
        return None
    words = [
        word
        for one in part
        for word in ([one.text] if one.text in ALPHABET else one.text.split("-"))
    ]
    if not all(word in ALPHABET for word in words):
        return None
    return "".join(ALPHABET[word] for word in words)


_SHORT = {
    "teh": "the", "hte": "the", "adn": "and", "nad": "and", "ot": "to", "fo": "of",
    "taks": "task", "tsak": "task", "tsk": "task", "ad": "add", "aad": "add",
    "wal": "wall", "wlal": "wall", "fomr": "from", "frm": "from", "fom": "from",
    "si": "is", "ti": "it", "cna": "can", "yuo": "you", "nwe": "new", "nwo": "now",
    "wiht": "with", "wih": "with", "htere": "there", "ther": "there", "od": "do",
    "plaese": "please", "bto": "bot", "rbot": "robot", "jbo": "job", "stpo": "stop", "sotp": "stop",
    "pasue": "pause", "puase": "pause", "hihg": "high", "hgih": "high", "lwo": "low", "nto": "not",
    "udno": "undo", "unod": "undo", "brokn": "broken", "borken": "broken", "gonne": "gone",
    "cancle": "cancel", "canel": "cancel", "prioratise": "prioritize", "priortise": "prioritize",
    "thsi": "this", "tihs": "this",
}  # fmt: skip
"""Slips in words too short to be mended by themselves."""

CORE = {
    "add", "after", "anymore", "barrier", "because", "before", "between", "blockage", "blocked",
    "blocking", "bring", "broke", "broken", "cancel", "cancelled", "carry", "cleared", "closed",
    "collect", "continue", "coordinates", "could", "create", "dead", "decrease", "delete",
    "deliver", "delivery", "destination", "down", "drop-off", "emergency", "expedite", "failed",
    "fence", "fetch", "first", "freeze", "from", "halt", "high", "immediately", "important",
    "increase", "insert", "label", "last", "location", "longer", "lower", "mission", "needed",
    "normal", "obstacle", "obstruction", "pallet", "pause", "pick-up", "pickup", "please",
    "point", "position", "prioritize", "priority", "progress", "raise", "register", "release",
    "remove", "removed", "reported", "restart", "resume", "revert", "robot", "should", "special",
    "station", "status", "stop", "take", "task", "there", "transport", "undo", "urgent", "wall",
    "would",
}  # fmt: skip
"""Words that an instruction turns on: the likelier ones, if a slip may be of several."""


def mended(
    tokens: Sequence[Token], words: frozenset[str], named: Callable[[str], bool]
) -> list[Token]:
    """Put right words that are one slip from an everyday word and not `named` with a slip."""
    return [one if named(one.text) else _mended(one, words) for one in tokens]


def _mended(token: Token, words: frozenset[str]) -> Token:
    if token.kind != "word" or token.quoted or token.text in words or token.text in ALPHABET:
        return token
    if token.raw.isupper() and len(token.raw) < 4:
        return token
    word = nearest(token.text, words)
    return token if word is None else replace(token, text=word)


@lru_cache(maxsize=4096)
def nearest(word: str, words: frozenset[str]) -> str | None:
    """The only everyday word that a word can be a slip of; None if there is none, or several.

    The first letter is right, unless it has changed places with the second, and short words must
    have all the right letters.
    """
    if word in _SHORT:
        return _SHORT[word]
    if len(word) < 4 or not word.isalpha() or not word.isascii():
        return None
    known = {one for one in _swapped(word) if one in words and len(one) > 3}
    if not known:
        known = {one for one in _slips(word) if one in words and len(one) > 4}
    core = known & CORE
    best = core if len(core) == 1 else known
    return next(iter(best)) if len(best) == 1 else None


def _swapped(word: str) -> Iterator[str]:
    for n in range(len(word) - 1):
        yield word[:n] + word[n + 1] + word[n] + word[n + 2 :]


def _slips(word: str) -> Iterator[str]:
    """Words that become this one with a letter wrong, missing or added behind the first."""
    for n in range(1, len(word) + 1):
        for letter in string.ascii_lowercase:
            yield word[:n] + letter + word[n:]
            if n < len(word):
                yield word[:n] + letter + word[n + 1 :]
        if n < len(word) and len(word) > 5:
            yield word[:n] + word[n + 1 :]
