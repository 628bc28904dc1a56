"""What was said, and what was not."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from oath.instruct.model.grounding import name_said, numbers, point_said, priority_said

SPOKEN = [
    ("at five and nineteen point five", [5, 19.5]),
    ("(-3, 2.5)", [-3, 2.5]),
    ("[[7,5],[8,5]]", [7, 5, 8, 5]),
    ("from 7,5 to 8,5", [7, 5, 8, 5]),
    ("x=4 y=7.5.", [4, 7.5]),
    ("x is minus four, y seven", [-4, 7]),
    ("x5 y7.5, 3m wide", [5, 7.5, 3]),
    ("twenty-one and a half", [21.5]),
    ("three and a quarter, two point oh five", [3.25, 2.05]),
    ("one hundred and five", [105]),
    ("5 point 25", [5.25]),
    ("zero point five", [0.5]),
    ("3-5", [3, 5]),
    ("five nineteen", [5, 19]),
    ("robot2 and t15 at the 2nd gate, 1e9", []),
    ("", []),
]


@pytest.mark.parametrize(("text", "said"), SPOKEN)
def test_numbers_are_heard_in_digits_and_words(text: str, said: list[float]) -> None:
    assert numbers(text) == said


@given(st.text(max_size=200))
def test_any_text_has_some_numbers(text: str) -> None:
    assert all(isinstance(value, float) for value in numbers(text))


@given(
    st.floats(-1e4, 1e4).map(lambda x: round(x, 3)), st.floats(0, 1e4).map(lambda x: round(x, 3))
)
def test_a_point_that_is_written_is_said(x: float, y: float) -> None:
    said = numbers(f"a task at ({x:.3f}, {y:.3f}) for c")
    assert point_said((x, y), said)
    assert point_said((y, x), said) == (x == y)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("robot2", "pause Robot two please"),
        ("robot2", "pause robot 2"),
        ("bush-1", "bush 1 is gone"),
        ("c", "no, C"),
        ("aa", "task 'aa'."),
        ("a", "take it to A"),
        ("a", "cancel task a now"),
        ("task_12", "task 12"),
        ("héllo", "to HÉLLO"),
        ("#!", "to #!"),
    ],
)
def test_names_are_heard(name: str, text: str) -> None:
    assert name_said(name, text)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("bb", "cancel bb1"),
        ("bb1", "cancel bb"),
        ("b", "cancel bb"),
        ("b", "robot b-1"),
        ("a", "A new task is at a place"),
        ("robot2", "pause robot"),
        ("2", "pause robot2"),
        ("aa", ""),
    ],
)
def test_names_are_not_made_up_of_parts(name: str, text: str) -> None:
    assert not name_said(name, text)


def test_kinds_may_be_said_of_several() -> None:
    assert name_said("bush", "there are bushes", plural=True)
    assert not name_said("bush", "there are bushes")


def test_a_priority_is_said_or_usual() -> None:
    assert priority_said("high", "normal", "an urgent task")
    assert not priority_said("high", "normal", "a task")
    assert priority_said("normal", "normal", "a task next to the wall")
    assert not priority_said("normal", "normal", "an urgent task")
    assert priority_said("high", "high", "aa")
    assert not priority_said("high", "high", "aa last")
