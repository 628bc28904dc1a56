"""Commands that listen: `interpret`, `chat`, and what a script says during `run`."""

from __future__ import annotations

import queue
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from oath.cli.options import (
    allocator_option,
    budget_option,
    examples,
    interpreter_options,
    json_option,
    mission_argument,
    points_option,
    seed_option,
    weight_option,
)

if TYPE_CHECKING:
    from oath.commands import Command
    from oath.formats.script import Entry
    from oath.instruct import Interpreter, Reply
    from oath.instruct.conversation import Answer, Conversation
    from oath.runtime import Runtime

LINE = 20_000
"""Longest line that is read whole from a terminal or pipe [characters]."""


@click.command(
    epilog=examples(
        "echo 'new task at (5, 19.5), take it to c' | oath interpret missions/maze-25.yaml --json",
        "oath interpret missions/maze-25.yaml --dialogue < dialogue.txt",
    )
)
@mission_argument
@click.option("--dialogue", is_flag=True, help="The lines are turns of one dialogue.")
@seed_option
@points_option(1000)
@interpreter_options
@json_option
def interpret(
    mission: Path,
    dialogue: bool,
    seed: int,
    points: int,
    interpreter: Callable[[], Interpreter],
    as_json: bool,
) -> None:
    """Interpret instructions from stdin, one a line; nothing is carried out without a yes.

    With --json, every line gives one JSON object: status, intent, parameters, missing, message.
    """
    import json

    import oath

    runtime = oath.prepare(oath.load(mission), seed=seed, points=points)
    listener = interpreter()
    runtime.start()
    conversation = _conversation(runtime, listener)
    for line in _lines(sys.stdin):
        if not dialogue:  # nothing that one line says is carried out for the next
            conversation = _conversation(runtime, listener, carry_out=lambda commands: None)
        answer = conversation.say(line)
        if as_json:
            click.echo(json.dumps(_plain(answer.reply), ensure_ascii=False, allow_nan=False))
        else:
            click.echo(answer.reply.message)


def _plain(reply: Reply) -> dict[str, Any]:
    plain: dict[str, Any] = {
        "status": reply.status,
        "intent": reply.intent,
        "parameters": dict(reply.parameters),
        "missing": list(reply.missing),
        "message": reply.message,
    }
    if len(reply.commands) > 1:
        from oath.commands import to_plain

        plain["commands"] = [to_plain(command) for command in reply.commands]
    return plain


@click.command(
    epilog=examples("oath chat missions/maze-25.yaml", "oath chat missions/office.yaml --speed 5")
)
@mission_argument
@allocator_option
@weight_option
@budget_option
@seed_option
@points_option(1000)
@click.option(
    "--speed",
    default=1.0,
    show_default=True,
    type=click.FloatRange(0.01, 1000),
    help="Mission seconds per second.",
)
@interpreter_options
def chat(
    mission: Path,
    allocator: str,
    makespan_weight: float | None,
    budget: float | None,
    seed: int,
    points: int,
    speed: float,
    interpreter: Callable[[], Interpreter],
) -> None:
    """Run a mission live and talk to it in the terminal; end with an empty line or Ctrl-D.

    What is proposed is carried out after a yes; a plain pause takes effect at once.
    """
    import oath

    runtime = oath.prepare(
        oath.load(mission),
        allocator=allocator,
        makespan_weight=makespan_weight,
        seconds=budget or 0.05,
        seed=seed,
        points=points,
    )
    conversation = _conversation(runtime, interpreter())
    runtime.start()
    begin, told = time.monotonic(), 0
    click.echo(f"{runtime.scene.mission.name} runs. Say what has changed, or ask for the status.")
    for line in _typed():
        runtime.advance((time.monotonic() - begin) * speed)
        told = _tell_news(runtime, told)
        if line is None:
            continue
        if line.strip().casefold() in ("", "quit", "exit"):
            break
        click.echo(f"[{runtime.now:.1f} s] {conversation.say(line).reply.message}")
    summary = runtime.finish().summary
    click.echo(
        f"stopped at {runtime.now:.1f} s with {summary['completed']} of {summary['tasks']} tasks "
        "done"
    )


def _typed() -> Iterator[str | None]:
    """Yield lines from stdin as they come, and None while there is none."""
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def read() -> None:
        for line in _lines(sys.stdin):
            lines.put(line)
        lines.put(None)

    threading.Thread(target=read, daemon=True).start()
    while True:
        try:
            line = lines.get(timeout=0.05)
        except queue.Empty:
            yield None
            continue
        if line is None:
            return
        yield line


def _tell_news(runtime: Runtime, told: int) -> int:
    """Print what an operator wants to know of the events since; return how many there are."""
    from oath.events import ObstacleFound, RobotFailed, StopServed

    for event in runtime.events[told:]:
        match event:
            case StopServed(stop="delivery" | "visit"):
                left = len(runtime.state.tasks) - len(runtime.state.completed)
                news = f"{event.robot} has done {event.task}; {left} tasks are left"
            case ObstacleFound():
                news = f"{event.robot} found {event.obstacle}"
            case RobotFailed():
                news = f"{event.robot} failed"
            case _:
                continue
        click.echo(f"[{event.t:.1f} s] {news}")
    return len(runtime.events)


def acts(
    runtime: Runtime, entries: Iterable[Entry], interpreter: Callable[[], Interpreter]
) -> list[tuple[float, Callable[[], None]]]:
    """Return what a script does in a mission, and when [s]; every answer goes to stderr.

    Raises
    ------
    BadInput
        If an entry is no command.
    """
    from functools import partial

    steps = [(entry, _command(entry)) for entry in entries]
    if not steps:
        return []
    conversation = _conversation(runtime, interpreter())
    return [
        (entry.at, partial(_act, runtime, conversation, entry, command)) for entry, command in steps
    ]


def _command(entry: Entry) -> Command | None:
    from oath.commands import parse
    from oath.errors import BadInput

    try:
        return None if entry.do is None else parse(entry.do)
    except BadInput as error:
        where = entry.where
        raise BadInput(error.problem, file=where, field=error.field, remedy=error.remedy) from None


def _act(
    runtime: Runtime, conversation: Conversation, entry: Entry, command: Command | None
) -> None:
    if command is not None:
        _report(runtime, command.intent, answer := conversation.propose([command]))
    else:
        _report(runtime, str(entry.say), answer := conversation.say(str(entry.say)))
    if answer.proposal is not None and entry.confirm:
        _report(runtime, "yes", conversation.say("yes"))


def _report(runtime: Runtime, what: str, answer: Answer) -> None:
    click.echo(f"[{runtime.now:.1f} s] > {what}", err=True)
    click.echo(f"[{runtime.now:.1f} s] {answer.reply.message}", err=True)


def _lines(stream: Any) -> Iterator[str]:
    """Yield lines without their ends; one that is too long comes cut, what is no text replaced."""
    if hasattr(stream, "reconfigure"):
        stream.reconfigure(errors="replace")
    while line := stream.readline(LINE):
        if len(line) == LINE and not line.endswith("\n"):
            while (rest := stream.readline(LINE)) and not rest.endswith("\n"):
                pass
        yield line.rstrip("\r\n")


def _conversation(
    runtime: Runtime,
    interpreter: Interpreter,
    carry_out: Callable[[Sequence[Command]], Any] | None = None,
) -> Conversation:
    from oath.instruct.conversation import Conversation

    return Conversation(
        interpreter,
        runtime.live,
        carry_out or (lambda commands: runtime.command(commands, "operator")),
        preview=runtime.preview,
    )
