"""Linear temporal logic over zone, place and task ids: what a rule means and what it equals."""

from __future__ import annotations

from collections.abc import Collection

from oath.errors import BadInput
from oath.motion.formula import FALSE, TRUE, Formula, Operator, atom, atoms, conjunction, parse

__all__ = [
    "FALSE",
    "TRUE",
    "Formula",
    "atom",
    "atoms",
    "conjunction",
    "invariants",
    "negation_normal_form",
    "parse",
    "simplify",
]

_MAX_SIZE = 5_000
_WEAKER = {"U": "W", "M": "R"}
_DUAL: dict[Operator, Operator] = {
    "true": "false", "&": "|", "F": "G", "U": "R", "W": "M", "X": "X",
    "false": "true", "|": "&", "G": "F", "R": "U", "M": "W",
}  # fmt: skip


def negation_normal_form(formula: Formula) -> Formula:
    """Return an equivalent of ``formula`` with ``!`` on atoms only.

    ``->`` and ``<->`` disappear; the temporal operators stay, or become their duals:
    ``!(a U b) = !a R !b``, ``!(a W b) = !a M !b``, ``!F a = G !a``, ``!X a = X !a``.

    Raises
    ------
    BadInput
        If nested ``<->``, each of which doubles its operands, make it too large to handle.

    Examples
    --------
    >>> print(negation_normal_form(parse("!(a -> F b)")))
    a & G !b
    >>> print(negation_normal_form(parse("!!a")))
    a
    """
    if _size(formula) > _MAX_SIZE:
        raise BadInput(
            f"the formula grows beyond {_MAX_SIZE} operators when each <-> is written out",
            remedy="nest fewer of them, or split the rule into several",
        )
    return _push(formula, False)


def _size(formula: Formula) -> int:
    inner = sum(map(_size, formula.args))
    return 2 * inner + 3 if formula.op == "<->" else inner + 1


def _push(formula: Formula, negated: bool) -> Formula:
    """Return the normal form of a formula or of its negation."""
    op, args = formula.op, formula.args
    if op == "atom":
        return Formula("!", (formula,)) if negated else formula
    if op == "!":
        return _push(args[0], not negated)
    if op == "->":
        parts = _push(args[0], not negated), _push(args[1], negated)
        return Formula("&" if negated else "|", parts)
    if op == "<->":
        yes, no = ([_push(arg, turned) for arg in args] for turned in (False, True))
        same, other = (no, yes) if negated else (yes, no)
        return Formula("|", (Formula("&", (yes[0], same[1])), Formula("&", (no[0], other[1]))))
    return Formula(
        _DUAL[op] if negated else op,
        tuple(_push(arg, negated) for arg in args),
    )


def simplify(formula: Formula) -> Formula:
    """Return an equivalent in negation normal form that is seldom larger, often smaller.

    Constants are folded; ``&`` and ``|`` are flattened and lose operands that another one
    implies (idempotence and absorption are cases of it); repeated temporal operators collapse.
    The implication test is syntactic, after Somenzi and Bloem, *Efficient Büchi automata from LTL
    formulae* (2000), section 3.

    Examples
    --------
    >>> print(simplify(parse("F F a & (b | true) & F (a & X c)")))
    F (a & X c)
    >>> print(simplify(parse("a & !a")))
    false
    """
    return _Simplifier().simplify(negation_normal_form(formula))


