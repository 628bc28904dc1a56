"""From a rule of linear temporal logic to the Büchi automaton of the words that keep it.

After Gastin and Oddoux, *Fast LTL to Büchi automata translation* (2001): the formula's temporal
parts are the states of a very weak alternating automaton; sets of them are the states of a
generalised automaton with acceptance on transitions; counting through its acceptance sets gives
the Büchi automaton. Each stage is simplified before the next is built from it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field

from oath.errors import BadInput
from oath.motion.ltl import Formula, atoms, invariants
from oath.motion.reduction import (
    Graph,
    bits,
    components,
    count_through,
    cyclic,
    minimal,
    reaching,
    reduce,
    trim,
)


@dataclass(frozen=True, slots=True)
class Label:
    """A condition on one letter: what must hold in it and what must not.

    Examples
    --------
    >>> Label(frozenset({"dock"}), frozenset({"lab"})).allows({"dock", "gate"})
    True
    >>> Label(frozenset(), frozenset()).allows(set())
    True
    """

    positive: frozenset[str]
    negative: frozenset[str]

    def allows(self, letter: AbstractSet[str]) -> bool:
        """Return whether the letter (the set of ids that hold) meets the condition."""
        return self.positive <= letter and self.negative.isdisjoint(letter)


@dataclass(frozen=True, slots=True)
class Automaton:
    """A non-deterministic Büchi automaton over letters that are sets of ids.

    It accepts an infinite word if one of its runs visits ``accepting`` again and again. Every
    state lies on an accepting run, so a run that dies has broken the rule, and an automaton
    without initial states accepts nothing.

    Parameters
    ----------
    states
        How many there are; they are called 0, 1, 2, ...
    initial, accepting
        States to begin in, and to visit infinitely often.
    edges
        Triples (from, label, to), sorted by their source.

    Examples
    --------
    >>> from oath.motion.ltl import parse
    >>> automaton = translate(parse("!lab U dock"))
    >>> automaton.accepts([set(), {"dock"}], [{"lab"}])
    True
    >>> automaton.accepts([], [set()])
    False
    """

    states: int
    initial: frozenset[int]
    accepting: frozenset[int]
    edges: tuple[tuple[int, Label, int], ...]
    _out: tuple[tuple[tuple[Label, int], ...], ...] = field(init=False, repr=False, compare=False)
    _atoms: frozenset[str] = field(init=False, repr=False, compare=False)
    _settled: dict[frozenset[str], frozenset[int]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        out: list[list[tuple[Label, int]]] = [[] for _ in range(self.states)]
        for source, label, target in self.edges:
            out[source].append((label, target))
        named = (label.positive | label.negative for _, label, _ in self.edges)
        object.__setattr__(self, "_out", tuple(map(tuple, out)))
        object.__setattr__(self, "_atoms", frozenset().union(*named))
        object.__setattr__(self, "_settled", {})

    def successors(self, state: int, letter: AbstractSet[str]) -> frozenset[int]:
        """Return the states that reading ``letter`` may lead to from ``state``."""
        return frozenset(target for label, target in self._out[state] if label.allows(letter))

    def accepts(self, prefix: Sequence[AbstractSet[str]], loop: Sequence[AbstractSet[str]]) -> bool:
        """Return whether the word ``prefix loop loop loop ...`` is accepted.

        Raises
        ------
        BadInput
            If the loop is empty.
        """
        if not loop:
            raise BadInput("the loop of a lasso word is empty", remedy="give at least one letter")
        current = self.initial
        for letter in prefix:
            current = frozenset().union(*(self.successors(state, letter) for state in current))
        return not current.isdisjoint(self._accepted(loop))

    def settles(self, state: int, letter: AbstractSet[str]) -> bool:
        """Return whether reading ``letter`` for ever from ``state`` is accepted.

        A finished mission repeats its last letter. The answer for all states is kept per letter,
        and only the ids that the automaton names count.
        """
        key = self._atoms & letter
        if key not in self._settled:
            self._settled[key] = self._accepted([key])
        return state in self._settled[key]

    def _accepted(self, loop: Sequence[AbstractSet[str]]) -> frozenset[int]:
        """Return the states from which ``loop`` for ever is accepted."""
        n = self.states
        out = [
            [target + (place + 1) % len(loop) * n for target in self.successors(state, letter)]
            for place, letter in enumerate(loop)
            for state in range(n)
        ]
        component = components(out)
        good = {component[node] for node in range(len(out)) if node % n in self.accepting}
        live = reaching(out, component, good & cyclic(out, component))
        return frozenset(state for state in range(n) if live[state])


def translate(formula: Formula, *, max_edges: int = 20_000) -> Automaton:
    """Return an automaton that accepts exactly the infinite words that satisfy ``formula``.

    The same formula gives the same automaton in every process. A word's letter is the set of the
    ids that hold at one moment. Laws, for every word w: exactly one of ``translate(f)`` and
    ``translate(!f)`` accepts w; ``translate(f & g)`` accepts w if and only if both do.

    Parameters
    ----------
    formula
        Any formula. Tasks without an order among them cost a factor of two in states each.
    max_edges
        Give up when the generalised automaton, before it is simplified, has more edges, or half
        as many from one state.

    Raises
    ------
    BadInput
        If the automaton grows beyond ``max_edges``.

    Examples
    --------
    >>> from oath.motion.ltl import parse
    >>> translate(parse("G F dock")).states
    2
    >>> translate(parse("a & !a"))
    Automaton(states=0, initial=frozenset(), accepting=frozenset(), edges=())
    """
    never, rest = invariants(formula)
    try:
        general = _Alternating(rest, max_edges).explore()
    except _TooLargeError:
        raise BadInput(
            f"the rule '{_clipped(formula)}' needs an automaton of more than {max_edges} edges",
            remedy="split it into several rules, or put its tasks into an order",
        ) from None
    return _spell(reduce(count_through(reduce(trim(general)))), never)


class _TooLargeError(Exception):
    """The automaton is larger than the caller wants to wait for."""


def _clipped(formula: Formula, length: int = 60) -> str:
    text = str(formula)
    return text if len(text) <= length else text[: length - 1] + "…"


class _Alternating:
    """The very weak alternating automaton of a formula.

    Its states are the formula's temporal parts and literals, numbered bottom-up, so that a part
    comes after what it is made of. The words here have one field more than those of a graph,
    between label and pending sets: the set of states to be in next. One domination test thus
    compares labels, targets and acceptance; to leave out the last would lose words.
    """

    def __init__(self, formula: Formula, max_edges: int) -> None:
        self._formula, self._max_edges = formula, max_edges
        self._names = tuple(sorted(atoms(formula)))
        self._number: dict[Formula, int] = {}
        self._enumerate(formula)
        self._target = 2 * len(self._names)  # where the field begins
        self._pending = self._target + len(self._number)
        parts = enumerate(self._number)
        self._eventual = sum(1 << i for i, part in parts if part.op in ("F", "U", "M"))
        self._options: dict[Formula, list[int]] = {}
        self._steps: dict[int, list[int]] = {0: [0]}
        self._own = [self._obliged(part) for part in self._number]

    def explore(self) -> Graph:
        """Return the generalised automaton: its states are sets of states of this one."""
        initial = [word >> self._target for word in self._later(self._formula)]
        index = {state: i for i, state in enumerate(initial)}
        queue = list(initial)
        edges: list[list[tuple[int, int]]] = []
        total = 0
        for state in queue:
            edges.append([])
            for step in self._successors(state):
                target = step >> self._target & ~(-1 << len(self._number))
                if target not in index:
                    index[target] = len(index)
                    queue.append(target)
                # An obligation that begins here is pending: it has not been met yet.
                pending = step >> self._pending | target & self._eventual & ~state
                label = step & ~(-1 << self._target)
                edges[-1].append((label | pending << self._target, index[target]))
            total += len(edges[-1])
            if total > self._max_edges:
                raise _TooLargeError
        return Graph(self._names, list(range(len(initial))), edges)

    def _enumerate(self, part: Formula) -> None:
        for arg in part.args if part.op != "!" else ():
            self._enumerate(arg)
        if part.op not in ("&", "|", "true", "false"):
            self._number.setdefault(part, len(self._number))

    def _obliged(self, part: Formula) -> list[int]:
        """Return the options of a part; one that puts an eventual part off has it pending."""
        again = 1 << self._target + self._number[part]
        pending = 1 << self._pending + self._number[part]
        if _recurrent(part):
            return [again | pending, *self._both(self._delta(part.args[0].args[0]), [again])]
        if part.op not in ("F", "U", "M"):
            return self._delta(part)
        return [word | pending if word & again else word for word in self._delta(part)]

    def _successors(self, state: int) -> list[int]:
        """Return the steps of a set of states: one option of each, taken together."""
        done, steps = 0, [0]
        for i in bits(state):
            done |= 1 << i
            if done not in self._steps:
                self._steps[done] = self._both(steps, self._own[i])
            steps = self._steps[done]
        return steps

    def _both(self, left: list[int], right: list[int]) -> list[int]:
        """Return the words that take one of each side, without those that contradict."""
        n = len(self._names)
        low = ~(-1 << n)
        if len(left) * len(right) > 20 * self._max_edges:
            raise _TooLargeError
        words = {a | b for a in left for b in right}
        words = {word for word in words if not word & word >> n & low}
        if len(words) > self._max_edges // 2:
            raise _TooLargeError
        return minimal(words)

    def _boolean(self, part: Formula, leaf: Callable[[Formula], list[int]]) -> list[int]:
        """Return the disjunctive normal form of a part, given the words of what is in it."""
        match part.op:
            case "true":
                return [0]
            case "false":
                return []
            case "|":
                return minimal(word for arg in part.args for word in self._boolean(arg, leaf))
            case "&":
                words = [0]
                for arg in part.args:
                    words = self._both(words, self._boolean(arg, leaf))
                return words
        return leaf(part)

    def _later(self, part: Formula) -> list[int]:
        """Return the sets of states that each leave the part for the next moment."""
        return self._boolean(part, lambda leaf: [1 << self._target + self._number[leaf]])

    def _delta(self, part: Formula) -> list[int]:
        """Return the ways to satisfy a part from now on: a label and what is left for later."""
        if part not in self._options:
            self._options[part] = self._boolean(part, self._unfold)
        return self._options[part]

    def _unfold(self, part: Formula) -> list[int]:
        op, args = part.op, part.args
        if op == "atom":
            return [1 << self._names.index(part.name)]
        if op == "!":
            return [1 << len(self._names) + self._names.index(args[0].name)]
        if op == "X":
            return self._later(args[0])
        again = [1 << self._target + self._number[part]]
        if _recurrent(part):
            return again
        last = self._delta(args[-1])
        if op == "F":
            return minimal(last + again)
        if op == "G":
            return self._both(last, again)
        first = self._delta(args[0])
        if op in "UW":
            return minimal(last + self._both(first, again))
        return self._both(last, minimal(first + again))


def _recurrent(part: Formula) -> bool:
    """Whether the part is of the form G F a.

    As a state that loops, in an acceptance set whenever it sees a, it is never joined by F a: n
    such parts take one state instead of one for each set of them.
    """
    return part.op == "G" and part.args[0].op == "F"


def _spell(graph: Graph, never: frozenset[str]) -> Automaton:
    """Write the labels out as ids, and forbid on every edge what must never hold."""
    names, labels = graph.names, dict[int, Label]()
    for edges in graph.edges:
        for word, _ in edges:
            if word not in labels:
                positive = frozenset(names[i] for i in bits(word) if i < len(names))
                negative = frozenset(names[i] for i in bits(word >> len(names)))
                labels[word] = Label(positive, negative | never)
    return Automaton(
        states=len(graph.edges),
        initial=frozenset(graph.initial),
        accepting=graph.accepting,
        edges=tuple(
            (state, labels[word], target)
            for state, edges in enumerate(graph.edges)
            for word, target in edges
        ),
    )
