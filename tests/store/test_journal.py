"""Every journal keeps the contract, broken ones fail it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from journals import ORIGIN, MemoryJournal, event, some

from oath.errors import BadInput
from oath.events import AnyEvent, RobotPaused
from oath.store import Answer, Journal
from oath.store.sqlite import SqliteJournal

# --- The contract ---------------------------------------------------------------------------


def numbers_have_no_gaps(journal: Journal) -> None:
    assert journal.replay() == []
    assert journal.append(some(3)) == range(3)
    assert journal.append([]) == range(3, 3)
    assert journal.append(some(1, 3)) == range(3, 4)


def what_is_stored_comes_back(journal: Journal) -> None:
    events = some(40)
    for i in range(0, 40, 8):
        journal.append(events[i : i + 8])
    assert journal.replay() == events
    for since in (0, 1, 17, 39, 40, 99):
        assert journal.replay(since) == events[since:]


def a_batch_is_stored_whole_or_not_at_all(journal: Journal) -> None:
    journal.append(some(2))
    for bad in (nan, float("inf")):
        with pytest.raises(BadInput):
            journal.append([event(2), RobotPaused(t=bad, robot="r"), event(3)], id="x")
    assert journal.known("x") is None
    assert journal.replay() == some(2)
    assert journal.append(some(1, 2)) == range(2, 3)


def a_command_is_answered_once(journal: Journal) -> None:
    assert journal.known("x") is None
    journal.append(some(2))
    journal.append(some(3, 2), id="x", answer={"ok": [1, 2.5, None, "ü"]})
    first = Answer(range(2, 5), {"ok": [1, 2.5, None, "ü"]})
    assert journal.known("x") == first
    with pytest.raises(BadInput):
        journal.append(some(1, 5), id="x", answer="another")
    assert journal.known("x") == first
    assert journal.replay() == some(5)


def an_answer_needs_no_events(journal: Journal) -> None:
    assert journal.append([], id="question", answer="none") == range(0)
    assert journal.known("question") == Answer(range(0), "none")
    assert journal.known("Question") is None


def an_answer_must_have_json(journal: Journal) -> None:
    for answer in ({1, 2}, nan, object()):
        with pytest.raises(BadInput):
            journal.append(some(1), id="x", answer=answer)
    assert journal.known("x") is None
    assert journal.replay() == []


def closing_twice_does_no_harm(journal: Journal) -> None:
    journal.close()
    journal.close()


CONTRACT: list[Callable[[Journal], None]] = [
    numbers_have_no_gaps,
    what_is_stored_comes_back,
    a_batch_is_stored_whole_or_not_at_all,
    a_command_is_answered_once,
    an_answer_needs_no_events,
    an_answer_must_have_json,
    closing_twice_does_no_harm,
]


@pytest.mark.parametrize("law", CONTRACT, ids=lambda law: law.__name__)
def test_sqlite_keeps(law: Callable[[Journal], None], tmp_path: Path) -> None:
    law(SqliteJournal.create(tmp_path / "a.journal", ORIGIN))


@pytest.mark.parametrize("law", CONTRACT, ids=lambda law: law.__name__)
def test_memory_keeps(law: Callable[[Journal], None]) -> None:
    law(MemoryJournal())


# --- Broken ones ----------------------------------------------------------------------------


class Lossy(MemoryJournal):
    """Forgets the last event of a larger batch."""

    def append(self, events: Sequence[AnyEvent], **command: Any) -> range:
        return super().append(events[:-1] if len(events) > 2 else events, **command)


class Halving(MemoryJournal):
    """Stores the events one by one."""

    def append(self, events: Sequence[AnyEvent], **command: Any) -> range:
        for one in events:
            super().append([one])
        return super().append([], **command)


class Forgetful(MemoryJournal):
    """Does not remember ids."""

    def known(self, id: str) -> Answer | None:
        return None


class Overwriting(MemoryJournal):
    """Gives the latest answer to an id, not the first."""

    def append(
        self, events: Sequence[AnyEvent], *, id: str | None = None, answer: Any = None
    ) -> range:
        self.answers.pop(str(id), None)
        return super().append(events, id=id, answer=answer)


class Late(MemoryJournal):
    """Begins after the event that was asked for."""

    def replay(self, since: int = 0) -> list[AnyEvent]:
        return super().replay(since + 1 if since else 0)


@pytest.mark.parametrize(
    ("broken", "law"),
    [
        (Lossy, numbers_have_no_gaps),
        (Lossy, what_is_stored_comes_back),
        (Halving, a_batch_is_stored_whole_or_not_at_all),
        (Forgetful, a_command_is_answered_once),
        (Overwriting, a_command_is_answered_once),
        (Late, what_is_stored_comes_back),
    ],
)
def test_the_contract_catches_broken_journals(
    broken: Callable[[], Journal], law: Callable[[Journal], None]
) -> None:
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        law(broken())


# --- Any order of calls ---------------------------------------------------------------------

CALLS = st.lists(
    st.tuples(st.integers(0, 4), st.none() | st.sampled_from("abc"), st.booleans()), max_size=12
)


@settings(max_examples=40, deadline=None)
@given(CALLS)
def test_sqlite_does_what_memory_does(
    tmp_path_factory: pytest.TempPathFactory, calls: list[tuple[int, str | None, bool]]
) -> None:
    path = tmp_path_factory.mktemp("journal") / "a.journal"
    told, model = SqliteJournal.create(path, ORIGIN), MemoryJournal()
    for count, id, again in calls:
        if again:
            told.close()
            told = SqliteJournal(path)
        events = some(count, len(model.events))
        outcomes: list[object] = []
        for journal in (told, model):
            try:
                outcomes.append(journal.append(events, id=id, answer=count))
            except BadInput:
                outcomes.append(BadInput)
        assert outcomes[0] == outcomes[1]
        assert told.replay() == model.replay()
        assert [told.known(id) for id in "abc"] == [model.known(id) for id in "abc"]
    told.close()
