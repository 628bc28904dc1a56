"""Judge the mission's rules: linear temporal logic over what each robot did, by its own semantics.

A robot's run is a finite word, one letter for each move and each stop served, whose last position
then repeats for ever. A letter says of each atom whether it surely and whether it possibly held, as
a pair of bounds (lower, upper): contact within rounding is possible but not sure. Formulas are
evaluated on both bounds at once, and only what is surely broken is a violation.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from oath.errors import BadInput, did_you_mean
from oath.events import Moved, RobotFailed, StopServed, TaskAdded
from oath.model import Polygon
from oath.verify.record import TOLERANCE, Record, Track, Violation

Truth = NDArray[np.bool_]
"""(2, n) bounds: row 0 where something surely holds, row 1 where it possibly holds."""

UNARY = {"!": "!", "~": "!", "not": "!", "X": "X", "F": "F", "G": "G"}
BINARY = {
    **{word: (word, 5) for word in "URWM"},
    **dict.fromkeys(("&", "&&", "and"), ("&", 4)),
    **dict.fromkeys(("|", "||", "or"), ("|", 3)),
    "->": ("->", 2),
    "<->": ("<->", 1),
}
"""Token to operator and how tightly it binds."""

RIGHT_ASSOCIATIVE = {"U", "R", "W", "M", "->"}

TOKEN = re.compile(
    r"""\s*(?:(?P<sign><->|->|&&|\|\||[!~&|()])|"(?P<quoted>[^"]*)"|(?P<word>(?:[\w.]|-(?!>))+))"""
)


@dataclass(frozen=True, slots=True)
class Formula:
    """An operator and its operands; `op` is ``atom``, ``true``, ``false`` or as written."""

    op: str
    parts: tuple[Formula, ...] = ()
    name: str = ""

    def atoms(self) -> set[str]:
        """Return the names of all atoms."""
        own = {self.name} if self.op == "atom" else set()
        return own.union(*(part.atoms() for part in self.parts))


def parse(text: str) -> Formula:
    """Read a formula: ``! X F G`` bind tighter than ``U R W M``, ``&``, ``|``, ``->``, ``<->``.

    Atoms are letters, digits, ``_ - .`` or quoted; ``not and or && ||`` are understood too.

    Raises
    ------
    BadInput
        The text is not a formula.

    Examples
    --------
    >>> parse("G !lab").atoms()
    {'lab'}
    >>> parse("a->b") == parse('("a") -> b')
    True
    >>> parse("G (a &")
    Traceback (most recent call last):
    oath.errors.BadInput: rule 'G (a &' ends where a formula is expected
    """
    reader = _Reader(text, [*_tokens(text)])
    formula = reader.binary(1)
    if reader.tokens:
        raise BadInput(f"rule '{text}' has '{reader.tokens[0][0]}' where it should end")
    return formula


def _tokens(text: str) -> Iterator[tuple[str, bool]]:
    """Yield each token, and whether it was quoted and so can only be an atom."""
    place, end = 0, len(text.rstrip())
    while place < end:
        match = TOKEN.match(text, place)
        if match is None:
            raise BadInput(f"rule '{text}' has '{text[place:].strip()[0]}', which means nothing")
        quoted = match["quoted"]
        yield (quoted, True) if quoted is not None else (match["sign"] or match["word"], False)
        place = match.end()


