"""The judge's temporal logic against known answers and against the textbook's definitions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oath.errors import BadInput
from oath.verify.rules import Formula, evaluate, parse

Word = Sequence[set[str]]


def holds(formula: Formula, word: Word) -> bool:
    """Whether a word, whose last letter repeats for ever, satisfies a formula."""
    letters = {a: np.array([[a in letter for letter in word]] * 2) for a in "abc"}
    sure, possible = evaluate(formula, letters, len(word))[:, 0]
    assert sure == possible
    return bool(sure)


def by_definition(f: Formula, word: Word, i: int = 0) -> bool:
    """The semantics as the textbook writes it: `later` covers every position there ever is."""
    i = min(i, len(word) - 1)
    later = range(i, len(word))
    p = f.parts

    def at(part: Formula, k: int) -> bool:
        return by_definition(part, word, k)

    def until(x: Formula, y: Formula) -> bool:
        return any(at(y, k) and all(at(x, j) for j in range(i, k)) for k in later)

    match f.op:
        case "atom":
            return f.name in word[i]
        case "true" | "false":
            return f.op == "true"
        case "!":
            return not at(p[0], i)
        case "X":
            return at(p[0], i + 1)
        case "F":
            return any(at(p[0], k) for k in later)
        case "G":
            return all(at(p[0], k) for k in later)
        case "&":
            return at(p[0], i) and at(p[1], i)
        case "|":
            return at(p[0], i) or at(p[1], i)
        case "->":
            return not at(p[0], i) or at(p[1], i)
        case "<->":
            return at(p[0], i) == at(p[1], i)
        case "U":
            return until(p[0], p[1])
        case "W":
            return until(p[0], p[1]) or all(at(p[0], k) for k in later)
        case "R":
            return all(at(p[1], k) or any(at(p[0], j) for j in range(i, k)) for k in later)
        case "M":
            return any(at(p[0], k) and all(at(p[1], j) for j in range(i, k + 1)) for k in later)
    raise AssertionError(f.op)


formulas = st.recursive(
    st.sampled_from([Formula("atom", name=a) for a in "abc"] + [Formula("true"), Formula("false")]),
    lambda part: st.one_of(
        st.builds(lambda op, x: Formula(op, (x,)), st.sampled_from("!XFG"), part),
        st.builds(
            lambda op, x, y: Formula(op, (x, y)),
            st.sampled_from(["U", "R", "W", "M", "&", "|", "->", "<->"]),
            part,
            part,
        ),
    ),
    max_leaves=6,
)
words = st.lists(st.sets(st.sampled_from("abc")), min_size=1, max_size=6)


@settings(max_examples=300, deadline=None)
@given(formulas, words)
def test_semantics_is_the_textbook_s(formula: Formula, word: Word) -> None:
    assert holds(formula, word) == by_definition(formula, word)


@pytest.mark.parametrize(
    ("text", "word", "answer"),
    [
        ("G !a", [set(), {"b"}], True),
        ("G !a", [set(), {"a"}, set()], False),
        ("F a", [set()], False),
        ("F G a", [{"b"}, {"a"}], True),
        ("G F a", [{"a"}, {"b"}], False),
        ("!b U a", [set(), {"a", "b"}], True),
        ("!b U a", [{"b"}, {"a"}], False),
        ("a U b", [{"a"}], False),
        ("a W b", [{"a"}], True),
        ("a R b", [{"b"}], True),
        ("a M b", [{"b"}], False),
        ("a M b", [{"b"}, {"a", "b"}, set()], True),
        ("X X X a", [set(), {"a"}], True),
    ],
)
def test_known_answers(text: str, word: Word, answer: bool) -> None:
    assert holds(parse(text), word) is answer


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("a->b", "(a) -> (b)"),
        ("a<->b", "(a) <-> (b)"),
        ("a -> b -> c", "a -> (b -> c)"),
        ("a U b U c", "a U (b U c)"),
        ("! a U b", "(!a) U b"),
        ("G a & b", "(G a) & b"),
        ("a U b & c", "(a U b) & c"),
        ("a | b & c", "a | (b & c)"),
        ("a | b -> c", "(a | b) -> c"),
        ("a -> b <-> c", "(a -> b) <-> c"),
        ("not a and b or c", "(!a & b) | c"),
        ("a && b || c", "(a & b) | c"),
        ("XFGa", '"XFGa"'),
        ("G F a", "G(F(a))"),
    ],
)
def test_precedence(text: str, same: str) -> None:
    assert parse(text) == parse(same)


def test_names() -> None:
    assert parse('G !"lab 1" | dock-2.a_b').atoms() == {"lab 1", "dock-2.a_b"}
    assert parse('"G"') == Formula("atom", name="G")


@pytest.mark.parametrize(
    "text", ["", "a b", "(a", "a)", "U a", "a U", "G", "a $ b", "a & & b", '"a']
)
def test_what_is_no_formula(text: str) -> None:
    with pytest.raises(BadInput, match="rule"):
        parse(text)


@settings(max_examples=100, deadline=None)
@given(formulas, words, st.data())
def test_bounds_hold_whatever_the_uncertain_turns_out_to_be(
    formula: Formula, word: Word, data: st.DataObject
) -> None:
    doubt = {
        a: np.array(data.draw(st.lists(st.booleans(), min_size=len(word), max_size=len(word))))
        for a in "abc"
    }
    truth = {a: np.array([a in letter for letter in word]) for a in "abc"}
    letters = {a: np.stack([truth[a] & ~doubt[a], truth[a] | doubt[a]]) for a in "abc"}
    sure, possible = evaluate(formula, letters, len(word))[:, 0]
    assert sure <= by_definition(formula, word) <= possible
