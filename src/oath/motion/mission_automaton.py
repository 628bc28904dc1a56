"""Automata of routes: a chain built directly for the stops, times an automaton for the rules.

A route is the formula F(s1 & F(s2 & ...)) & G !z1 & G !z2 ...: serve the stops in order and never
touch what is to be avoided. Its automaton is a chain that needs no translation. Whatever else the
rules ask for goes through the general translation once per mission.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from oath.errors import BadInput
from oath.motion.buchi import Automaton, Label, translate
from oath.motion.ltl import Formula, atoms, conjunction, invariants, parse

Letter = frozenset[str]
Table = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """The rules of a mission, compiled.

    `avoid` must never be touched; `automaton` accepts what satisfies the rest; `relevant` are all
    atoms that occur.
    """

    avoid: frozenset[str]
    automaton: Automaton
    relevant: frozenset[str]
    _steps: dict[tuple[frozenset[int], Letter], frozenset[int]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def step(self, states: frozenset[int], letter: Letter) -> frozenset[int]:
        """Where the automaton may be after one more letter; empty once a rule is broken."""
        after = self._steps.get((states, letter))
        if after is None:
            after = self._steps[states, letter] = self._step(states, letter)
        return after

    def _step(self, states: frozenset[int], letter: Letter) -> frozenset[int]:
        if letter & self.avoid:
            return frozenset()
        return frozenset(q for state in states for q in self.automaton.successors(state, letter))


def compile_rules(
    rules: Sequence[str], known: Collection[str], *, file: str | None = None
) -> Rules:
    """Compile a mission's rules over the known zones, places and tasks.

    Raises
    ------
    BadInput
        If a rule is not LTL, names something unknown, or the rules contradict each other.
    """
    formulas = []
    for i, text in enumerate(rules):
        try:
            formulas.append(parse(text, known))
        except BadInput as error:
            remedy = error.remedy.partition("\n")[0]  # an error in a file is one line
            raise BadInput(error.problem, file=file, field=f"rules[{i}]", remedy=remedy) from error
    whole = conjunction(formulas)
    avoid, rest = invariants(whole)
    automaton = translate(rest)
    if not automaton.initial:
        raise BadInput(
            f"the rules {', '.join(map(repr, rules))} contradict each other",
            file=file,
            field="rules",
            remedy="no run can satisfy all of them; relax one",
        )
    return Rules(avoid=avoid, automaton=automaton, relevant=atoms(whole))


def sequence(stops: Sequence[str], avoid: Iterable[str] = ()) -> Automaton:
    """Build the deterministic automaton that sees the stops in order and never an avoided atom.

    State i has seen the first i stops; the last one accepts. One letter may serve several stops.

    Examples
    --------
    >>> chain = sequence(["a", "b"], avoid=["lab"])
    >>> chain.accepts([{"a"}, {"b"}], [set()]), chain.accepts([{"b"}, {"a"}], [set()])
    (True, False)
    >>> sequence([], ["lab"]).accepts([{"lab"}], [set()])
    False
    """
    never = frozenset(avoid)
    n = len(stops)
    edges = []
    for i in range(n + 1):
        for j in range(i, n + 1):
            later = frozenset(stops[j : j + 1])
            edges.append((i, Label(frozenset(stops[i:j]), later | never), j))
    return Automaton(n + 1, frozenset([0]), frozenset([n]), tuple(edges))


def formula(stops: Sequence[str], avoid: Iterable[str] = ()) -> Formula:
    """The LTL formula whose language `sequence` accepts."""
    text = "true"
    for stop in reversed(stops):
        text = f'F ("{stop}" & {text})'
    return conjunction([parse(text)] + [parse(f'G !"{name}"') for name in sorted(avoid)])


class RouteAutomaton:
    """The automaton of a route: the chain of its stops times the automaton of the rules.

    Driving stays at one link of the chain and serving a stop leads to the next, so the product
    splits into legs; within a leg only the state q of the rules' automaton changes.

    Parameters
    ----------
    rules
        The compiled rules.
    services
        For every stop in order, an atom of its own and what else serving it makes true.
    """

    def __init__(self, rules: Rules, services: Sequence[tuple[str, Letter]]) -> None:
        self.rules = rules
        self.chain = sequence([own for own, _ in services], rules.avoid)
        self._letters = [letter | {own} for own, letter in services]

    def drive(self, letters: Sequence[Letter]) -> Table:
        """(letters, q, q') flags: driving an edge with this letter may lead from q to q'."""
        return np.stack([self._moves(0, letter, 0) for letter in letters])

    def serve(self) -> Table:
        """(stops, q, q') flags: serving stop i may lead from q to q'."""
        n = self.rules.automaton.states
        tables = [self._moves(i, letter, i + 1) for i, letter in enumerate(self._letters)]
        return np.stack(tables) if tables else np.zeros((0, n, n), dtype=np.uint8)

    def settled(self, letter: Letter) -> Table:
        """(q,) flags: staying for ever where this letter holds satisfies the rules from q."""
        automaton, last = self.rules.automaton, len(self._letters)
        stays = self.chain.settles(last, letter)
        flags = [stays and automaton.settles(q, letter) for q in range(automaton.states)]
        return np.array(flags, dtype=np.uint8)

    def _moves(self, link: int, letter: Letter, next_link: int) -> Table:
        n = self.rules.automaton.states
        table = np.zeros((n, n), dtype=np.uint8)
        if next_link in self.chain.successors(link, letter):
            for q in range(n):
                table[q, list(self.rules.automaton.successors(q, letter))] = 1
        return table
