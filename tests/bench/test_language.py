"""The study of language, on interpreters that know all answers, some, or none."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import pytest

from oath.bench import Row, markdown, study
from oath.bench.language import KINDS, SETS, TITLES, confusion, score, table
from oath.bench.utterances import (
    PAPERS,
    Utterance,
    dialogues,
    heldout,
    instructions,
    judge,
    paper_right,
    same,
    world,
)
from oath.commands import COMMANDS, Command, Live, admit, parse, to_plain
from oath.instruct import Dialogue, Reply

ALL = {name: load() for name, load in SETS.items()}
LIVE = world()


def complete(*commands: Command) -> Reply:
    plain = to_plain(commands[0])
    return Reply(
        status="complete",
        message="",
        intent=plain["intent"],
        parameters=plain["parameters"],
        commands=commands,
    )


def asks(intent: str | None = None, *missing: str) -> Reply:
    status = "need_more_info" if missing else "clarification"
    return Reply(status=status, message="What?", intent=intent, missing=missing)


def cancels() -> Reply:
    return complete(parse({"intent": "cancel_task", "parameters": {"task_label": "bb"}}))


def knows(one: Utterance) -> Reply:
    """The right reply."""
    if one.kind == "full":
        return complete(*one.commands)
    return asks(None if one.kind == "none" else one.intent or None, *sorted(one.missing))


class Fake:
    """Answers the last turn of every utterance it was told of, and asks at all others."""

    def __init__(
        self, said: Sequence[Utterance], answer: Callable[[Utterance], Reply] = knows
    ) -> None:
        self.answers = {one.turns[-1].strip(): answer(one) for one in said}

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        return self.answers.get(dialogue.said[-1], asks())


@cache
def some(name: str) -> tuple[Utterance, ...]:
    """A few of every set, of all kinds; turns that mean different things elsewhere are left out."""
    last = Counter(one.turns[-1].strip() for one in ALL[name])
    return tuple(one for one in ALL[name] if last[one.turns[-1].strip()] == 1)[::5]


def rows(name: str, answer: Callable[[Utterance], Reply] = knows) -> list[Row]:
    said = some(name)
    return [{"set": name, **row} for row in score(Fake(said, answer), said)]


# -- the data


@pytest.mark.parametrize(("name", "enough"), [("validation", 440), ("held-out", 480)])
def test_there_are_many_utterances_of_every_kind_and_intent(name: str, enough: int) -> None:
    said = ALL[name]
    assert len(said) >= enough and len({one.family for one in said}) >= 45
    assert len({one.turns for one in said}) == len(said)
    assert sum(one.intent in PAPERS for one in said) >= 200
    full = Counter(one.intent for one in said if one.kind == "full")
    assert set(full) == set(COMMANDS) and min(full.values()) >= 7
    assert {one.kind for one in said} == set(KINDS)


def test_there_are_dialogues() -> None:
    said = [one for name in ALL if "dialogues" in name for one in ALL[name]]
    assert len(said) >= 110 and len(ALL["dialogues"]) >= 20
    assert len({one.turns for one in said}) == len(said)
    assert all(2 <= len(one.turns) <= 4 for one in said)


@pytest.mark.parametrize(
    ("name", "earlier"),
    [
        ("held-out", ["validation"]),
        ("dialogues", ["seen dialogues", "validation dialogues"]),
    ],
)
def test_a_later_set_repeats_nothing_of_the_earlier(name: str, earlier: list[str]) -> None:
    before = [one for other in earlier for one in ALL[other]]
    assert not {one.turns for one in before} & {one.turns for one in ALL[name]}
    assert not {one.family for one in before} & {one.family for one in ALL[name]}


def test_the_instructions_are_those_of_the_paper() -> None:
    said = instructions()
    assert len(said) == 90
    assert Counter(one.intent for one in said) == dict.fromkeys(PAPERS, 30)
    assert Counter(one.family.split(", ")[1] for one in said) == {"clear": 30, "ambiguous": 60}


@pytest.mark.parametrize("name", SETS)
def test_what_is_meant_is_well_formed(name: str) -> None:
    for one in ALL[name]:
        assert bool(one.missing) == (one.kind == "partial")
        assert one.intent in {*COMMANDS, ""}
        assert one.kind != "full" or one.commands[0].intent == one.intent
        if one.intent and one.kind == "partial":
            assert one.missing <= set(COMMANDS[one.intent].model_fields)


@pytest.mark.parametrize("name", SETS)
def test_the_gate_lets_through_what_is_meant(name: str) -> None:
    plain, paused = world(added=name != "paper"), world(paused=True)
    for one in ALL[name]:
        if one.kind == "full":
            admit(paused if one.resumes else plain, one.commands)


# -- interpreters


@pytest.mark.parametrize("name", SETS)
def test_one_that_knows_all_is_right_everywhere(name: str) -> None:
    for row, one in zip(rows(name), some(name), strict=True):
        assert row["right"] and not row["wrong"] and not row["wrong reply"], one
        assert row["exact"] == row["proposed"] == (one.kind == "full")
        assert row["ms"] >= 0


def test_one_that_only_asks_is_never_wrong_and_seldom_right() -> None:
    for row in rows("held-out", lambda one: asks()):
        assert not row["wrong"] and not row["proposed"]
        assert row["right"] == (row["kind"] in ("ambiguous", "none"))
    for row, one in zip(rows("paper", lambda one: asks()), some("paper"), strict=True):
        assert row["right"] == (one.kind == "ambiguous" and one.open)


@pytest.mark.parametrize("name", SETS)
def test_one_that_always_does_the_same_is_wrong_wherever_it_was_not_meant(name: str) -> None:
    cancel = cancels().commands
    for row, one in zip(rows(name, lambda one: cancels()), some(name), strict=True):
        assert row["wrong"] == (one.commands != cancel)
        assert row["right"] == (not row["wrong"])
        assert not row["acted"]


def test_one_that_loses_the_delivery_is_wrong_though_the_intent_is_right() -> None:
    def to_b(one: Utterance) -> Reply:
        moved = [c.model_copy(update={"delivery_point": "b"}) for c in one.commands]
        return complete(*moved)

    said = [one for one in heldout() if one.kind == "full" and one.intent == "add_task"][:8]
    for row, one in zip(score(Fake(said, to_b), said), said, strict=True):
        meant = {getattr(command, "delivery_point", None) for command in one.commands}
        assert row["exact"] == row["right"] == (not row["wrong"]) == (meant == {"b"})
        assert row["taken for"] == "add_task"


def one_of(kind: str, intent: str) -> Utterance:
    return next(one for one in heldout() if (one.kind, one.intent) == (kind, intent))


def test_a_pause_that_nobody_asked_for_was_acted_on() -> None:
    pause = complete(parse({"intent": "pause_robot", "parameters": {"robot": "robot1"}}))
    one = one_of("ambiguous", "add_task")
    for plain in (False, True):
        verdict = judge(Fake([one], lambda _: replace(pause, plain=plain)), one, LIVE)  # noqa: B023
        assert verdict.wrong and verdict.acted == plain


def test_the_status_is_a_fair_answer_to_some_questions_only() -> None:
    status = complete(parse({"intent": "query_status"}))
    fair, unfair = one_of("none", "query_status"), one_of("none", "")
    assert judge(Fake([fair], lambda _: status), fair, LIVE).right
    verdict = judge(Fake([unfair], lambda _: status), unfair, LIVE)
    assert verdict.wrong and verdict.told and not verdict.right and not verdict.acted


def test_what_the_gate_refuses_is_no_proposal() -> None:
    far = {"location": [99, 1], "delivery_point": "b"}
    reply = complete(parse({"intent": "add_task", "parameters": far}))
    one = one_of("ambiguous", "add_task")
    verdict = judge(Fake([one], lambda _: reply), one, LIVE)
    assert verdict.wrong_reply and verdict.complete
    assert not verdict.proposed and not verdict.wrong and verdict.right


def test_asking_for_more_than_is_missing_is_not_right() -> None:
    one = one_of("partial", "add_task")
    both = lambda _: asks("add_task", "location", "delivery_point")  # noqa: E731
    assert one.missing < {"location", "delivery_point"}
    assert not judge(Fake([one], both), one, LIVE).right


def test_an_instruction_needs_the_right_intent_or_none_where_none_can_be_told() -> None:
    said = instructions()
    clear = next(one for one in said if one.kind == "full")
    vague = next(one for one in said if one.kind != "full" and not one.open)
    open_ = next(one for one in said if one.open)
    table = [
        (clear, asks(clear.intent), True),
        (clear, asks(), False),
        (vague, asks(vague.intent), True),
        (vague, asks(), False),
        (vague, cancels(), False),
        (open_, asks(), True),
        (open_, asks("undo"), False),
    ]
    for one, reply, right in table:
        verdict = judge(Fake([one], lambda _, reply=reply: reply), one, LIVE)
        assert paper_right(verdict, one) == right


def test_a_dropped_dialogue_leaves_nothing_open() -> None:
    one = next(one for one in dialogues() if one.kind == "none" and one.turns[-1] != "No.")
    assert judge(Fake([one]), one, LIVE).right
    assert not judge(Fake([one], lambda _: asks("add_task", "location")), one, LIVE).right


# -- what means the same


def obstacle(points: str, kind: str | None = None) -> Command:
    told = {"obstacle_location": json.loads(points), "obstacle_type": kind}
    return parse({"intent": "obstacle_update", "parameters": told})


def alike(got: Command, meant: Command, *, kinds: bool = True) -> bool:
    return same([got], [meant], LIVE, kinds=kinds)


def test_corners_may_begin_anywhere_and_go_either_way() -> None:
    square = obstacle("[[1, 8], [2, 8], [2, 9], [1, 9]]")
    assert alike(obstacle("[[2, 9], [2, 8], [1, 8], [1, 9]]"), square)
    assert alike(obstacle("[[1, 8], [2, 8], [2, 9], [1, 9], [1, 8]]"), square)
    assert not alike(obstacle("[[1, 8], [2, 9], [2, 8], [1, 9]]"), square)
    assert not alike(obstacle("[[1, 8], [2, 9]]"), square)


def test_the_kind_of_an_obstacle_may_get_lost_but_not_change() -> None:
    line = "[[1, 8], [2, 8]]"
    pallet, plain = obstacle(line, "pallet"), obstacle(line)
    assert alike(obstacle(line, "wooden Pallet"), pallet)
    assert not alike(plain, pallet) and alike(plain, pallet, kinds=False)
    assert alike(obstacle(line, "barrier"), plain)
    assert not alike(obstacle(line, "bush"), pallet, kinds=False)
    assert not alike(obstacle(line, "bush"), plain, kinds=False)


def test_defaults_may_be_said_and_order_does_not_matter() -> None:
    plain = {"location": [3, 8], "delivery_point": "c"}
    add = parse({"intent": "add_task", "parameters": plain})
    said = {**plain, "delivery_point": "C", "priority": "normal", "task_type": "normal"}
    assert alike(parse({"intent": "add_task", "parameters": said}), add)
    assert not alike(parse({"intent": "add_task", "parameters": {**plain, "priority": "low"}}), add)
    (cancel,) = cancels().commands
    assert same([cancel, add], [add, cancel], LIVE, kinds=True)
    assert not same([add], [add, cancel], LIVE, kinds=True)
    assert not same([add, cancel], [add], LIVE, kinds=True)


# -- the study


def test_table_figure_and_finding() -> None:
    chosen = study("language")
    measured = [row for name in SETS for row in rows(name)]
    measured.append({"set": "first call", "ms": 5.0, "loading ms": 50.0})
    read = {row["what"]: row for row in table(measured)}
    main = read[TITLES["held-out"]]
    assert main["right [%]"] == main["intent right [%]"] == main["slots exact [%]"] == 100
    assert main["wrong proposals [%]"] == main["needless questions [%]"] == 0
    assert main["ambiguous asked about [%]"] == 100
    assert f"{TITLES['held-out']}: family {some('held-out')[0].family}" in read
    assert markdown(list(read.values()))
    chosen.plot(measured).canvas.draw()
    text = chosen.finding(measured)
    assert "Wrong proposals: 0 to" in text and "nan" not in text


def test_the_confusion_matrix_counts_intents_and_proposals() -> None:
    meant, taken, counts = confusion(rows("held-out", lambda one: cancels()))
    said = some("held-out")
    assert counts.sum() == len(said) == counts[:, taken.index("cancel_task")].sum()
    clear = sum(one.kind in ("full", "partial") for one in said)
    assert counts[: len(COMMANDS)].sum() == clear
    assert counts[meant.index("(no command)")].sum() == sum(one.kind == "none" for one in said)


def test_a_quick_study_is_a_part_of_the_whole() -> None:
    quick, whole = study("language").cases(True, 3), study("language").cases(False, 3)
    assert {case.key for case in quick} & {case.key for case in whole} == {"first-0"}
    assert len(whole) == len(SETS) + 3 > len(quick)


def test_another_interpreter_can_be_judged() -> None:
    from oath.bench.language import measure

    here = f"{__name__}:Silent"
    judged = measure("paper", here, 30)
    assert len(judged) == 3 and not any(row["proposed"] for row in judged)


class Silent(Fake):
    def __init__(self) -> None:
        super().__init__([replace(one, turns=("",)) for one in ()])
