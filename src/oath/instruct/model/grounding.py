"""Whether a value was said: every number and name of a command must be in the operator's words.

Only asks whether a value *could* have been said, so that a value which a language model made up is
caught; what is meant is for the model and, in the end, for the operator to say.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from oath.model import Point, Priority


def words(text: str) -> list[str]:
    """The words of a text without case: ``"Don't stop" -> ["don't", "stop"]``."""
    return re.findall(r"[^\W\d_]+(?:['’][^\W\d_]+)?", text.casefold())


_SMALL = words(
    "zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen "
    "sixteen seventeen eighteen nineteen"
)
_UNITS = {word: value for value, word in enumerate(_SMALL)}
_TENS = {
    word: 10 * value
    for value, word in enumerate(words("twenty thirty forty fifty sixty seventy eighty ninety"), 2)
}
_DIGITS = {word: str(value) for word, value in _UNITS.items() if value < 10} | {"oh": "0", "o": "0"}
_PARTS = {("a", "half"): 0.5, ("a", "quarter"): 0.25, ("three", "quarters"): 0.75}

# A sign is none after a word or a bracket: "3-5" are two numbers, "bush-1" is a name. Digits inside
# a word are none either, but for "x5" and "5m".
_NUMBER = r"(?<![\w.])(?:[xy](?=[-+−]?\d))?(?P<number>(?:(?<![\w)])[-+−])?\d+(?:\.\d+)?)(?=m?\b)"
_TOKEN = re.compile(rf"{_NUMBER}|(?P<word>[^\W\d_]+)|(?P<other>\S)")

_CHUNK = re.compile(r"\w+(?:[-.]\w+)*")
_PIECE = re.compile(r"[^\W\d_]+|\d+")

_LITTLE = frozenset(
    words("a all an and as at be by do for go i in is it me my new no of on or so the to up we")
)
"""Words that are said without naming anything, though something may be called so."""

_NAMED = frozenset(words("called label named obstacle place point robot task"))
"""Words after which even a little word is a name."""

_CANNOT_WAIT = re.compile(r"\b(?:can['’]?t|cannot|can not|won['’]?t) wait\b", re.IGNORECASE)

EVERY = frozenset(words("all both each every everybody everyone everything"))

_URGENCY: dict[Priority, frozenset[str]] = {
    "high": frozenset(
        words(
            "high higher highest urgent urgently first top now asap immediate immediately "
            "important critical emergency rush hurry expedite prioritize prioritise priority "
            "quickly soon sooner before next once front ahead raise"
        )
    ),
    "normal": frozenset(words("normal normally usual ordinary regular medium default standard")),
    "low": frozenset(
        words(
            "low lower lowest last later least whenever unimportant deprioritize deprioritise "
            "postpone defer wait less after end bottom back"
        )
    ),
}
_PLACING = frozenset(
    words(
        "after ahead back before bottom end first front last later least less next now once soon "
        "top wait"
    )
)
"""Cues that a description of a new task may hold without saying how urgent it is."""


def numbers(text: str) -> list[float]:
    """The numbers that a text says, in digits or in words, in order.

    Examples
    --------
    >>> numbers("at five and nineteen point five, or (-3, 2.5)")
    [5.0, 19.5, -3.0, 2.5]
    >>> numbers("x5 y=7, robot2, twenty-one and a half, two point oh five")
    [5.0, 7.0, 21.5, 2.05]
    """
    tokens = [
        (match.lastgroup, match[match.lastgroup or 0]) for match in _TOKEN.finditer(text.casefold())
    ]
    tokens = [token for token in tokens if token != ("other", "-")]
    found, i = [], 0
    while i < len(tokens):
        value, next_ = _number(tokens, i)
        if value is not None:
            found.append(value)
        i = next_
    return found


def _number(tokens: Sequence[tuple[str | None, str]], i: int) -> tuple[float | None, int]:
    """A number that begins at a token, and where it ends; none ends with the token."""
    begin, sign = i, 1.0
    if tokens[i][1] in ("minus", "negative") and i + 1 < len(tokens):
        sign, i = -1.0, i + 1
    kind, text = tokens[i]
    if kind == "number":
        value, i = float(text.replace("−", "-")), i + 1
    else:
        whole, i = _whole(tokens, i)
        if whole is None:
            return None, begin + 1
        value = float(whole)
    if _text(tokens, i) == "point":
        decimals, end = "", i + 1
        while digit := _digits(tokens, end):
            decimals, end = decimals + digit, end + 1
        if decimals and value.is_integer():
            value, i = float(f"{value:.0f}.{decimals}"), end
    if _text(tokens, i) == "and":
        part = _PARTS.get((_text(tokens, i + 1), _text(tokens, i + 2)))
        if part is not None:
            value, i = value + part, i + 3
    return sign * value, i


def _whole(tokens: Sequence[tuple[str | None, str]], i: int) -> tuple[int | None, int]:
    value, i = _below_hundred(tokens, i)
    if value is None or _text(tokens, i) != "hundred":
        return value, i
    value, i = 100 * value, i + 1
    rest, end = _below_hundred(tokens, i + (_text(tokens, i) == "and"))
    return (value, i) if rest is None else (value + rest, end)


def _below_hundred(tokens: Sequence[tuple[str | None, str]], i: int) -> tuple[int | None, int]:
    word = _text(tokens, i)
    if word in _UNITS:
        return _UNITS[word], i + 1
    if word not in _TENS:
        return None, i
    unit = _UNITS.get(_text(tokens, i + 1), 0)
    return (_TENS[word] + unit, i + 2) if 0 < unit < 10 else (_TENS[word], i + 1)


def _digits(tokens: Sequence[tuple[str | None, str]], i: int) -> str:
    text = _text(tokens, i)
    if text.isdecimal():
        return text
    return _DIGITS.get(text, str(_UNITS.get(text, _TENS.get(text, ""))))


def _text(tokens: Sequence[tuple[str | None, str]], i: int) -> str:
    return tokens[i][1] if i < len(tokens) else ""


def number_said(value: float, said: Sequence[float]) -> bool:
    """Whether a number is among those that were said."""
    return any(abs(value - other) < 1e-9 for other in said)


def point_said(at: Point, said: Sequence[float]) -> bool:
    """Whether a point was said: both numbers, x directly before y."""
    return any(number_said(at[0], [x]) and number_said(at[1], [y]) for x, y in pairwise(said))


def along_axes(text: str) -> tuple[list[float], list[float]]:
    """The numbers that are said of x and of y, such as both ends of "x from 3 to 5, y = 2".

    Examples
    --------
    >>> along_axes("along y = 8 between x = 7 and x = 9")
    ([7.0, 9.0], [8.0])
    """
    found: dict[str, list[float]] = {"x": [], "y": []}
    parts = re.split(r"(?<![^\W\d_])([xy])(?![^\W\d_])", text.casefold())
    for axis, part in zip(parts[1::2], parts[2::2], strict=True):
        found[axis] += numbers(part)
    return found["x"], found["y"]


def name_said(name: str, text: str, *, plural: bool = False) -> bool:
    """Whether a text says a name: whole, with or without case, gaps and spelt-out digits.

    Parameters
    ----------
    name, text
        What to look for, and where.
    plural
        The name may also be said as of several.

    Examples
    --------
    >>> name_said("robot2", "pause Robot two please"), name_said("bb", "cancel bb1")
    (True, False)
    >>> name_said("a", "a new task"), name_said("a", "take it to A")
    (False, True)
    """
    wanted = _PIECE.findall(name.casefold())
    if not wanted:
        return name in text
    if name.casefold() in _LITTLE:
        return any(_stands_out(match, text) for match in _chunks(text, name))
    pieces = list(_pieces(text))
    for i in range(len(pieces) - len(wanted) + 1):
        part = pieces[i : i + len(wanted)]
        said = [piece for piece, _, _ in part]
        if plural and said[-1] in (wanted[-1] + "s", wanted[-1] + "es"):
            said[-1] = wanted[-1]
        if said == wanted and part[0][1] and part[-1][2]:
            return True
    return False


def likeliest(names: Iterable[str], text: str) -> list[str]:
    """The names in their order, but those first whose parts are all in a text."""
    spoken = {piece for piece, _, _ in _pieces(text)}
    return sorted(names, key=lambda name: not spoken.issuperset(_PIECE.findall(name.casefold())))


def _chunks(text: str, name: str) -> Iterator[re.Match[str]]:
    return (match for match in _CHUNK.finditer(text) if match[0].casefold() == name.casefold())


def _stands_out(match: re.Match[str], text: str) -> bool:
    """Whether a little word is used as a name: large, after "task" or the like, or at an end."""
    before = words(text[: match.start()])
    large = match[0] != match[0].lower() and before
    ends = not re.match(r"\s+\w", text[match.end() :])
    return bool(large or ends or (before and before[-1] in _NAMED))


def _pieces(text: str) -> Iterator[tuple[str, bool, bool]]:
    """The letters and the digits of every word, and whether the word begins or ends there."""
    for chunk in _CHUNK.finditer(text.casefold()):
        parts = _PIECE.findall(chunk[0])
        for i, part in enumerate(parts):
            digits = _DIGITS.get(part, str(_UNITS.get(part, part)))
            yield digits if len(part) > 1 else part, i == 0, i == len(parts) - 1


def priority_said(priority: Priority, usual: Priority, text: str) -> bool:
    """Whether a priority was said, or is the usual one and no other was said.

    Examples
    --------
    >>> priority_said("high", "high", "put aa last"), priority_said("high", "high", "aa it is")
    (False, True)
    """
    spoken = set(words(_CANNOT_WAIT.sub("urgent", text)))
    said = {name for name, cues in _URGENCY.items() if cues & spoken}
    if priority in said:
        return True
    clear = spoken - _PLACING if usual == "normal" else spoken
    return priority == usual and not any(
        cues & clear for name, cues in _URGENCY.items() if name != usual
    )