class _Simplifier:
    """The rules, with the implications already decided."""

    def __init__(self) -> None:
        self._decided: dict[tuple[Formula, Formula], bool] = {}

    def simplify(self, formula: Formula) -> Formula:
        if formula.op in ("true", "false", "atom", "!"):
            return formula
        return self._build(formula.op, [self.simplify(arg) for arg in formula.args])

    def _build(self, op: Operator, args: list[Formula]) -> Formula:
        """Apply `op` to operands that are simple already."""
        if op in "&|":
            return self._junction(op, args)
        if op in "XFG":
            return self._unary(op, args[0])
        return self._binary(op, *args)

    def _junction(self, op: Operator, args: list[Formula]) -> Formula:
        neutral, absorbing = (TRUE, FALSE) if op == "&" else (FALSE, TRUE)
        kept: list[Formula] = []
        for part in (inner for arg in args for inner in (arg.args if arg.op == op else (arg,))):
            if any(self._redundant(op, part, other) for other in kept):
                continue
            kept = [other for other in kept if not self._redundant(op, other, part)]
            kept.append(part)
        present = set(kept)
        if any(_push(part, True) in present for part in kept):
            return absorbing
        if op == "|" and sum(part.op == "F" for part in kept) > 1:
            # One obligation is cheaper in an automaton than several to choose from.
            inner = self._junction("|", [part.args[0] for part in kept if part.op == "F"])
            kept = [part for part in kept if part.op != "F"]
            return self._junction("|", [*kept, self._unary("F", inner)])
        if not kept:
            return neutral
        return kept[0] if len(kept) == 1 else Formula(op, tuple(kept))

    def _redundant(self, op: Operator, part: Formula, other: Formula) -> bool:
        return self._implies(other, part) if op == "&" else self._implies(part, other)

    def _unary(self, op: Operator, arg: Formula) -> Formula:
        if arg.op in ("true", "false") or self._lasting(arg):
            return arg
        inner = arg.args
        if op == "F":
            if arg.op in "FU":
                return self._unary("F", inner[-1])
            if arg.op == "M":
                return self._unary("F", self._junction("&", [*inner]))
        if op == "G":
            if arg.op in "GR":
                return self._unary("G", inner[-1])
            if arg.op == "W":
                return self._unary("G", self._junction("|", [*inner]))
            if arg.op == "&":
                return self._junction("&", [self._unary("G", part) for part in inner])
        return Formula(op, (arg,))

    @staticmethod
    def _lasting(formula: Formula) -> bool:
        """Whether the formula is of the form G F a or F G a, hence holds always or never."""
        return formula.op + formula.args[0].op in ("GF", "FG") if formula.args else False

    def _binary(self, op: Operator, left: Formula, right: Formula) -> Formula:
        if self._implies(left, right) if op in "UW" else self._implies(right, left):
            return right
        match left.op, op, right.op:
            case ("true", "U", _):
                return self._unary("F", right)
            case ("false", "R", _):
                return self._unary("G", right)
            case (_, "W", "false"):
                return self._unary("G", left)
            case (_, "M", "true"):
                return self._unary("F", left)
            case ("true", "W", _) | (_, "R", "true"):
                return TRUE
            case ("false", "M", _) | (_, "U", "false"):
                return FALSE
            case (_, "U", "F") | (_, "R", "G"):
                return right
        if (right.op == op and right.args[0] == left) or (op in "UR" and self._lasting(right)):
            return right
        return Formula(op, (left, right))

    def _implies(self, left: Formula, right: Formula) -> bool:
        """Whether the trees alone show that `right` holds wherever `left` does."""
        if left == right or left.op == "false" or right.op == "true":
            return True
        if (left, right) not in self._decided:
            self._decided[left, right] = self._decide(left, right)
        return self._decided[left, right]

    def _decide(self, left: Formula, right: Formula) -> bool:
        a, b, implies = left.args, right.args, self._implies
        if left.op == "|":
            return all(implies(part, right) for part in a)
        if right.op == "&":
            return all(implies(left, part) for part in b)
        match left.op, right.op:
            case ("F" | "U", "F") if implies(a[-1], right):
                return True
            case ("M", "F") if any(implies(part, right) for part in a):
                return True
            case ("G", "G") if implies(left, b[0]):
                return True
        monotone = left.op in "XFGURWM" and right.op in (left.op, _WEAKER.get(left.op))
        if monotone and all(map(implies, a, b)):
            return True
        match left.op:  # what `left` says of the present
            case "&" if any(implies(part, right) for part in a):
                return True
            case "U" | "W" if all(implies(part, right) for part in a):
                return True
            case "G" | "R" | "M" if implies(a[-1], right):
                return True
        match right.op:  # what in the present is enough for `right`
            case "|":
                return any(implies(left, part) for part in b)
            case "F" | "U" | "W":
                return implies(left, b[-1])
            case "R" | "M":
                return all(implies(left, part) for part in b)
        return False


def invariants(formula: Formula) -> tuple[frozenset[str], Formula]:
    """Split off the ids that must never hold, so that avoiding a zone needs no automaton state.

    With ``never, rest = invariants(formula)``, the formula is equivalent to
    ``rest & G !a & G !b & ...`` for the a, b, ... in ``never``, and ``rest`` (in negation normal
    form, simplified) names none of them.

    Examples
    --------
    >>> never, rest = invariants(parse("!F(lab | pit) & (!lab U dock)"))
    >>> sorted(never), rest
    (['lab', 'pit'], parse('F dock'))
    >>> invariants(parse("G !lab & F lab"))[1]
    parse('false')
    """
    never: set[str] = set()
    rest = simplify(formula)
    while True:
        parts = rest.args if rest.op == "&" else (rest,)
        banned = {part.args[0].args[0].name for part in parts if _bans(part)}
        if not banned:
            return frozenset(never), rest
        never |= banned
        rest = simplify(_without(rest, banned))


def _bans(formula: Formula) -> bool:
    return formula.op == "G" and formula.args[0].op == "!"


def _without(formula: Formula, absent: Collection[str]) -> Formula:
    if formula.op == "atom":
        return FALSE if formula.name in absent else formula
    return Formula(formula.op, tuple(_without(arg, absent) for arg in formula.args), formula.name)