@dataclass(slots=True)
class _Reader:
    text: str
    tokens: list[tuple[str, bool]]

    def binary(self, level: int) -> Formula:
        left = self.unary()
        while self.tokens and not self.tokens[0][1]:
            op, tightness = BINARY.get(self.tokens[0][0], ("", 0))
            if tightness < level:
                break
            self.tokens.pop(0)
            right = self.binary(tightness if op in RIGHT_ASSOCIATIVE else tightness + 1)
            left = Formula(op, (left, right))
        return left

    def unary(self) -> Formula:
        if not self.tokens:
            raise BadInput(f"rule '{self.text}' ends where a formula is expected")
        token, quoted = self.tokens.pop(0)
        if quoted:
            return Formula("atom", name=token)
        if token in UNARY:
            return Formula(UNARY[token], (self.unary(),))
        if token in ("true", "false"):
            return Formula(token)
        if token == "(":
            inner = self.binary(1)
            if not self.tokens or self.tokens.pop(0) != (")", False):
                raise BadInput(f"rule '{self.text}' lacks a ')'")
            return inner
        if token in BINARY or token == ")":
            raise BadInput(f"rule '{self.text}' has '{token}' where a formula is expected")
        return Formula("atom", name=token)


def evaluate(formula: Formula, letters: Mapping[str, Truth], n: int) -> Truth:
    """Evaluate a formula at each of n positions, the last of which repeats for ever.

    Parameters
    ----------
    letters
        For each atom, its bounds at each position, (2, n).

    Returns
    -------
    (2, n) bounds of the formula; it holds of the whole run if it does at position 0.

    Examples
    --------
    >>> here = np.array([[False, True, False], [False, True, True]])  # no, yes, perhaps
    >>> evaluate(parse("F a"), {"a": here}, 3).astype(int)
    array([[1, 1, 0],
           [1, 1, 1]])
    """
    if formula.op == "atom":
        return letters[formula.name]
    if formula.op in ("true", "false"):
        return np.full((2, n), formula.op == "true")
    a, *more = (evaluate(part, letters, n) for part in formula.parts)
    b = more[0] if more else a
    match formula.op:
        case "!":
            return _not(a)
        case "X":
            return np.concatenate([a[:, 1:], a[:, -1:]], axis=1)
        case "F":
            return _until(np.ones_like(a), a)
        case "G":
            return _not(_until(np.ones_like(a), _not(a)))
        case "&":
            return a & b
        case "|":
            return a | b
        case "->":
            return _not(a) | b
        case "<->":
            return (a & b) | (_not(a) & _not(b))
        case "U":
            return _until(a, b)
        case "R":
            return _not(_until(_not(a), _not(b)))
        case "M":
            return _until(b, a & b)
        case _:  # a W b, that is b R (a | b)
            return _not(_until(_not(b), _not(a | b)))


def _not(a: Truth) -> Truth:
    return ~a[::-1]


def _until(a: Truth, b: Truth) -> Truth:
    """Least solution of u = b | (a & next u), from the last position backwards."""
    u = b.copy()
    for k in range(u.shape[1] - 2, -1, -1):
        u[:, k] |= a[:, k] & u[:, k + 1]
    return u


def judge_rules(record: Record) -> Iterator[Violation]:
    """Yield the mission's rules that a robot surely broke.

    A robot that failed, or any in a log that is cut off, is judged only by what it did, not by what
    it might still have done.

    Raises
    ------
    BadInput
        A rule cannot be read or names nothing that exists.
    """
    formulas = [_formula(record, i) for i in range(len(record.mission.rules))]
    if not formulas:
        return
    atoms = set[str]().union(*(formula.atoms() for formula in formulas))
    failed = {event.robot for _, event in record.usable if isinstance(event, RobotFailed)}
    for track in record.tracks.values():
        seqs, letters = _word(record, track, atoms)
        ends = record.summary is not None and track.robot.id not in failed
        for text, formula in zip(record.mission.rules, formulas, strict=True):
            if not ends:
                letters = {atom: _forget(truth, len(seqs)) for atom, truth in letters.items()}
            if evaluate(formula, letters, len(seqs) + 1)[1, 0]:
                continue
            yield _violation(track, text, seqs, _first_bad(formula, letters, len(seqs)))


