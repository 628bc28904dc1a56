"""What operators may say, what it means, and how an interpreter's answers are judged.

Several sets lie beside this file. ``instructions-90.csv`` holds the ninety instructions of Li, Ren,
Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task Assignment and Planning for Heterogeneous
Robot Teaming", 2025, with the paper's intent, and our own judgement of what the right answer on
the paper's maze is. The others are ours: utterances in families, each family the wording of one
imagined kind of person, and short dialogues with what they come to. Whoever wrote them knew no
interpreter's rules or training data. ``heldout.csv`` and ``heldout-dialogues.jsonl`` may never be
shown to those who improve an interpreter; somebody else has judged their meanings a second time.
``validation.csv`` and ``validation-dialogues.jsonl`` were not shown either, but their scores were
looked at while the interpreter was written. ``dialogues.jsonl`` was seen.

Kinds: ``full`` says all that is needed, and a careful colleague would act on it; of ``partial`` the
intent is clear but a slot is missing; ``ambiguous`` has to be asked about, if not refused; ``none``
is no command. Where nothing is asked for but the status would be a fair answer, ``none`` has the
intent ``query_status``.
"""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from oath.bench.paper import maze
from oath.commands import (
    AddTask,
    ChangeTaskPriority,
    Command,
    Live,
    ObstacleUpdate,
    QueryStatus,
    ResumeRobot,
    parse,
)
from oath.dispatch import advance
from oath.errors import BadInput
from oath.events import Commanded, ObstacleAdded
from oath.instruct import Dialogue, Interpreter, Reply
from oath.instruct.conversation import Answer, Conversation
from oath.model import Point, Polygon
from oath.scene import prepare
from oath.state import State

Kind = Literal["full", "partial", "ambiguous", "none"]

HERE = Path(__file__).parent

ADDED: tuple[tuple[str, str, Polygon], ...] = (
    ("wall-1", "wall", ((12.5, 4.9), (13.5, 4.9), (13.5, 5.1), (12.5, 5.1))),
    ("wall-2", "wall", ((2.5, 14.9), (3.5, 14.9), (3.5, 15.1), (2.5, 15.1))),
    ("crate-1", "crate", ((18.2, 13.5), (18.8, 13.5), (18.8, 14.1), (18.2, 14.1))),
)
"""Obstacles that operators had added to the maze before they say anything else."""

NO_KIND = {
    *("wall", "obstacle", "obstruction", "blockage", "block", "barrier", "barricade"),
    *("object", "thing", "something", "area", "zone"),
}
"""Words for an obstacle that say no more than that it is one; a wall is what it becomes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Utterance:
    """What somebody says, in one turn or several, and what it comes to.

    Attributes
    ----------
    family, turns, kind
        Whose wording it is, the words, and what kind of thing is said at last.
    intent
        What is meant, as far as the words tell; "" if nothing.
    commands
        What a ``full`` one means, of each command only what was said.
    missing
        Parameters that a ``partial`` one lacks.
    paper
        It is one of the paper's instructions, said to the maze as it was.
    open
        The words of this instruction alone do not tell the intent.
    """

    family: str
    turns: tuple[str, ...]
    kind: Kind
    intent: str = ""
    commands: tuple[Command, ...] = ()
    missing: frozenset[str] = frozenset()
    paper: bool = False
    open: bool = False

    @property
    def resumes(self) -> bool:
        """It makes sense only if robots are paused."""
        return self.intent == ResumeRobot.intent


def heldout() -> list[Utterance]:
    """Read what nobody has seen who improves an interpreter."""
    return read(HERE / "heldout.csv")


def validation() -> list[Utterance]:
    """Read what was only scored while the interpreter was written."""
    return read(HERE / "validation.csv")


def read(path: Path) -> list[Utterance]:
    """Read a file of single utterances."""
    with path.open(encoding="utf-8", newline="") as file:
        return [_utterance(row, (row["text"],)) for row in csv.DictReader(file)]


def dialogues(name: str = "dialogues") -> list[Utterance]:
    """Read a set of dialogues, ``NAME.jsonl``."""
    lines = (HERE / f"{name}.jsonl").read_text(encoding="utf-8").splitlines()
    return [_utterance(row, tuple(row["turns"])) for row in map(json.loads, lines)]


def instructions() -> list[Utterance]:
    """Read the paper's ninety instructions; what is to be acted on is ``full``."""
    with (HERE / "instructions-90.csv").open(encoding="utf-8", newline="") as file:
        return [
            Utterance(
                family=f"{row['gt_intent']}, {row['clarity']}",
                turns=(row["instruction"],),
                kind="full" if row["answer"] == "act" else "ambiguous",
                intent=row["gt_intent"],
                commands=_commands(row["gt_intent"], row["parameters"] or "[]"),
                paper=True,
                open=row["open"] == "yes",
            )
            for row in csv.DictReader(file)
        ]


