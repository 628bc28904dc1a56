"""Automata: they accept exactly what the definition of the logic says."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from random import Random

import networkx as nx
import pytest

from oath.errors import BadInput
from oath.motion.buchi import Automaton, Label, translate
from oath.motion.ltl import FALSE, TRUE, Formula, atom, parse
from oath.motion.reduction import components
from oracles import holds

NAMES = "abc"
SHAPES = [
    (op, n)
    for n, ops in ((1, "! X F G"), (2, "& | -> <-> U R W M"), (3, "& |"))
    for op in ops.split()
]
LETTERS = [frozenset(n for i, n in enumerate(NAMES) if code >> i & 1) for code in range(8)]


def any_formula(rng: Random, depth: int) -> Formula:
    if depth == 0 or rng.random() < 0.15:
        return rng.choice((TRUE, FALSE)) if rng.random() < 0.06 else atom(rng.choice(NAMES))
    op, operands = rng.choice(SHAPES)
    return Formula(op, tuple(any_formula(rng, depth - 1) for _ in range(operands)))


def any_word(rng: Random) -> tuple[list[frozenset[str]], list[frozenset[str]]]:
    return rng.choices(LETTERS, k=rng.randrange(4)), rng.choices(LETTERS, k=rng.randint(1, 3))


@pytest.mark.parametrize(("seed", "depth", "count"), [(0, 2, 600), (1, 3, 800), (2, 4, 200)])
def test_accepts_exactly_the_words_that_satisfy(seed: int, depth: int, count: int) -> None:
    rng = Random(seed)
    for _ in range(count):
        formula = any_formula(rng, depth)
        automaton, complement = translate(formula), translate(Formula("!", (formula,)))
        for _ in range(20):
            prefix, loop = any_word(rng)
            expected = holds(formula, prefix, loop)
            assert automaton.accepts(prefix, loop) == expected, (formula, prefix, loop)
            assert complement.accepts(prefix, loop) != expected, (formula, prefix, loop)


# Domination that forgets acceptance, sets met by another obligation of the same state, and a
# promise that is renewed before it is kept.
@pytest.mark.parametrize(
    "text",
    [
        "G (F a & X F b)",
        "G F (a & X F b) & G F !a",
        "G (a U b | c U b)",
        "G (X F a) & F a",
        "G F a & G F b & G F c",
        "(G F a -> G F b) & (G F b -> G F c)",
        "F G (a | X (b M c))",
        "G (a -> X (!a U b)) & G (b -> F c)",
        "(a U b) U c & G (c -> X (b R a))",
        "a W (b W c) | (a M b) M c",
    ],
)
def test_words_all_around_the_traps(text: str) -> None:
    rng = Random(text)
    formula = parse(text)
    automaton = translate(formula)
    for _ in range(1500):
        prefix, loop = any_word(rng)
        assert automaton.accepts(prefix, loop) == holds(formula, prefix, loop), (prefix, loop)


@pytest.mark.parametrize(
    ("text", "states", "edges"),
    [
        ("true", 1, 1),
        ("false", 0, 0),
        ("a", 2, 2),
        ("G a", 1, 1),
        ("F a", 2, 3),
        ("a U b", 2, 3),
        ("a R b", 2, 3),
        ("a W b", 2, 3),
        ("X X a", 4, 4),
        ("F G a", 2, 3),
        ("G F a", 2, 4),
        ("G (a -> F b)", 2, 5),
        ("F a & F b & F c", 8, 27),
        ("G F a & G F b & G F c", 4, None),
        ("F (a & F (b & F c)) & G !d", 4, 10),
    ],
)
def test_known_automata(text: str, states: int, edges: int | None) -> None:
    automaton = translate(parse(text))
    assert automaton.states == states
    assert edges is None or len(automaton.edges) == edges


def sequence(n: int) -> str:
    nested = f"F t{n}"
    for i in range(n - 1, 0, -1):
        nested = f"F (t{i} & {nested})"
    order = " & ".join(f"(!t{i + 1} U t{i})" for i in range(1, n))
    return f"{nested} & {order} & G !z1 & G !z2"


def test_an_ordered_mission_needs_one_state_a_task() -> None:
    automaton = translate(parse(sequence(8)))
    assert automaton.states == 9
    assert all({"z1", "z2"} <= label.negative for _, label, _ in automaton.edges)
    tasks = [{f"t{i}"} for i in range(1, 9)]
    assert automaton.accepts(tasks, [set()])
    assert not automaton.accepts(tasks[::-1], [set()])
    assert not automaton.accepts(tasks, [{"z1"}])


def test_ids_that_must_never_hold_cost_no_state() -> None:
    free, fenced = translate(parse("F a")), translate(parse("F a & G !z & !F y"))
    assert free.states == fenced.states
    assert not fenced.accepts([{"a"}, {"y"}], [set()])


def test_too_large_an_automaton_is_refused() -> None:
    with pytest.raises(BadInput, match="more than 20000 edges; split it"):
        translate(parse(" & ".join(f"F t{i}" for i in range(15))))
    with pytest.raises(BadInput, match="more than 10 edges"):
        translate(parse("F a & F b & F c"), max_edges=10)


@pytest.mark.parametrize("seed", range(3))
def test_settling_is_accepting_the_letter_for_ever(seed: int) -> None:
    rng = Random(seed)
    for _ in range(60):
        automaton = translate(any_formula(rng, 3))
        for letter in LETTERS:
            settled = [state for state in automaton.initial if automaton.settles(state, letter)]
            assert bool(settled) == automaton.accepts([], [letter])
            for state in range(automaton.states):
                there = Automaton(
                    states=automaton.states,
                    initial=frozenset((state,)),
                    accepting=automaton.accepting,
                    edges=automaton.edges,
                )
                assert automaton.settles(state, letter | {"z"}) == there.accepts([], [letter])


@pytest.mark.parametrize("seed", range(3))
def test_every_state_is_of_use(seed: int) -> None:
    rng = Random(seed)
    for _ in range(100):
        automaton = translate(any_formula(rng, 4))
        graph = nx.DiGraph([(source, target) for source, _, target in automaton.edges])
        graph.add_nodes_from(range(automaton.states))
        cycles = [
            block
            for block in nx.strongly_connected_components(graph)
            if block & automaton.accepting and graph.subgraph(block).edges
        ]
        useful: set[int] = set().union(*cycles, *(nx.ancestors(graph, min(c)) for c in cycles))
        reached = automaton.initial.union(*(nx.descendants(graph, s) for s in automaton.initial))
        assert useful == reached == set(range(automaton.states))


def test_components_come_sinks_first() -> None:
    rng = Random(5)
    for _ in range(200):
        n = rng.randint(1, 12)
        out = [rng.choices(range(n), k=rng.randrange(3)) for _ in range(n)]
        graph = nx.DiGraph([(u, v) for u in range(n) for v in out[u]])
        graph.add_nodes_from(range(n))
        component = components(out)
        found = {frozenset(v for v in range(n) if component[v] == c) for c in component}
        assert found == set(map(frozenset, nx.strongly_connected_components(graph)))
        assert all(component[v] <= component[u] for u, v in graph.edges)


def test_labels_compare_with_letters() -> None:
    label = Label(frozenset("a"), frozenset("b"))
    assert label.allows({"a", "c"})
    assert not label.allows({"a", "b"})
    assert not label.allows(set())


def test_successors_follow_labels() -> None:
    automaton = translate(parse("a U b"))
    (start,) = automaton.initial
    (end,) = automaton.accepting
    assert automaton.successors(start, {"a", "b"}) == {start, end}
    assert automaton.successors(start, set()) == frozenset()


def test_an_empty_loop_is_refused() -> None:
    with pytest.raises(BadInput, match="loop"):
        translate(parse("a")).accepts([{"a"}], [])


def test_automata_are_values() -> None:
    automaton = translate(parse("G (a -> F b)"))
    automaton.settles(0, {"a"})
    copy = pickle.loads(pickle.dumps(automaton))
    assert copy == automaton == translate(parse("G (a -> F b)"))
    assert hash(copy) == hash(automaton)


def test_the_same_automaton_in_every_process() -> None:
    program = """
from oath.motion.buchi import translate
from oath.motion.ltl import parse
rules = ["(G F a -> G F b) & (c U d | G e)", "F (a & F b) & (!b W a) & G (c -> X (d M e))"]
for rule in rules:
    automaton = translate(parse(rule))
    print(sorted(automaton.initial), sorted(automaton.accepting), hash(parse(rule)))
    for source, label, target in automaton.edges:
        print(source, sorted(label.positive), sorted(label.negative), target)
"""
    printed = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            check=True,
            text=True,
        ).stdout
        for seed in ("0", "1", "77")
    }
    assert len(printed) == 1
    assert "['a']" in printed.pop()