def _formula(record: Record, i: int) -> Formula:
    mission = record.mission
    added = [event.task.id for _, event in record.usable if isinstance(event, TaskAdded)]
    names = [*mission.zones, *mission.places, *(task.id for task in mission.tasks), *added]
    field = f"rules[{i}]"
    try:
        formula = parse(mission.rules[i])
    except BadInput as problem:
        raise BadInput(problem.problem, file=mission.source, field=field) from None
    for atom in sorted(formula.atoms() - set(names)):
        text = f"'{atom}' is no zone, place or task"
        raise BadInput(text, file=mission.source, field=field, remedy=did_you_mean(atom, names))
    return formula


def _word(record: Record, track: Track, atoms: set[str]) -> tuple[list[int], dict[str, Truth]]:
    """Return the events behind the letters, and the bounds of each atom at each letter and after.

    The letters number one more than the events: the last is where the robot stays.
    """
    me, mission = track.robot.id, record.mission
    mine = [
        (seq, event)
        for seq, event in record.usable
        if isinstance(event, Moved | StopServed) and event.robot == me
    ]
    shapes = [_path(event) for _, event in mine]
    last = [event for _, event in mine if isinstance(event, Moved)]
    shapes.append(shapely.Point(last[-1].to if last else track.robot.start))
    paths = np.array(shapes)
    tasks = _finishing(record, [event for _, event in mine])
    letters = {}
    for atom in atoms:
        truth = np.zeros((2, len(paths)), dtype=bool)
        if atom in mission.zones:
            truth |= _inside(mission.zones[atom], paths)
        if atom in mission.places:
            off = shapely.distance(paths, shapely.Point(mission.places[atom]))
            truth |= np.stack([off <= TOLERANCE / 2, off <= TOLERANCE * 2])
        truth[:, :-1] |= np.array([task == atom for task in tasks], dtype=bool)
        letters[atom] = truth
    return [seq for seq, _ in mine], letters


def _path(event: Moved | StopServed) -> Any:
    if isinstance(event, StopServed):
        return shapely.Point(event.at)
    if event.from_ == event.to:
        return shapely.Point(event.to)
    return shapely.LineString([event.from_, event.to])


def _inside(zone: Polygon, paths: NDArray[Any]) -> Truth:
    shape = shapely.Polygon(zone)
    core = shape.buffer(-TOLERANCE, join_style="mitre")
    return np.stack([shapely.intersects(paths, core), shapely.dwithin(paths, shape, TOLERANCE)])


def _finishing(record: Record, mine: list[Moved | StopServed]) -> list[str | None]:
    """Return for each event the task that it finishes, if any."""
    last = {task.id: task.stops[-1].name for task in record.mission.tasks}
    for _, event in record.usable:
        if isinstance(event, TaskAdded):
            last[event.task.id] = event.task.stops[-1].name
    return [
        event.task if isinstance(event, StopServed) and event.stop == last[event.task] else None
        for event in mine
    ]


def _forget(truth: Truth, k: int) -> Truth:
    """Keep the first k letters and say of all later ones: nothing is sure, all is possible."""
    unknown = np.array([[False], [True]])
    return np.concatenate([truth[:, :k], unknown], axis=1)


def _first_bad(formula: Formula, letters: Mapping[str, Truth], n: int) -> int | None:
    """Return how many letters it takes until the rule can no longer be kept, None if it ever can.

    What is surely broken stays so whatever follows, so bisection finds the first such prefix.
    """

    def broken(k: int) -> bool:
        short = {atom: _forget(truth, k) for atom, truth in letters.items()}
        return not evaluate(formula, short, k + 1)[1, 0]

    k = bisect_left(range(n + 1), True, key=broken)
    return k if k <= n else None


def _violation(track: Track, rule: str, seqs: list[int], bad: int | None) -> Violation:
    if bad is None:
        seq, text = None, f"the rule '{rule}' is still not fulfilled when the run ends"
    else:
        # A rule that no letter at all can keep ("false") has no event to blame.
        seq, text = (seqs[bad - 1] if bad > 0 else None), f"the rule '{rule}' is broken"
    return Violation(rule="mission_rule", seq=seq, robot=track.robot.id, message=text)
