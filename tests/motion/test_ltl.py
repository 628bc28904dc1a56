"""Formulas: reading, writing, normal forms, and what simplification may not change."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from oath.errors import BadInput
from oath.motion.ltl import (
    FALSE,
    TRUE,
    Formula,
    atom,
    atoms,
    conjunction,
    invariants,
    negation_normal_form,
    parse,
    simplify,
)
from oracles import holds

UNARY = ("!", "X", "F", "G")
BINARY = ("->", "<->", "U", "R", "W", "M")
LETTERS = st.lists(st.frozensets(st.sampled_from("abc")), max_size=3)
LOOPS = st.lists(st.frozensets(st.sampled_from("abc")), min_size=1, max_size=3)


def formulas(names: st.SearchStrategy[str]) -> st.SearchStrategy[Formula]:
    def grow(inner: st.SearchStrategy[Formula]) -> st.SearchStrategy[Formula]:
        def node(ops: tuple[str, ...], least: int, most: int) -> st.SearchStrategy[Formula]:
            operands = st.lists(inner, min_size=least, max_size=most).map(tuple)
            return st.builds(Formula, st.sampled_from(ops), operands)

        return node(UNARY, 1, 1) | node(BINARY, 2, 2) | node(("&", "|"), 2, 3)

    return st.recursive(st.sampled_from((TRUE, FALSE)) | names.map(atom), grow, max_leaves=8)


WORDS = formulas(st.sampled_from("abc"))


@given(formulas(st.text() | st.sampled_from(["F", "U", "true", "and", "gate-1", "a-", "wall.2"])))
def test_what_is_written_is_read_back(formula: Formula) -> None:
    assert parse(str(formula)) == formula


@pytest.mark.parametrize(
    ("text", "grouped"),
    [
        ("!a U b", "(!a) U b"),
        ("G a & b", "(G a) & b"),
        ("F a U X b", "(F a) U (X b)"),
        ("a U b U c", "a U (b U c)"),
        ("a W b R c", "a W (b R c)"),
        ("a M b & c U d", "(a M b) & (c U d)"),
        ("a & b | c & d", "(a & b) | (c & d)"),
        ("a | b -> c | d", "(a | b) -> (c | d)"),
        ("a -> b -> c", "a -> (b -> c)"),
        ("a <-> b -> c", "a <-> (b -> c)"),
        ("a -> b <-> c", "(a -> b) <-> c"),
        ("a->b", "a -> b"),
        ("gate-1->wall-2", '"gate-1" -> "wall-2"'),
        ("a<->b", "a <-> b"),
        ("not a and b or c", "(!a & b) | c"),
        ("!a&&b||c", "(!a & b) | c"),
        ("F F1 & Go", 'F ("F1") & ("Go")'),
        ("G(a)", "G a"),
        ("  a\n & b ", "a & b"),
    ],
)
def test_operators_bind_as_usual(text: str, grouped: str) -> None:
    assert parse(text) == parse(grouped)


def test_chains_and_parentheses_are_kept_apart() -> None:
    assert len(parse("a & b & c").args) == 3
    assert str(parse("(a & b) & c")) == "(a & b) & c"


def test_operators_can_be_quoted_ids() -> None:
    assert parse('"G" U "the lab"') == Formula("U", (atom("G"), atom("the lab")))


@pytest.mark.parametrize(
    ("text", "column", "said"),
    [
        ("", 1, "empty"),
        ("   ", 1, "empty"),
        ("G !a &", 7, "expected an operand, found 'the end'"),
        ("G", 2, "expected an operand"),
        ("& a", 1, "found '&'"),
        ("a b", 3, "expected an operator, found 'b'"),
        ("GF a", 4, "write G F"),
        ("(a | b", 7, "'(' of column 1"),
        ("(a b)", 4, "expected ')'"),
        ("a)", 2, "remove it"),
        ("a U U", 5, 'an id named U is written "U"'),
        ("[] a", 1, "write G for []"),
        ("<> a", 1, "write F for <>"),
        ("a => b", 3, "write -> for =>"),
        ("~a", 1, "write ! for ~"),
        ('a & "b', 5, "close the quote"),
        ("a & b%", 6, "double quotes"),
        ("!" * 5000 + "a", 102, "split the rule"),
        ("(" * 5000 + "a", 101, "split the rule"),
        ("a U " * 5000 + "a", 405, "split the rule"),
    ],
)
def test_mistakes_are_shown_where_they_are(text: str, column: int, said: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse(text)
    message = str(caught.value)
    assert f"column {column}:" in message
    assert said in message


def test_the_caret_points_at_the_mistake() -> None:
    with pytest.raises(BadInput) as caught:
        parse("a & " * 40 + "| b")
    *_, shown, caret = str(caught.value).splitlines()
    assert shown[caret.index("^")] == "|"


def test_unknown_ids_get_a_suggestion() -> None:
    assert parse("G !lab", known={"lab"}) == parse("G !lab")
    with pytest.raises(BadInput, match=r"column 4: unknown id 'lba'; did you mean 'lab'\?"):
        parse("G !lba", known=["lab", "dock"])


def test_equal_formulas_are_equal_and_hash_alike() -> None:
    assert len({parse("a U b"), parse("(a) U (b)"), parse("a W b")}) == 2


def test_atoms() -> None:
    assert atoms(parse("G (a -> F b) & true & !a")) == {"a", "b"}


def test_conjunction_of_none_one_and_many() -> None:
    assert conjunction([]) == TRUE
    assert conjunction([atom("a")]) == atom("a")
    assert conjunction(map(atom, "abc")) == parse("a & b & c")


def operators(formula: Formula) -> set[str]:
    return {formula.op}.union(*map(operators, formula.args))


def negated(formula: Formula) -> list[Formula]:
    below = [found for arg in formula.args for found in negated(arg)]
    return [formula.args[0], *below] if formula.op == "!" else below


@given(WORDS, LETTERS, LOOPS)
def test_normal_forms_mean_the_same(
    formula: Formula, prefix: list[frozenset[str]], loop: list[frozenset[str]]
) -> None:
    expected = holds(formula, prefix, loop)
    for form in (negation_normal_form(formula), simplify(formula)):
        assert holds(form, prefix, loop) == expected
        assert not operators(form) & {"->", "<->"}
        assert all(part.op == "atom" for part in negated(form))


@given(WORDS)
def test_simplifying_twice_changes_nothing_more(formula: Formula) -> None:
    once = simplify(formula)
    assert len(str(simplify(once))) <= len(str(once))


@pytest.mark.parametrize(
    ("text", "simple"),
    [
        ("F F a", "F a"),
        ("G G a", "G a"),
        ("F G F a", "G F a"),
        ("G F G a", "F G a"),
        ("X G F a", "G F a"),
        ("a U (G F b)", "G F b"),
        ("a & a & true", "a"),
        ("a & (a | b)", "a"),
        ("a | a & b", "a"),
        ("a | !a", "true"),
        ("F a & G !a", "false"),
        ("a U true", "true"),
        ("a U false", "false"),
        ("true U a", "F a"),
        ("false R a", "G a"),
        ("a W false", "G a"),
        ("a M true", "F a"),
        ("a U (a U b)", "a U b"),
        ("F (a U b)", "F b"),
        ("G (a R b)", "G b"),
        ("F a | F b", "F (a | b)"),
        ("G (a & b)", "G a & G b"),
        ("F a & F (b & F a)", "F (b & F a)"),
        ("(a <-> b) & (!a <-> b)", "(a & b | !a & !b) & (!a & b | a & !b)"),
    ],
)
def test_known_simplifications(text: str, simple: str) -> None:
    assert str(simplify(parse(text))) == simple


@pytest.mark.parametrize(
    ("text", "never", "rest"),
    [
        ("G !a", "a", "true"),
        ("!F a & F c", "a", "F c"),
        ("G (!a & !b)", "ab", "true"),
        ("G !(a | b) & F c", "ab", "F c"),
        ("F c & (G !a & G (b -> false))", "ab", "F c"),
        ("G !a & G (a | !b)", "ab", "true"),
        ("G !a & F a", "", "false"),
        ("G !a | G !b", "", "G !a | G !b"),
        ("!a U b", "", "!a U b"),
        ("F G !a", "", "F G !a"),
        ("!G !a", "", "F a"),
    ],
)
def test_invariants_are_split_off(text: str, never: str, rest: str) -> None:
    assert invariants(parse(text)) == (frozenset(never), parse(rest))


@given(WORDS, LETTERS, LOOPS)
def test_invariants_and_rest_are_the_whole(
    formula: Formula, prefix: list[frozenset[str]], loop: list[frozenset[str]]
) -> None:
    never, rest = invariants(formula)
    avoided = not any(letter & never for letter in [*prefix, *loop])
    assert holds(formula, prefix, loop) == (avoided and holds(rest, prefix, loop))
    assert not atoms(rest) & never


def test_nested_equivalences_are_refused_before_they_explode() -> None:
    with pytest.raises(BadInput, match="written out"):
        negation_normal_form(parse(" <-> ".join(f"t{i}" for i in range(40))))