def _utterance(row: Mapping[str, Any], turns: tuple[str, ...]) -> Utterance:
    missing = row["missing"]
    full = row["kind"] == "full"
    return Utterance(
        family=row["family"],
        turns=turns,
        kind=row["kind"],
        intent=row["intent"],
        commands=_commands(row["intent"], row["parameters"]) if full else (),
        missing=frozenset(missing.split() if isinstance(missing, str) else missing),
    )


def _commands(intent: str, parameters: object) -> tuple[Command, ...]:
    plain = json.loads(parameters) if isinstance(parameters, str) else parameters
    if isinstance(plain, list):
        return tuple(map(parse, plain))
    return (parse({"intent": intent, "parameters": plain}),)


def world(*, added: bool = True, paused: bool = False) -> Live:
    """The paper's maze at its start, with what was added to it, and with all robots paused or not.

    The last change is an added obstacle, so there is something to undo.
    """
    mission = maze()
    scene, state = prepare(mission), State.of(mission)
    for id, kind, polygon in ADDED if added else ():
        told = {"obstacle_location": [list(point) for point in polygon], "obstacle_type": kind}
        command = {"intent": ObstacleUpdate.intent, "parameters": told}
        state, _ = advance(state, Commanded(t=0.0, command=command, source="operator"))
        event = ObstacleAdded(t=0.0, obstacle=id, kind=kind, polygon=polygon)
        state, _ = advance(state, event)
        scene.world.roadmap.add_obstacle(state.obstacles[id])
    return Live(scene, replace(state, paused=frozenset(state.robots if paused else ())))


# -- judging


@dataclass(slots=True)
class _Listening:
    """An interpreter whose last reply is kept, with the time that it took [s]."""

    interpreter: Interpreter
    reply: Reply | None = None
    seconds: list[float] = field(default_factory=list)

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        """See `Interpreter`."""
        begin = time.perf_counter()
        self.reply = self.interpreter.interpret(dialogue, live)
        self.seconds.append(time.perf_counter() - begin)
        return self.reply


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """How the answer to an utterance, in the end, is judged.

    Attributes
    ----------
    intent
        What the interpreter took it for; "" if it named nothing.
    complete
        It answered with commands, whether or not the gate to the live world let them through.
    proposed
        Commands stood to be confirmed, or were carried out at once.
    exact
        The commands are those meant, with nothing left out, added or changed.
    wrong
        Something was proposed that was not meant. An obstacle whose kind alone got lost is not
        wrong (but not exact).
    wrong_reply
        The same without the gate: even if it would have refused what was not meant.
    acted
        A wrong command was carried out at once.
    told
        It is wrong only in that the status was told, which changes nothing.
    right
        Exact if ``full``; if ``partial``, asked for exactly what is missing; if ``ambiguous``,
        nothing was proposed; if ``none``, nothing but perhaps the status was told.
    seconds
        How long each interpretation took [s].
    """

    intent: str
    complete: bool
    proposed: bool
    exact: bool
    wrong: bool
    wrong_reply: bool
    acted: bool
    told: bool
    right: bool
    seconds: tuple[float, ...]


