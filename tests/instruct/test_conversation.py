"""Only what was read back and confirmed happens: once, in time, in the world it was made for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest

import oath
from missions import delivery, robot, visit, yard
from oath.commands import Command, Live, parse
from oath.errors import BadInput
from oath.events import Commanded, TaskAdded
from oath.instruct import Dialogue, Reply
from oath.instruct.conversation import LENGTH, NO, YES, Conversation
from oath.runtime import Runtime


def command(intent: str, **parameters: object) -> Command:
    return parse({"intent": intent, "parameters": parameters})


ADD = command(
    "add_task", location=[2, 8], delivery_point="dock", task_type="carry", task_label="new"
)
CANCEL = command("cancel_task", task_label="a")
PAUSE = command("pause_robot", robot="r1")


class Parrot:
    """Understands what it was told beforehand, and remembers what it was asked."""

    def __init__(self, **known: Reply | Sequence[Command]) -> None:
        self.known, self.heard = known, list[Dialogue]()

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        self.heard.append(dialogue)
        meant = self.known.get(dialogue.said[-1])
        if meant is None:
            return Reply(status="clarification", message="What do you mean?")
        if isinstance(meant, Reply):
            return meant
        return Reply(
            status="complete",
            message="",
            intent=meant[0].intent,
            commands=tuple(meant),
            plain=True,
        )


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def runtime() -> Runtime:
    mission = yard(
        [robot("r1", (1, 1)), robot("r2", (9, 1))],
        [delivery("a", (1, 9), (5, 9)), visit("b", (9, 9))],
    )
    running = oath.prepare(replace(mission, places={"dock": (5.0, 5.0)}), points=100)
    running.start()
    running.advance(1.0)
    return running


Talk = Callable[..., Conversation]


@pytest.fixture
def talk(runtime: Runtime) -> Talk:
    def begin(clock: Clock | None = None, **known: Reply | Sequence[Command]) -> Conversation:
        return Conversation(
            Parrot(**known),
            runtime.live,
            lambda commands: runtime.command(commands, "operator"),
            preview=runtime.preview,
            clock=clock or Clock(),
        )

    return begin


def happened(runtime: Runtime) -> list[str]:
    return [e.command["intent"] for e in runtime.events if isinstance(e, Commanded)]


def test_a_proposal_is_read_back_with_its_effect_and_waits(runtime: Runtime, talk: Talk) -> None:
    answer = talk(add=[ADD]).say("add")
    assert answer.proposal is not None
    assert answer.proposal.says == ("adds task new at (2.0, 8.0), delivery dock, carry",)
    assert "r1 or r2 can do new" in answer.proposal.effect
    assert any("route grows by" in line for line in answer.proposal.effect)
    assert answer.reply.message.endswith("Confirm?")
    assert happened(runtime) == []


@pytest.mark.parametrize("yes", sorted(YES))
def test_a_plain_yes_confirms_what_was_just_read_back(
    runtime: Runtime, talk: Talk, yes: str
) -> None:
    conversation = talk(add=[ADD])
    conversation.say("add")
    answer = conversation.say(f" {yes.upper()}! ")
    assert answer.done and answer.reply.message.startswith("Done: adds task new")
    assert happened(runtime) == ["add_task"]
    assert any(isinstance(event, TaskAdded) for event in runtime.events)


def test_a_yes_out_of_the_blue_confirms_nothing(runtime: Runtime, talk: Talk) -> None:
    conversation = talk(add=[ADD])
    conversation.say("yes")
    conversation.say("add")
    conversation.say("hm")  # something else was said meanwhile
    assert not conversation.say("yes").done
    assert happened(runtime) == []


@pytest.mark.parametrize("no", sorted(NO))
def test_a_no_drops_it(runtime: Runtime, talk: Talk, no: str) -> None:
    conversation = talk(add=[ADD])
    conversation.say("add")
    assert conversation.say(no).reply.message == "Dropped; nothing changed."
    assert conversation.pending is None
    assert not conversation.say("yes").done
    assert happened(runtime) == []


def test_a_proposal_is_confirmed_once_and_by_its_own_id(runtime: Runtime, talk: Talk) -> None:
    conversation = talk(add=[ADD], cancel=[CANCEL])
    first = conversation.say("add").proposal
    second = conversation.say("cancel").proposal
    assert first is not None and second is not None and first.id != second.id
    with pytest.raises(BadInput, match="no such proposal"):
        conversation.confirm(first.id)
    conversation.confirm(second.id)
    with pytest.raises(BadInput, match="no such proposal"):
        conversation.confirm(second.id)
    assert happened(runtime) == ["cancel_task"]


def test_a_proposal_expires(runtime: Runtime, talk: Talk) -> None:
    clock = Clock()
    conversation = talk(clock, add=[ADD])
    proposal = conversation.say("add").proposal
    assert proposal is not None
    clock.now = 121.0
    with pytest.raises(BadInput, match="expired"):
        conversation.confirm(proposal.id)
    assert happened(runtime) == []


def test_a_proposal_holds_for_its_world_only(runtime: Runtime, talk: Talk) -> None:
    conversation = talk(add=[ADD])
    proposal = conversation.say("add").proposal
    assert proposal is not None
    runtime.command([CANCEL], "somebody else")
    with pytest.raises(BadInput, match="has changed"):
        conversation.confirm(proposal.id)
    conversation.say("add")
    runtime.command([PAUSE], "somebody else")
    again = conversation.say("yes")  # in words it is read back anew, and confirmed then
    assert "has changed" in again.reply.message and not again.done
    assert conversation.say("yes").done
    assert happened(runtime) == ["cancel_task", "pause_robot", "add_task"]


def test_what_makes_things_safer_is_done_at_once(runtime: Runtime, talk: Talk) -> None:
    answer = talk(stop=[PAUSE]).say("stop")
    assert answer.done == (PAUSE,) and answer.proposal is None
    assert runtime.state.paused == {"r1"}
    both = talk(both=[CANCEL, command("pause_robot", robot="r2")]).say("both")
    assert runtime.state.paused == {"r1", "r2"}
    assert both.proposal is not None and both.proposal.commands == (CANCEL,)


def test_what_is_not_plainly_said_is_read_back_even_if_it_is_safer(
    runtime: Runtime, talk: Talk
) -> None:
    wordy = Reply(status="complete", message="", intent="pause_robot", commands=(PAUSE,))
    speaking = talk(wordy=wordy)
    answer = speaking.say("wordy")
    assert answer.proposal is not None and not answer.done
    assert not runtime.state.paused
    speaking.say("yes")
    assert runtime.state.paused == {"r1"}


def test_several_commands_are_read_back_and_happen_together(runtime: Runtime, talk: Talk) -> None:
    raised = command("change_task_priority", task_label="new")
    conversation = talk(both=[ADD, raised])
    answer = conversation.say("both")
    assert answer.proposal is not None
    assert answer.proposal.says[1] == "changes the priority of task new from normal to high"
    conversation.say("yes")
    assert runtime.state.tasks["new"].priority == "high"
    assert talk(both=[ADD, CANCEL]).say("both").proposal is None  # `new` exists now: neither
    assert "a" in runtime.state.tasks


def test_what_the_world_forbids_is_asked_for_anew(talk: Talk) -> None:
    outside = command("add_task", location=[50, 8], delivery_point="dock", task_type="carry")
    conversation = talk(add=[outside])
    answer = conversation.say("add")
    assert answer.proposal is None and answer.reply.status == "clarification"
    assert "outside the map" in answer.reply.message
    assert answer.reply.missing == ("location",)
    conversation.say("hm")
    parrot = conversation._interpreter
    assert isinstance(parrot, Parrot)
    draft = parrot.heard[-1].draft
    assert draft is not None and (draft.intent, draft.missing) == ("add_task", ("location",))


def test_a_question_is_remembered_until_it_is_dropped(talk: Talk) -> None:
    where = Reply(
        status="need_more_info",
        message="Where to?",
        intent="add_task",
        parameters={"location": [2, 8]},
        missing=("delivery_point",),
    )
    conversation = talk(where=where)
    conversation.say("where")
    conversation.say("what?")
    conversation.say("hello")
    parrot = conversation._interpreter
    assert isinstance(parrot, Parrot)
    asked, dropped = parrot.heard[1].draft, parrot.heard[2].draft
    assert asked is not None and asked.parameters == {"location": [2, 8]}
    assert dropped is None


def test_only_so_much_is_listened_to(talk: Talk) -> None:
    conversation = talk()
    conversation.say("a\0b\x1b[31m" + "x" * 10_000)
    parrot = conversation._interpreter
    assert isinstance(parrot, Parrot)
    heard = parrot.heard[0].said[0]
    assert heard.startswith("a b [31mx") and len(heard) == LENGTH


def test_what_the_operator_must_hear_is_said_whatever_becomes_of_the_words(talk: Talk) -> None:
    note = "(The language model is away.)"
    understood = Reply(status="complete", message="", commands=(CANCEL,), note=note)
    asked = Reply(status="clarification", message="What do you mean?", note=note)
    speaking = talk(cancel=understood, huh=asked)
    for words in ("cancel", "huh"):
        message = speaking.say(words).reply.message
        assert message.startswith(note)
        assert len(message) > len(note) + 10


def test_interpreting_may_last_while_the_conversation_goes_on(runtime: Runtime, talk: Talk) -> None:
    speaking = talk(add=[ADD], cancel=[CANCEL], stop=[PAUSE])
    speaking.say("cancel")
    slow = speaking.hear("add")
    assert callable(slow)
    # A yes that comes meanwhile means nothing that was read back before.
    assert speaking.say("yes").done == ()
    assert [command.intent for command in speaking.say("stop").done] == ["pause_robot"]
    answer = speaking.take(slow())
    assert answer.proposal is not None
    assert happened(runtime) == ["pause_robot"]
    assert speaking.say("yes").done == answer.proposal.commands


def test_what_was_done_at_once_can_be_corrected(talk: Talk) -> None:
    conversation = talk(stop=[PAUSE])
    conversation.say("stop")
    conversation.say("I mean r2")
    parrot = conversation._interpreter
    assert isinstance(parrot, Parrot)
    draft = parrot.heard[-1].draft
    assert draft is not None and (draft.intent, draft.parameters) == (
        "pause_robot",
        {"robot": "r1"},
    )


def test_a_question_between_leaves_a_proposal_to_its_id_alone(runtime: Runtime, talk: Talk) -> None:
    conversation = talk(add=[ADD], status=[command("query_status")])
    proposal = conversation.say("add").proposal
    assert proposal is not None
    assert "tasks are done" in conversation.say("status").reply.message
    assert not conversation.say("yes").done or happened(runtime) == []
    again = conversation.say("add").proposal
    assert again is not None
    conversation.say("status")
    conversation.confirm(again.id)
    assert happened(runtime) == ["add_task"]
