"""Text to tokens: words, numbers (in digits and in words), points and quoted names."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

LONGEST = 600
"""Longest instruction that is read [characters]."""


@dataclass(frozen=True, slots=True)
class Token:
    """A piece of an instruction.

    Attributes
    ----------
    kind
        ``word``, ``mark`` (punctuation), ``number``, ``point``, ``speech`` (several words in
        quotes), or what a name stands for in the live world: ``place``, ``robot``, ``label``,
        ``obstacle``, ``kind``, ``type``; with ``unknown_`` in front if there is no such thing.
    text
        As a comparable word: lower case, without quotes.
    value
        Of a number a float, of a point (x, y) [m], of a name how the live world spells it.
    raw
        As it was written.
    quoted
        Whether it stood in quotes.
    """

    kind: str
    text: str
    value: Any = None
    raw: str = ""
    quoted: bool = False


def clean(text: str) -> str:
    """Return text without control and formatting characters, in compatible characters."""
    text = unicodedata.normalize("NFKC", text[: 4 * LONGEST])
    text = "".join(
        one if unicodedata.category(one)[0] != "C" else " " for one in text.translate(_PLAIN)
    )
    return " ".join(text.split())


_PLAIN = str.maketrans("’‘‛`´“”„«»–—−→", "'''''\"\"\"\"\"--->")

_LEX = re.compile(
    r"(?P<quote>\"[^\"]*\"|(?<!\w)'[^']{1,80}'(?!\w))"
    r"|(?P<rank>\d+(?:st|nd|rd|th)\b)"
    r"|(?P<dots>(?<=\d)\.{2,3}(?=\d))"
    r"|(?P<number>\d+\.\d+|\.\d+|\d+)"
    r"|(?P<word>[^\W\d_]\w*(?:[-_']\w+)*)"
    r"|(?P<mark>->|=>|\S)",
    re.UNICODE,
)

_JOINED = {
    "dont": "do not", "doesnt": "does not", "didnt": "did not", "isnt": "is not",
    "arent": "are not", "wasnt": "was not", "cant": "can not", "cannot": "can not",
    "wont": "will not", "shouldnt": "should not", "neednt": "need not", "theres": "there is",
    "im": "i am", "whats": "what is", "wheres": "where is", "thats": "that is",
    "gonna": "going to", "wanna": "want to", "gotta": "have to", "lets": "let us",
    "pls": "please", "plz": "please", "u": "you", "nevermind": "never mind",
    "prio": "priority", "coords": "coordinates", "coord": "coordinate", "loc": "location",
    "dest": "destination", "prioritise": "prioritize", "deprioritise": "deprioritize",
    "prioritised": "prioritized", "canceled": "cancelled", "cancelation": "cancellation",
    "metres": "meters", "metre": "meter", "obs": "obstacle", "dropoff": "drop-off",
    "pickup": "pick-up", "w/": "with", "aint": "is not", "havent": "have not",
    "ya": "you", "ur": "your", "easting": "x", "northing": "y",
}  # fmt: skip
_SHORT = {"ll": "will", "re": "are", "ve": "have", "d": "would", "m": "am"}
_IS = {"there", "it", "that", "here", "what", "where", "how", "who", "he", "she", "this", "when"}


def lex(text: str) -> list[Token]:
    """Return the words, numbers and marks of a cleaned text."""
    tokens: list[Token] = []
    for match in _LEX.finditer(text):
        raw = match[0]
        if match.lastgroup == "quote":
            tokens.append(_quoted(raw[1:-1].strip()))
        elif match.lastgroup == "number":
            value = float(raw) if len(raw) <= 12 else None
            tokens.append(Token("number", raw, value, raw))
        elif match.lastgroup in ("word", "rank"):
            tokens += _words(raw)
        else:
            tokens.append(Token("mark", raw, None, raw))
    return _signed(tokens)


def _quoted(raw: str) -> Token:
    kind = "speech" if len(raw.split()) > 1 else "word"
    return Token(kind, raw.casefold(), None, raw, quoted=True)


def _words(raw: str) -> list[Token]:
    """One word, or what it is short for."""
    word = raw.casefold()
    if "'" in word:
        stem, _, end = word.rpartition("'")
        if end == "t" and stem.endswith("n"):
            base = {"ca": "can", "wo": "will", "sha": "shall"}.get(stem[:-1], stem[:-1])
            return [Token("word", base, None, base), Token("word", "not", None, "not")]
        if end in _SHORT:
            return [Token("word", stem, None, stem), Token("word", _SHORT[end], None, end)]
        if end == "s":
            first = Token("word", stem, None, raw[: len(stem)])
            if stem == "let":
                return [first, Token("word", "us", None, "us")]
            return [first, Token("word", "is", None, "is")] if stem in _IS else [first]
    if word in _JOINED:
        return [Token("word", one, None, one) for one in _JOINED[word].split()]
    parts = word.split("-")
    if len(parts) > 1 and all(part in _CARDINALS for part in parts):
        return [Token("word", part, None, part) for part in parts]
    return [Token("word", word, None, raw)]


def _signed(tokens: list[Token]) -> list[Token]:
    """Join a minus to the number behind it, unless it stands between two numbers."""
    done: list[Token] = []
    for token in tokens:
        if token.kind == "number" and done and done[-1].text in ("-", "minus", "negative"):
            before = done[-2] if len(done) > 1 else None
            if token.value is not None and (before is None or before.kind != "number"):
                raw = "-" + token.raw
                done[-1] = Token("number", raw, -token.value, raw)
                continue
        done.append(token)
    return done


# -- numbers in words

_ONES = ["zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"]
_TEENS = [
    "ten",
    "eleven",
    "twelve",
    "thirteen",
    "fourteen",
    "fifteen",
    "sixteen",
    "seventeen",
    "eighteen",
    "nineteen",
]
_TENS = ["twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety"]
_CARDINALS = {
    **{word: n for n, word in enumerate(_ONES + _TEENS)},
    **{word: 10 * n for n, word in enumerate(_TENS, 2)},
    "fourty": 40,
    "niner": 9,
    "nought": 0,
    "nil": 0,
}
_DIGITS = {**{word: str(n) for n, word in enumerate(_ONES)}, "oh": "0", "o": "0", "nought": "0"}
_POINT = ("point", "dot", "decimal")


def read_numbers(tokens: Sequence[Token]) -> list[Token]:
    """Replace numbers in words by numbers, e.g. ``two point oh five`` by 2.05."""
    done: list[Token] = []
    radio = any(one.text in ("niner", "decimal") for one in tokens)
    at = 0
    while at < len(tokens):
        found = _number(tokens, at, radio)
        if found is None:
            done.append(tokens[at])
            at += 1
        else:
            token, end = found
            done.append(token)
            at = end
    return [_not_one(done, n) for n in range(len(done))]


def _number(tokens: Sequence[Token], at: int, radio: bool) -> tuple[Token, int] | None:
    start, sign = at, 1.0
    if tokens[at].text in ("minus", "negative") and at + 1 < len(tokens):
        sign, at = -1.0, at + 1
    first = tokens[at]
    if first.quoted:
        return None
    if first.kind == "number" and first.value is not None:
        value, at = float(first.value), at + 1
    elif first.kind == "word" and first.text in _CARDINALS:
        whole, at = _cardinal(tokens, at)
        while radio and whole < 100 and _is_one(tokens, at, 0, 9):  # digit by digit
            whole, at = 10 * whole + _CARDINALS[tokens[at].text], at + 1
        value = float(whole)
    else:
        return None
    if value == int(value):
        value, at = _fraction(tokens, at, value)
    raw = " ".join(token.raw for token in tokens[start:at])
    return Token("number", raw.casefold(), sign * value, raw), at


def _cardinal(tokens: Sequence[Token], at: int) -> tuple[int, int]:
    value = _CARDINALS[tokens[at].text]
    at += 1
    if value in range(20, 100, 10) and _is_one(tokens, at, 1, 9):
        value += _CARDINALS[tokens[at].text]
        at += 1
    if 0 < value < 10 and at < len(tokens) and tokens[at].text == "hundred":
        value, at = value * 100, at + 1
        skip = at + 1 if at < len(tokens) and tokens[at].text == "and" else at
        if _is_one(tokens, skip, 1, 99):
            rest, at = _cardinal(tokens, skip)
            value += rest
    return value, at


def _is_one(tokens: Sequence[Token], at: int, low: int, high: int) -> bool:
    if at >= len(tokens) or tokens[at].kind != "word":
        return False
    return low <= _CARDINALS.get(tokens[at].text, -1) <= high


def _fraction(tokens: Sequence[Token], at: int, whole: float) -> tuple[float, int]:
    """Read ``point oh five`` or ``and a half`` behind a whole number."""
    words = [token.text for token in tokens[at : at + 8]]
    if words and words[0] in _POINT:
        digits: list[str] = []
        for token in tokens[at + 1 :]:
            if token.text in _DIGITS and token.kind == "word":
                digits.append(_DIGITS[token.text])
            elif not digits and token.kind == "number" and token.text.isdigit():
                digits.append(token.text)
                break
            else:
                break
        if not digits and _is_one(tokens, at + 1, 10, 99):
            tail, end = _cardinal(tokens, at + 1)
            return float(f"{whole:.0f}.{tail}"), end
        end = at + 1 + len(digits)
        if len(digits) > 1 and end < len(tokens) and tokens[end].text in _POINT:
            digits, end = digits[:-1], end - 1  # the last one begins the next number
        if digits:
            return float(f"{whole:.0f}.{''.join(digits)}"), end
    for phrase, part in _PARTS.items():
        if words[: len(phrase)] == list(phrase):
            return whole + part, at + len(phrase)
    return whole, at


_PARTS = {
    ("and", "a", "half"): 0.5,
    ("and", "one", "half"): 0.5,
    ("and", "half"): 0.5,
    ("and", "a", "quarter"): 0.25,
    ("and", "three", "quarters"): 0.75,
    ("1", "/", "2"): 0.5,
}

_COUNTED = {"robot", "bot", "unit", "vehicle", "machine", "agv", "amr", "cart"}
_NUMBER = {"number", "no", "nr", "#", "num"}
_BESIDE_NUMBER = {"x", "y", "robot", "robots", "bot", "unit", "at", "minus", "task", "=", "dash",
                  "hyphen"}  # fmt: skip


def _not_one(tokens: Sequence[Token], at: int) -> Token:
    """Keep ``one`` a word where it is none of several numbers, as in ``this one``."""
    token = tokens[at]
    if token.kind != "number" or token.text != "one":
        return token
    skip = {",", "and", ";"}
    before = next((one for one in reversed(tokens[:at]) if one.text not in skip), None)
    after = next((one for one in tokens[at + 1 :] if one.text not in skip), None)
    if any(one is not None and one.kind == "number" for one in (before, after)):
        return token
    beside = tokens[max(at - 2, 0) : at]
    if len(beside) == 2 and beside[0].text in _COUNTED and beside[1].text in _NUMBER:
        return token
    if before is not None and before.text in _BESIDE_NUMBER:
        return token
    return Token("word", "one", None, token.raw)


# -- points

_BETWEEN = {",", ";", "/", "|", "and", "&", "comma"}
_LOOSE = {"by", "-", "x"}
_BEFORE_LOOSE = {
    "at",
    "position",
    "location",
    "coordinates",
    "coordinate",
    "grid",
    "point",
    "spot",
    "pick-up",
    "pickup",
    "origin",
    "source",
}
_METERS = {"m", "meter", "meters"}
_EQUALS = {"=", ":", "is", "equals", "of", "at", "coordinate", "equal", "to"}
_CLOSE = {"(": ")", "[": "]", "{": "}", "<": ">"}
_OF_MANY = {"robots", "tasks", "bots", "units", "jobs", "labels"}


def read_points(tokens: Sequence[Token]) -> list[Token]:
    """Replace pairs of numbers by points; numbers that make no pair stay as they are.

    Examples
    --------
    >>> [token.value for token in read_points(read_numbers(lex("five and two point oh five")))]
    [(5.0, 2.05)]
    """
    done: list[Token] = []
    at = 0
    while at < len(tokens):
        points, end = _points(tokens, at, done[-1] if done else None)
        done += points or tokens[at:end]
        at = end
    return done


def _points(tokens: Sequence[Token], at: int, before: Token | None) -> tuple[list[Token], int]:
    """The points that begin here, and where the tokens behind them begin."""
    text = tokens[at].text
    if tokens[at].kind == "mark" and text in _CLOSE:
        inside = at + 1
        while inside < len(tokens) and inside - at < 16 and tokens[inside].text != _CLOSE[text]:
            inside += 1
        body = tokens[at + 1 : inside]
        if inside < len(tokens) and body and not any(one.text in _CLOSE for one in body):
            if sum(one.kind == "number" for one in body) > 2:
                found, end = _run(body, 0, None) if body[0].kind == "number" else ([], 0)
                return (found, inside + 1) if found and end == len(body) else ([], at + 1)
            values = [one.value for one in body if one.kind == "number"]
            rest = {one.text for one in body if one.kind != "number"}
            if values and rest <= _BETWEEN | _METERS | _EQUALS | {"x", "y"}:
                if len(values) == 2 and None not in values:
                    return [point_token(values)], inside + 1
                return [], inside + 1
        return [], at + 1
    if text in ("x", "y"):
        return _by_axes(tokens, at)
    if tokens[at].kind == "number":
        return _run(tokens, at, before)
    return [], at + 1


def point_token(values: Sequence[float]) -> Token:
    """A point as a token."""
    raw = f"({values[0]:.10g}, {values[1]:.10g})"
    return Token("point", raw, (values[0], values[1]), raw)


def _by_axes(tokens: Sequence[Token], at: int) -> tuple[list[Token], int]:
    """Read ``x=4, y is 7.5``."""
    found: dict[str, float] = {}
    here = at
    for _ in range(2):
        axis = tokens[here].text if here < len(tokens) else ""
        here += 1
        while here < len(tokens) and tokens[here].text in _EQUALS:
            here += 1
        if axis not in ("x", "y") or axis in found or here >= len(tokens):
            return [], at + 1
        if tokens[here].kind != "number" or tokens[here].value is None:
            return [], at + 1
        found[axis] = tokens[here].value
        here += 1
        end = here
        while here < len(tokens) and tokens[here].text in _BETWEEN | _METERS:
            here += 1
    return [point_token((found["x"], found["y"]))], end


def _run(tokens: Sequence[Token], at: int, before: Token | None) -> tuple[list[Token], int]:
    """Read numbers in a row as pairs, if their number and what separates them allow it."""
    told = _all_by(tokens) or (
        before is not None
        and (
            before.text in _BEFORE_LOOSE
            or (
                before.text in ("from", "to")
                and [one.text for one in tokens[at + 1 : at + 2]] == ["by"]
            )
        )
    )
    if told and (found := _loose(tokens, at)):
        return found, at + 3
    numbers, gaps, end = [tokens[at]], list[str](), at + 1
    here = end
    while here < len(tokens):
        gap: list[str] = []
        while here < len(tokens) and tokens[here].text in _METERS:
            here += 1
        end = here
        while here < len(tokens) and tokens[here].text in _BETWEEN and len(gap) < 2:
            gap.append(tokens[here].text)
            here += 1
        if here >= len(tokens) or tokens[here].kind != "number":
            break
        gaps.append(" ".join(gap))
        numbers.append(tokens[here])
        here += 1
        end = here
    within = set(gaps[::2])
    spoken = (
        len(numbers) > 2
        and all(one.raw.replace(" ", "").isalpha() for one in numbers)
        and within == {""}
    )
    ends = before is not None and before.text == "between" and gaps == ["", "and", ""]
    usable = (
        not (spoken and set(gaps) != {""} and not ends)  # "one two, one nine": digits or numbers?
        and len(numbers) % 2 == 0
        and len(within) == 1
        and all(one.value is not None for one in numbers)
        and not (before is not None and before.text in _OF_MANY)
    )
    if not usable:
        return [], end
    pairs = zip(numbers[::2], numbers[1::2], strict=True)
    return [point_token((a.value, b.value)) for a, b in pairs], end


def _all_by(tokens: Sequence[Token]) -> bool:
    """Whether every number stands in a pair such as ``4 by 7.5``."""
    at = [n for n, one in enumerate(tokens) if one.kind == "number"]
    pairs = list(zip(at[::2], at[1::2], strict=False))
    return len(at) % 2 == 0 and all(b == a + 2 and tokens[a + 1].text == "by" for a, b in pairs)


def _loose(tokens: Sequence[Token], at: int) -> list[Token]:
    """Read ``4 by 7.5`` or ``4-7``, which is a point only where one is announced."""
    if at + 2 >= len(tokens) or tokens[at + 1].text not in _LOOSE:
        return []
    pair = (tokens[at], tokens[at + 2])
    behind = tokens[at + 3].text if at + 3 < len(tokens) else ""
    if any(one.kind != "number" or one.value is None for one in pair) or behind in _LOOSE | {"m"}:
        return []
    return [point_token([one.value for one in pair])]
