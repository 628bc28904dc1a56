"""Formulas of linear temporal logic: the tree, and how it is read and written."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, cast
from zlib import crc32

from oath.errors import BadInput, did_you_mean

Operator = Literal[
    "true", "false", "atom", "!", "X", "F", "G", "&", "|", "->", "<->", "U", "R", "W", "M"
]

_UNARY = ("!", "X", "F", "G")
_LEVEL = {"<->": 1, "->": 2, "|": 3, "&": 4, "U": 5, "R": 5, "W": 5, "M": 5}
_TIGHTEST = 6
_SPELLING = {"&&": "&", "and": "&", "||": "|", "or": "|", "not": "!"}
_RESERVED = frozenset(("true", "false", "and", "or", "not", *"XFGURWM"))
# A hyphen belongs to an id unless it begins an arrow, so that a->b is an implication.
_WORD = re.compile(r"(?:[\w.]|-(?!>))+")
_TOKEN = re.compile(
    rf'\s*(?:(<->|->|&&?|\|\|?|[!()])|({_WORD.pattern})|"((?:[^"\\]|\\.)*)"|(\S)|$)'
)
_FOREIGN = {
    '"': "close the quote",
    "[": "write G for []",
    "<": "write F for <>, -> for =>, and b -> a for a <- b",
    "=": "write -> for =>, <-> for ==",
    "~": "write ! for ~",
}
_MAX_DEPTH = 100


@dataclass(frozen=True, slots=True, repr=False)
class Formula:
    """A node of the syntax tree; equal trees are equal and hash alike in every process.

    Parameters
    ----------
    op
        The operator, or ``"atom"``.
    args
        Its operands: none, one, two, or for ``&`` and ``|`` two or more.
    name
        The id that an atom stands for.

    Examples
    --------
    >>> Formula("U", (atom("gate-1"), Formula("!", (atom("F"),))))
    parse('gate-1 U !"F"')
    """

    op: Operator
    args: tuple[Formula, ...] = ()
    name: str = ""
    _hash: int = field(init=False, compare=False)

    def __post_init__(self) -> None:
        # Without this, one look-up costs the whole tree; crc32 is the same in every process.
        code = hash((crc32(self.op.encode()), crc32(self.name.encode()), self.args))
        object.__setattr__(self, "_hash", code)

    def __hash__(self) -> int:
        return self._hash

    def __str__(self) -> str:
        return _print(self, 0)

    def __repr__(self) -> str:
        return f"parse({str(self)!r})"


TRUE, FALSE = Formula("true"), Formula("false")


def atom(name: str) -> Formula:
    """Return the formula that holds where the zone, place or task ``name`` does."""
    return Formula("atom", name=name)


def conjunction(formulas: Iterable[Formula]) -> Formula:
    """Return one formula that holds where all of them do; ``true`` for none.

    Examples
    --------
    >>> print(conjunction([parse("G !lab"), parse("F a | F b")]))
    G !lab & (F a | F b)
    >>> print(conjunction([]))
    true
    """
    parts = tuple(formulas)
    return Formula("&", parts) if len(parts) > 1 else parts[0] if parts else TRUE


def _print(formula: Formula, floor: int) -> str:
    op, args = formula.op, formula.args
    if op == "atom":
        plain = _WORD.fullmatch(formula.name) and formula.name not in _RESERVED
        return formula.name if plain else '"' + re.sub(r'(["\\])', r"\\\1", formula.name) + '"'
    if not args:
        return op
    if op in _UNARY:
        return ("!" if op == "!" else f"{op} ") + _print(args[0], _TIGHTEST)
    level = _LEVEL[op]
    last = level + 1 if op in "&|" else level  # the others associate to the right
    parts = [_print(arg, level + 1) for arg in args[:-1]] + [_print(args[-1], last)]
    text = f" {op} ".join(parts)
    return f"({text})" if level < floor else text


class _Token(NamedTuple):
    kind: Literal["op", "atom", "end"]
    text: str
    column: int


def _fault(text: str, column: int, problem: str, remedy: str) -> BadInput:
    start = max(0, column - 50)
    shown = re.sub(r"\s", " ", text[start : start + 72])
    caret = " " * (column - 1 - start) + "^"
    return BadInput(
        f"formula, column {column}: {problem}", remedy=f"{remedy}\n  {shown}\n  {caret}"
    )


def _tokens(text: str) -> list[_Token]:
    found: list[_Token] = []
    position = 0
    while position < len(text):
        match = cast("re.Match[str]", _TOKEN.match(text, position))
        position = match.end()
        if not match.lastindex:
            break
        symbol, word, quoted, foreign = match.groups()
        column = match.start(match.lastindex) + 1
        if foreign:
            remedy = _FOREIGN.get(foreign, 'put an id with such characters into double quotes "…"')
            raise _fault(text, column, f"unexpected {foreign!r}", remedy)
        if quoted is not None:
            found.append(_Token("atom", re.sub(r"\\(.)", r"\1", quoted), column - 1))
        elif symbol or word in _RESERVED:
            found.append(_Token("op", _SPELLING.get(symbol or word, symbol or word), column))
        else:
            found.append(_Token("atom", word, column))
    return [*found, _Token("end", "the end", len(text.rstrip()) + 1)]


class _Parser:
    def __init__(self, text: str, known: Collection[str] | None) -> None:
        self._text, self._known = text, known
        self._tokens, self._position, self._depth = _tokens(text), 0, 0

    def whole(self) -> Formula:
        if len(self._tokens) == 1:
            raise self._fault("the formula is empty", "write one, such as G !lab")
        formula = self._binary(1)
        if self._next.kind != "end":
            remedy = "join the two parts by &, |, -> or U"
            before = self._tokens[self._position - 1]
            if before.kind == "atom" and set(before.text) <= set("XFG"):
                remedy = f"'{before.text}' is read as an id; write {' '.join(before.text)}"
            elif self._next.text == ")":
                remedy = "remove it, or add the missing '('"
            raise self._fault(f"expected an operator, found {self._next.text!r}", remedy)
        layer, depth = [formula], 0
        while layer := [arg for part in layer for arg in part.args]:
            depth += 1
            if depth > _MAX_DEPTH:
                raise self._too_deep()
        return formula

    @property
    def _next(self) -> _Token:
        return self._tokens[self._position]

    def _fault(self, problem: str, remedy: str, column: int = 0) -> BadInput:
        return _fault(self._text, column or self._next.column, problem, remedy)

    def _too_deep(self) -> BadInput:
        problem = f"more than {_MAX_DEPTH} operators or parentheses inside one another"
        return self._fault(problem, "split the rule into several")

    def _take(self) -> Operator:
        token = self._next
        self._position += 1
        return cast("Operator", token.text)

    def _at(self, *operators: str) -> bool:
        return self._next.kind == "op" and self._next.text in operators

    def _binary(self, floor: int) -> Formula:
        """Climb: read operands joined by operators that bind at least as tightly as `floor`."""
        left = self._operand()
        while self._at(*_LEVEL) and (level := _LEVEL[self._next.text]) >= floor:
            op = self._take()
            if op in "&|":
                parts = [left, self._binary(level + 1)]
                while self._at(op):
                    self._take()
                    parts.append(self._binary(level + 1))
                left = Formula(op, tuple(parts))
            else:
                left = Formula(op, (left, self._deeper(self._binary, level)))
        return left

    def _operand(self) -> Formula:
        if self._at(*_UNARY):
            return Formula(self._take(), (self._deeper(self._operand),))
        if self._at("true", "false"):
            return Formula(self._take())
        if self._at("("):
            return self._deeper(self._group)
        if self._next.kind == "atom":
            return self._atom()
        remedy = "write an id, true, false, a unary operator or '(' here"
        if self._next.kind == "op" and self._next.text in _RESERVED:
            remedy += f'; an id named {self._next.text} is written "{self._next.text}"'
        raise self._fault(f"expected an operand, found {self._next.text!r}", remedy)

    def _group(self) -> Formula:
        opening = self._next.column
        self._take()
        inner = self._binary(1)
        if not self._at(")"):
            problem = f"expected ')' for the '(' of column {opening}, found {self._next.text!r}"
            raise self._fault(problem, "close it, or join the two parts by an operator")
        self._take()
        return inner

    def _atom(self) -> Formula:
        token = self._next
        if self._known is not None and token.text not in self._known:
            remedy = did_you_mean(token.text, sorted(self._known))
            raise self._fault(f"unknown id {token.text!r}", remedy)
        self._take()
        return atom(token.text)

    def _deeper(self, read: Callable[..., Formula], *floor: int) -> Formula:
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            raise self._too_deep()
        formula = read(*floor)
        self._depth -= 1
        return formula


def parse(text: str, known: Collection[str] | None = None) -> Formula:
    """Read a formula.

    Unary operators (``! X F G``) bind tightest, then ``U R W M``, ``&``, ``|``, ``->`` and
    ``<->``; all but ``&`` and ``|``, which take any number of operands, associate to the right.
    ``not``, ``and``, ``or``, ``&&`` and ``||`` are understood too. An id consists of letters,
    digits, ``_``, ``-`` and ``.``; one that has other characters, or is an operator, is written
    in double quotes. Law: ``parse(str(formula)) == formula``.

    Parameters
    ----------
    text
        The formula.
    known
        The ids that may occur; any if None.

    Raises
    ------
    BadInput
        If the text is no formula, or names an unknown id. The message shows the column.

    Examples
    --------
    >>> print(parse("not wall.2 U gate-1 and G(a->F b)"))
    !wall.2 U gate-1 & G (a -> F b)
    >>> parse("true")
    parse('true')
    """
    return _Parser(text, known).whole()


def atoms(formula: Formula) -> frozenset[str]:
    """Return the ids that occur in a formula.

    Examples
    --------
    >>> sorted(atoms(parse("a U (b & a)")))
    ['a', 'b']
    >>> atoms(parse("true"))
    frozenset()
    """
    if formula.op == "atom":
        return frozenset((formula.name,))
    return frozenset().union(*map(atoms, formula.args))
