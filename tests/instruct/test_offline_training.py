"""What the offline interpreter is trained on, and that its weights are made of that."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from oath.bench.utterances import dialogues, heldout, validation, world
from oath.commands import COMMANDS, Live, admit
from oath.instruct import Dialogue
from oath.instruct.offline import Offline
from oath.instruct.offline.model import NAMES, models
from oath.instruct.offline.names import Names
from oath.training.said import asides, corrected, said
from oath.training.said import worlds as both_worlds
from oath.training.templates import GATED, concepts, drawn, lines
from oath.training.train import digest, fit, understanding


@cache
def live() -> Live:
    return world()


@pytest.fixture(scope="module", autouse=True)
def _world_goes() -> Iterator[None]:
    yield
    live.cache_clear()


def folded(text: str) -> str:
    return re.sub(r"\W+", " ", text.casefold()).strip()


def test_nothing_that_is_held_out_is_trained_on() -> None:
    known = {folded(one.turns[-1]) for one in said()}
    for kept in (heldout(), validation()):
        assert sum(folded(one.turns[-1]) in known for one in kept) == 0
    for name in ("heldout-dialogues", "validation-dialogues"):
        assert all(len(one.turns) > 1 for one in dialogues(name))


def test_there_is_much_to_learn_from() -> None:
    known = said()
    assert len(known) > 9000 and len({one.family for one in known}) > 700
    assert {aside.kind for aside in asides()} == {"harmless", "hold"}
    assert {aside.where for aside in asides()} == {"before", "after"}
    assert sum(len(some) for some in concepts(lines()[1]).values()) > 10_000


def test_the_weights_are_made_of_the_data_that_lies_beside_them() -> None:
    assert models().data == digest(), "run python -m oath.training"


def test_training_twice_gives_the_same() -> None:
    some = [one for one in said() if hash_of(one.family) % 40 == 0]
    templates = list(drawn(each=1))[::5]
    first, second = (understanding(some, templates, both_worlds()) for _ in range(2))
    for name in NAMES:
        if name != "clear":
            a, b = getattr(first, name), getattr(second, name)
            assert a.classes == b.classes
            np.testing.assert_array_equal(a.keys, b.keys)
            np.testing.assert_allclose(a.weights, b.weights, atol=1e-6)


def hash_of(text: str) -> int:
    return sum(map(ord, text))


def test_a_fit_tells_classes_apart() -> None:
    rows = [{"a", "x"}, {"b", "x"}] * 20
    told = fit(rows, ["left", "right"] * 20)
    assert told({"a"})["left"] > 0.8 and told({"b", "unheard"})["right"] > 0.8
    assert told({"unheard"}) == pytest.approx({"left": 0.5, "right": 0.5})


def test_a_correction_means_what_was_said_last() -> None:
    changed = list(corrected(said()[:2000], live()))
    assert len(changed) > 30
    assert all(one.commands and one.kind == "full" for one in changed)


def test_most_of_what_must_not_be_acted_on_is_held_back() -> None:
    names, offline = Names.of(live(), models()), Offline()
    gated = [one for one in drawn(seed=11, each=2, world=names) if one.line.intent == GATED]
    acted = [
        one.text
        for one in gated
        if (reply := offline.interpret(Dialogue(said=(one.text,)), live())).status == "complete"
        and reply.intent != "query_status"
    ]
    assert len(gated) > 80 and len(acted) <= 0.03 * len(gated), acted


def test_what_was_said_means_what_is_possible() -> None:
    worlds = both_worlds()
    for one in said()[::12]:
        assert one.intent in {*COMMANDS, ""} and bool(one.missing) == (one.kind == "partial")
        for command in one.commands:
            admit(worlds[one.resumes], [command])