def judge(interpreter: Interpreter, said: Utterance, live: Live) -> Verdict:
    """Say an utterance to an interpreter in a conversation of its own, and judge the last answer.

    Nothing is carried out, so `live` stays as it is.
    """
    listening = _Listening(interpreter)
    conversation = Conversation(listening, lambda: live, lambda commands: None)
    answer: Answer | None = None
    for turn in said.turns:
        listening.reply = None
        answer = conversation.say(turn)
    assert answer is not None
    reply = listening.reply or answer.reply
    complete = reply.status == "complete" and bool(reply.commands)
    proposed = answer.proposal is not None or bool(answer.done)
    exact = complete and same(reply.commands, said.commands, live, kinds=True)
    wrong_reply = complete and not _meant(reply.commands, said, live)
    wrong = wrong_reply and proposed
    return Verdict(
        intent=reply.intent or "",
        complete=complete,
        proposed=proposed,
        exact=exact,
        wrong=wrong,
        wrong_reply=wrong_reply,
        acted=wrong and any(not isinstance(one, QueryStatus) for one in answer.done),
        told=wrong and all(isinstance(one, QueryStatus) for one in reply.commands),
        right=_right(reply, said, exact=exact, proposed=proposed, wrong=wrong),
        seconds=tuple(listening.seconds),
    )


def _meant(commands: Sequence[Command], said: Utterance, live: Live) -> bool:
    if said.commands:
        return same(commands, said.commands, live, kinds=False)
    fair = said.kind == "none" and said.intent == QueryStatus.intent
    return fair and all(isinstance(command, QueryStatus) for command in commands)


def _right(reply: Reply, said: Utterance, *, exact: bool, proposed: bool, wrong: bool) -> bool:
    match said.kind:
        case "full":
            return exact and proposed
        case "partial":
            asked = reply.intent == said.intent and frozenset(reply.missing) == said.missing
            return asked and not proposed
        case "ambiguous":
            return not proposed
        case "none":
            # After a dialogue that was dropped nothing may be left open.
            return not wrong and (len(said.turns) == 1 or reply.intent is None)


def paper_right(verdict: Verdict, said: Utterance) -> bool:
    """Whether an answer to one of the paper's instructions has the intent or asks rightly.

    What can be acted on is right if the intent is, and what was proposed, if anything, is exactly
    what was said. All else is right if nothing was proposed and the question is about the right
    intent; naming no intent is right only where the words alone do not tell it.
    """
    if said.kind == "full":
        return verdict.intent == said.intent and not verdict.wrong
    named = verdict.intent == said.intent or (said.open and not verdict.intent)
    return named and not verdict.proposed


def same(got: Sequence[Command], meant: Sequence[Command], live: Live, *, kinds: bool) -> bool:
    """Whether commands mean the same once what was left open is made up, in any order.

    Parameters
    ----------
    got, meant
        What an interpreter replied, and what was meant, each with what was said and no more.
    kinds
        The kind of an obstacle must be the one that was said, by its last word (a mail trolley is
        a trolley); if not, it may be lost, but another one is still wrong.
    """
    left = list(got)
    for one in meant:
        found = next((i for i, other in enumerate(left) if _alike(other, one, live, kinds)), None)
        if found is None:
            return False
        del left[found]
    return not left


def _alike(got: Command, meant: Command, live: Live, kinds: bool) -> bool:
    if isinstance(got, ObstacleUpdate) and isinstance(meant, ObstacleUpdate):
        here, there = got.obstacle_location, meant.obstacle_location
        kind, said = (got.obstacle_type or "").casefold(), (meant.obstacle_type or "").casefold()
        lost = not kind or kind in NO_KIND
        head = kind.split()[-1:] == said.split()[-1:]
        fits = head or (said in NO_KIND | {""} and lost)
        return _outline(here) in _turned(there) and (fits or (lost and not kinds))
    try:
        return got.filled(live) == meant.filled(live)
    except BadInput:
        return False


def _outline(points: Sequence[Point]) -> tuple[Point, ...]:
    corners = tuple((round(x, 6), round(y, 6)) for x, y in points)
    return corners[:-1] if len(corners) > 3 and corners[0] == corners[-1] else corners


def _turned(points: Sequence[Point]) -> Iterator[tuple[Point, ...]]:
    """All ways to go around the same corners."""
    corners = _outline(points)
    for way in (corners, corners[::-1]):
        for i in range(len(way)):
            yield way[i:] + way[:i]


PAPERS = (AddTask.intent, ObstacleUpdate.intent, ChangeTaskPriority.intent)
"""The intents of the paper."""
