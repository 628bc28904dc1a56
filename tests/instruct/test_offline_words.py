"""Tokens, numbers in words, points and names of the offline interpreter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from oath.instruct.offline.axes import read_axes
from oath.instruct.offline.names import Names, slip, tag
from oath.instruct.offline.tokens import clean, lex, read_numbers, read_points

WORLD = Names(
    places={"b": "b", "c": "c", "kitchen": "kitchen", "packnorth": "pack-north"},
    robots={"robot1": "robot1", "robot2": "robot2"},
    labels={"bb": "bb", "be": "be", "12": "12"},
    obstacles={"wall1": "wall-1"},
    kinds={"wall": "wall", "bush": "bush"},
    types={"normal": "normal", "special": "special"},
    everyday=frozenset({"the", "should", "is"}),
    label=lambda before, after: float(before[-1:] in (["cancel"], ["task"])),
)


def numbers(text: str) -> list[Any]:
    return [one.value for one in read_numbers(lex(clean(text))) if one.kind == "number"]


def points(text: str) -> list[Any]:
    tokens = read_axes(read_numbers(lex(clean(text))))
    return [one.value for one in read_points(tokens) if one.kind == "point"]


def kinds(text: str, kind: str) -> list[Any]:
    return [one.value for one in tag(text, WORLD) if one.kind == kind]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("five", [5]),
        ("nineteen point five", [19.5]),
        ("two point oh five", [2.05]),
        ("three and a half", [3.5]),
        ("minus two", [-2]),
        ("-2.5", [-2.5]),
        ("twenty-five", [25]),
        ("one hundred and five", [105]),
        ("four point twenty five", [4.25]),
        ("zero point five", [0.5]),
        ("5 point 5", [5.5]),
        ("two point five three point five", [2.5, 3.5]),
        ("this one", []),
        ("1" * 400, [None]),
    ],
)
def test_numbers(text: str, values: list[float | None]) -> None:
    assert numbers(text) == values


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("(5, 19.5)", [(5, 19.5)]),
        ("5 19.5", [(5, 19.5)]),
        ("five and nineteen point five", [(5, 19.5)]),
        ("one and one", [(1, 1)]),
        ("x=4 y=7.5", [(4, 7.5)]),
        ("y is 7, x is 4", [(4, 7)]),
        ("x four y seven", [(4, 7)]),
        ("[(3, 6), (4, 6), (4, 7)]", [(3, 6), (4, 6), (4, 7)]),
        ("from 5 2 to 5 6", [(5, 2), (5, 6)]),
        ("7 5, 8 5 and 8 4.8", [(7, 5), (8, 5), (8, 4.8)]),
        ("5 m, 3 m", [(5, 3)]),
        ("five", []),
        ("(1, 2, 3)", []),
        ("5, 6, 7", []),
        ("2 by 3", [(2, 3)]),
        ("2 by 3 at 5, 5", [(5, 5)]),
        ("5-7", []),
        ("grid 5-7", [(5, 7)]),
        ("at 2 by 3.5", [(2, 3.5)]),
        ("at 4 comma 7 point 5", [(4, 7.5)]),
        ("(7|9)", [(7, 9)]),
        ("{4; 7}", [(4, 7)]),
        ("<4, 7>", [(4, 7)]),
        ("4/7.5", [(4, 7.5)]),
        ("one two, one niner decimal five", [(12, 19.5)]),
        ("one two, one nine point five", []),
        ("along x = 5 from y 2 to y 6", [(5, 2), (5, 6)]),
        ("y is 4, x between 2 and 6", [(2, 4), (6, 4)]),
        ("x=7.5..8.5 y=11", [(7.5, 11), (8.5, 11)]),
        ("from 2 to 6 on the y axis at x 5", [(5, 2), (5, 6)]),
        ("x from 2 to 3 and y from 7 to 9", [(2, 7), (3, 7), (3, 9), (2, 9)]),
        ("x 5 from y 2 to y 6, then 7", []),
    ],
)
def test_points(text: str, found: list[tuple[float, float]]) -> None:
    assert points(text) == found


@given(st.integers(0, 99), st.integers(0, 99))
def test_a_point_in_digits_is_read_as_it_is(x: int, y: int) -> None:
    for form in (f"({x}, {y})", f"{x} {y}", f"x={x}, y={y}", f"[{x}; {y}]"):
        assert points(form) == [(x, y)]


@pytest.mark.parametrize(
    ("text", "kind", "values"),
    [
        ("to point B", "place", ["b"]),
        ("to B.", "place", ["b"]),
        ("the Pack North", "place", ["pack-north"]),
        ("the kitchn", "place", ["kitchen"]),
        ("robot one and Robot 2", "robot", ["robot1", "robot2"]),
        ("robots 1 and 2", "robot", ["robot1", "robot2"]),
        ("r2", "robot", ["robot2"]),
        ("robto1", "robot", ["robot1"]),
        ("all the robots", "robot", ["all"]),
        ("before everything else", "robot", []),
        ('task "BB"', "label", ["bb"]),
        ("bx", "label", []),
        ("it should be done", "label", []),
        ("cancel be", "label", ["be"]),
        ("task be should be done", "label", ["be"]),
        ("task 12", "label", ["12"]),
        ("at 12 5", "label", []),
        ("wall 1", "obstacle", ["wall-1"]),
        ("two walls", "kind", ["wall"]),
        ("a speical one", "type", ["special"]),
        ("a normal task", "type", ["normal"]),
        ("normal priority", "type", []),
        ("point A", "unknown_place", [None]),
        ("room F", "unknown_place", [None]),
        ("robot9", "unknown_robot", [None]),
        ("task zz", "unknown_label", [None]),
        ("robot number two", "robot", ["robot2"]),
        ("task bravo bravo", "label", ["bb"]),
        ("deliver to bravo", "place", ["b"]),
        ("bravo says hello", "place", []),
        ("task zulu zulu", "unknown_label", [None]),
        ("a wal and a stretcher", "kind", ["wall"]),
    ],
)
def test_names(text: str, kind: str, values: list[str | None]) -> None:
    assert kinds(text, kind) == values


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cancle taks", "cancel task"),
        ("incraese the priorty", "increase the priority"),
        ("feet", "feet"),
        ("nearly", "nearly"),
        ("ball", "ball"),
    ],
)
def test_slips_in_everyday_words_are_mended(text: str, words: str) -> None:
    known = replace(
        WORLD, known=frozenset(("cancel", "task", "the", "increase", "priority", "free"))
    )
    assert " ".join(one.text for one in tag(text, known)) == words


def test_digits_have_no_slips() -> None:
    assert not slip("robot1", "robot2")
    assert not slip("b", "c")
    assert slip("kitchen", "kitchn") and slip("ktichen", "kitchen")


@given(st.text(max_size=300))
def test_any_text_has_tokens(text: str) -> None:
    for token in tag(text, WORLD):
        assert token.kind and isinstance(token.text, str)
