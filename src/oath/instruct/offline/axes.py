"""Straight walls and boxes told along the axes, as ``x = 5 from y 2 to y 6``."""

from __future__ import annotations

from collections.abc import Sequence

from oath.instruct.offline.tokens import Token, point_token

_JOINS = {"=", ":", "is", "equals", "equal", "of", "at", "coordinate", "axis", "value", "values"}
_OPENS = {
    "from",
    "between",
    "spans",
    "runs",
    "running",
    "goes",
    "ranges",
    "ranging",
    "over",
    "going",
    "reaching",
}
_LINKS = {"and", ",", "at", "with"}
_RANGES = {"to", "..", "...", "-", "until", "till", "through", "til", "->", "=>"}
_STEPS = {"up", "all", "the", "way", "down", "reaching", "on", "coordinates"}


def read_axes(tokens: Sequence[Token]) -> list[Token]:
    """Replace one number on one axis and a range on the other by the two ends of that line.

    Two ranges are the corners of a box. Nothing is replaced if other numbers are left, so that
    what is not understood is asked about.

    Examples
    --------
    >>> from oath.instruct.offline.tokens import lex, read_numbers
    >>> [one.value for one in read_axes(read_numbers(lex("x = 5 from y 2 to y 6")))]
    [(5.0, 2.0), (5.0, 6.0)]
    """
    numbers = sum(one.kind == "number" for one in tokens)
    if not 3 <= numbers <= 4:
        return list(tokens)
    found: dict[str, list[float]] = {}
    spans: list[tuple[int, int]] = []
    at = 0
    while at < len(tokens):
        read = _axis(tokens, at) or _range_on(tokens, at)
        if read is None or read[0] in found:
            at += 1
            continue
        axis, values, end = read
        found[axis] = values
        begin = at
        while spans and begin > spans[-1][1] and tokens[begin - 1].text in _OPENS | _LINKS:
            begin -= 1
        spans.append((begin, end))
        at = end
    if sum(map(len, found.values())) != numbers or set(found) != {"x", "y"}:
        return list(tokens)
    points = _points(found["x"], found["y"])
    kept: list[Token] = []
    for n, token in enumerate(tokens):
        if n == spans[0][0]:
            kept += points
        if not any(a <= n < b for a, b in spans):
            kept.append(token)
    return kept


def _points(xs: Sequence[float], ys: Sequence[float]) -> list[Token]:
    if len(xs) == len(ys) == 2:
        (left, right), (low, high) = xs, ys
        corners = [(left, low), (right, low), (right, high), (left, high)]
    else:
        corners = [(x, y) for x in xs for y in ys]
    return [point_token(corner) for corner in corners]


def _axis(tokens: Sequence[Token], at: int) -> tuple[str, list[float], int] | None:
    """The axis named at an index, its one or two values, and where the tokens behind begin."""
    axis = tokens[at].text
    if axis not in ("x", "y") or tokens[at].quoted:
        return None
    here, between = at + 1, at > 0 and tokens[at - 1].text == "between"
    while here < len(tokens) and tokens[here].text in _JOINS | _OPENS:
        between = between or tokens[here].text == "between"
        here += 1
    value = _value(tokens, here)
    if value is None:
        return None
    values, end = [value], here + 1
    ranges = _RANGES | {"and"} if between else _RANGES
    here, linked = end, False
    while here < len(tokens) and tokens[here].text in ranges | _STEPS:
        linked = linked or tokens[here].text in ranges
        here += 1
    if linked:
        while here < len(tokens) and tokens[here].text in {axis} | _JOINS:
            here += 1
        second = _value(tokens, here)
        if second is not None and second != value:
            return axis, [*values, second], here + 1
    return axis, values, end


def _range_on(tokens: Sequence[Token], at: int) -> tuple[str, list[float], int] | None:
    """A range before its axis, as ``2 to 6 on the y axis``."""
    first, second = _value(tokens, at), _value(tokens, at + 2)
    link = tokens[at + 1].text if at + 1 < len(tokens) else ""
    if first is None or second is None or link not in _RANGES | {"and"}:
        return None
    behind = [one.text for one in tokens[at + 3 : at + 7]]
    skipped = 0
    while behind and behind[0] in ("on", "along", "in", "the", "of"):
        behind, skipped = behind[1:], skipped + 1
    if not skipped or not behind or behind[0] not in ("x", "y", "x-axis", "y-axis"):
        return None
    end = at + 3 + skipped + 1
    more = end < len(tokens) and tokens[end].text in ("axis", "direction", "-")
    return behind[0][0], [first, second], end + more


def _value(tokens: Sequence[Token], at: int) -> float | None:
    if at >= len(tokens) or tokens[at].kind != "number":
        return None
    return None if tokens[at].value is None else float(tokens[at].value)
