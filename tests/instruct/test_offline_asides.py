"""What is said besides an instruction, and what of it must not be left out."""

from __future__ import annotations

from typing import Any

import pytest

from oath.bench.utterances import world
from oath.commands import Live, to_plain
from oath.instruct import Dialogue, Draft, Reply
from oath.instruct.offline import Offline
from oath.instruct.offline.asides import without_asides
from oath.instruct.offline.gates import as_line
from oath.instruct.offline.tokens import clean, lex

WORDS = frozenset(["cancel", "bb", "please", "stop", "robot", "it", "is", "the", "because", "not"])


@pytest.fixture(scope="module")
def live() -> Live:
    return world()


def say(live: Live, *turns: str) -> Reply:
    reply = Offline().interpret(Dialogue(said=turns[:1]), live)
    for n, turn in enumerate(turns[1:], 2):
        assert reply.intent is not None
        draft = Draft(intent=reply.intent, parameters=reply.parameters, missing=reply.missing)
        reply = Offline().interpret(Dialogue(said=(*turns[: n - 1], turn), draft=draft), live)
    return reply


@pytest.mark.parametrize(
    ("text", "left"),
    [
        ("Good evening, bb please", "bb please"),
        ("stop it, thanks a lot", "stop it ,"),
        ("Zounds gadzooks, stop robot 5", "stop robot 5"),
        ("cancel 7 because nobody came", "cancel 7"),
        ("7 is broken since last night", "7 is broken"),
    ],
)
def test_asides_are_left_out(text: str, left: str) -> None:
    assert as_line(without_asides(lex(clean(text)), WORDS)) == left.replace(
        "5", "<number>"
    ).replace("7", "<number>")


@pytest.mark.parametrize(
    "text",
    [
        "not now, cancel 7",
        "maybe, cancel 7",
        "just kidding, cancel 7",
        "cancel 7 because it is less urgent",
        "cancel 7 as soon as the truck is here",
        "cancel 7 because 8 is done",
        "tomorrow, cancel 7",
    ],
)
def test_what_may_bear_on_an_instruction_is_kept(text: str) -> None:
    tokens = lex(clean(text))
    assert len(without_asides(tokens, WORDS)) == len(tokens)


@pytest.mark.parametrize(
    ("text", "parameters"),
    [
        ("Good evening everyone, Ludmila here, cancel gb for me", {"task_label": "gb"}),
        ("Hold robot3 because the floor is being polished", {"robot": "robot3"}),
        ("cancel cc, my granddaughter ate the cake", {"task_label": "cc"}),
        ("task be is cancelled", {"task_label": "be"}),
        ("robot number three is on fire", {"robot": "robot3"}),
    ],
)
def test_it_acts_in_spite_of_them(live: Live, text: str, parameters: dict[str, Any]) -> None:
    reply = say(live, text)
    assert reply.status == "complete", reply.message
    assert to_plain(reply.commands[0])["parameters"] == parameters


@pytest.mark.parametrize(
    "text",
    [
        "robot2 should not be halted because of the visitors",
        "when robot3 is back, cancel cc because it is late",
        "there is not any wall from (5, 2) to (5, 6)",
        "switch robot3 off",
        "he is cancelled",
    ],
)
def test_they_hide_nothing(live: Live, text: str) -> None:
    assert not say(live, text).commands


@pytest.mark.parametrize(
    ("turns", "name", "value"),
    [
        (("add a task at (5, 17) to C", "y should be 19.5"), "location", [5.0, 19.5]),
        (
            ("there is a wall from (5, 2) to (5, 5)", "no, until (5, 6)"),
            "obstacle_location",
            [[5.0, 2.0], [5.0, 6.0]],
        ),
        (("pause a robot", "number two"), "robot", "robot2"),
        (("make cc high", "no, low, not high"), "priority", "low"),
    ],
)
def test_corrections(live: Live, turns: tuple[str, ...], name: str, value: object) -> None:
    reply = say(live, *turns)
    assert reply.status == "complete", reply.message
    assert to_plain(reply.commands[0])["parameters"][name] == value


def test_a_priority_that_was_never_said_is_asked_for(live: Live) -> None:
    draft = Draft(intent="change_task_priority")
    reply = Offline().interpret(Dialogue(said=("one of them", "cc"), draft=draft), live)
    assert reply.missing == ("priority",)
