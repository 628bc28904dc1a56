"""Automata of routes and rules against the semantics of their formulas."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oath.errors import BadInput
from oath.motion.ltl import atoms, conjunction, parse
from oath.motion.mission_automaton import (
    Letter,
    RouteAutomaton,
    compile_rules,
    formula,
    sequence,
)
from oracles import holds, stays_accepted

NAMES = ("a", "b", "c", "lab", "pit")
LETTERS = st.frozensets(st.sampled_from(NAMES), max_size=3)
WORDS = st.tuples(st.lists(LETTERS, max_size=7), st.lists(LETTERS, min_size=1, max_size=3))
STOPS = st.lists(st.sampled_from(("a", "b", "c")), max_size=4)
AVOID = st.frozensets(st.sampled_from(("lab", "pit")), max_size=2)


# --- The chain of a route


@settings(max_examples=400, deadline=None)
@given(stops=STOPS, avoid=AVOID, word=WORDS)
def test_sequence_accepts_what_its_formula_means(
    stops: list[str], avoid: frozenset[str], word: tuple[list[Letter], list[Letter]]
) -> None:
    prefix, loop = word
    expected = holds(formula(stops, avoid), prefix, loop)
    assert sequence(stops, avoid).accepts(prefix, loop) == expected


@settings(max_examples=100, deadline=None)
@given(stops=STOPS, avoid=AVOID, data=st.data())
def test_sequence_accepts_words_that_serve_in_order(
    stops: list[str], avoid: frozenset[str], data: st.DataObject
) -> None:
    """Random words seldom serve a long route; these do, and miss by one stop or one bad letter."""
    fill = st.lists(st.frozensets(st.sampled_from(("a", "c"))), max_size=2)
    word = [letter for stop in stops for letter in (*data.draw(fill), frozenset([stop]))]
    automaton = sequence(stops, avoid)
    assert automaton.accepts(word, [frozenset()])
    if avoid:
        bad = data.draw(st.sampled_from(sorted(avoid)))
        assert not automaton.accepts([*word, frozenset([bad])], [frozenset()])
        assert not automaton.accepts(word, [frozenset(), frozenset([bad])])


@settings(max_examples=100, deadline=None)
@given(stops=STOPS, avoid=AVOID, letter=LETTERS)
def test_sequence_is_deterministic_and_never_goes_back(
    stops: list[str], avoid: frozenset[str], letter: Letter
) -> None:
    automaton = sequence(stops, avoid)
    assert automaton.states == len(stops) + 1
    assert automaton.initial == {0} and automaton.accepting == {len(stops)}
    for state in range(automaton.states):
        successors = automaton.successors(state, letter)
        assert len(successors) == (0 if letter & avoid else 1)
        assert all(state <= following for following in successors)


def test_one_letter_may_serve_several_stops() -> None:
    chain = sequence(["a", "b", "c"])
    assert chain.successors(0, {"a", "b"}) == {2}
    assert chain.successors(0, {"a", "c"}) == {1}
    assert chain.successors(0, {"b", "c"}) == {0}
    assert chain.accepts([{"a", "b", "c"}], [set()])
    assert sequence(["a", "a"]).successors(0, {"a"}) == {2}


def test_formula_quotes_ids_that_look_like_operators() -> None:
    whole = formula(["F", "t 1", "x@pickup"], ["G"])
    assert atoms(whole) == {"F", "t 1", "x@pickup", "G"}
    assert holds(whole, [{"F"}, {"t 1"}, {"x@pickup"}], [set()])


# --- Rules


def test_rules_split_what_must_never_be_touched() -> None:
    rules = compile_rules(["G !lab", "!pit U a", "G (!b & !c)"], NAMES)
    assert rules.avoid == {"lab", "b", "c"}
    assert rules.relevant == {"lab", "pit", "a", "b", "c"}
    named = {id for _, label, _ in rules.automaton.edges for id in label.positive | label.negative}
    assert named <= {"pit", "a"}


def test_invariants_alone_need_one_state() -> None:
    rules = compile_rules(["G !lab", "G !pit"], NAMES)
    assert rules.avoid == {"lab", "pit"}
    assert rules.automaton.states == 1
    assert compile_rules([], NAMES).avoid == frozenset()
    assert compile_rules([], NAMES).automaton.states == 1


TEXTS = (
    "G !lab",
    "!b W a",
    "F c",
    "G (lab -> F a)",
    "!pit U b",
    "F (a & F b)",
    "G !pit",
)


@settings(max_examples=250, deadline=None)
@given(texts=st.lists(st.sampled_from(TEXTS), max_size=3, unique=True), word=WORDS)
def test_step_by_step_equals_the_semantics(
    texts: list[str], word: tuple[list[Letter], list[Letter]]
) -> None:
    """Stepping through a prefix and staying at its end satisfies all rules or it does not."""
    prefix, (last, *_) = word
    try:
        rules = compile_rules(texts, NAMES)
    except BadInput:  # together they cannot be kept
        return
    states = frozenset(rules.automaton.initial)
    for letter in prefix:
        states = rules.step(states, letter)
    stays = stays_accepted(rules.automaton, last)
    accepted = not last & rules.avoid and any(stays[q] for q in states)
    whole = conjunction([parse(text) for text in texts])
    assert accepted == holds(whole, prefix, [last])


def test_a_broken_rule_leaves_no_state() -> None:
    rules = compile_rules(["G !lab", "!b W a"], NAMES)
    start = frozenset(rules.automaton.initial)
    assert rules.step(start, frozenset({"lab"})) == frozenset()
    assert rules.step(start, frozenset({"b"})) == frozenset()
    assert rules.step(rules.step(start, frozenset({"a"})), frozenset({"b"}))
    assert rules.step(frozenset(), frozenset()) == frozenset()


@pytest.mark.parametrize(
    "texts", [["F a", "G !a"], ["a & !a"], ["G lab", "F !lab"], ["false"], ["F G a", "G F !a"]]
)
def test_contradictions_are_refused(texts: list[str]) -> None:
    with pytest.raises(BadInput, match="contradict") as caught:
        compile_rules(texts, NAMES, file="m.yaml")
    assert caught.value.field == "rules" and caught.value.file == "m.yaml"
    assert caught.value.remedy
    assert all(repr(text) in str(caught.value) for text in texts)


@pytest.mark.parametrize(
    ("text", "needle"), [("G !labb", "did you mean 'lab'"), ("G (", "rules[1]"), ("F x1", "x1")]
)
def test_bad_rules_name_themselves(text: str, needle: str) -> None:
    with pytest.raises(BadInput) as caught:
        compile_rules(["F a", text], NAMES, file="m.yaml")
    assert needle in str(caught.value)
    assert str(caught.value).startswith("m.yaml: rules[1]: ")


# --- The product of both


@settings(max_examples=60, deadline=None)
@given(
    texts=st.lists(st.sampled_from(TEXTS), max_size=2, unique=True),
    services=st.lists(LETTERS, max_size=3),
    letters=st.lists(LETTERS, min_size=1, max_size=4),
)
def test_tables_equal_brute_force(
    texts: list[str], services: list[Letter], letters: list[Letter]
) -> None:
    rules = compile_rules(texts, NAMES)
    n = rules.automaton.states
    stops = [(f"t{i}@visit", letter) for i, letter in enumerate(services)]
    route = RouteAutomaton(rules, stops)

    def may(letter: Letter, q: int, p: int) -> bool:
        return not letter & rules.avoid and any(
            (source, target) == (q, p) and label.allows(letter)
            for source, label, target in rules.automaton.edges
        )

    drive, serve = route.drive(letters), route.serve()
    assert drive.shape == (len(letters), n, n) and serve.shape == (len(stops), n, n)
    for q, p in product(range(n), repeat=2):
        for i, letter in enumerate(letters):
            assert drive[i, q, p] == may(letter, q, p)
        for i, (own, letter) in enumerate(stops):
            assert serve[i, q, p] == may(letter | {own}, q, p)
    for letter in letters:
        expected = stays_accepted(rules.automaton, letter)
        if letter & rules.avoid:
            expected = [False] * n
        assert route.settled(letter).tolist() == expected
    for table in (drive, serve, route.settled(letters[0])):
        assert table.dtype == np.uint8


def test_an_empty_route_has_only_the_rules() -> None:
    route = RouteAutomaton(compile_rules(["G !lab"], NAMES), [])
    assert route.serve().shape == (0, 1, 1)
    assert route.settled(frozenset()).tolist() == [1]
    assert route.settled(frozenset({"lab"})).tolist() == [0]
