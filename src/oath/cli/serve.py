"""The command `serve`: a mission server with its console."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from oath.cli.options import (
    allocator_option,
    budget_option,
    examples,
    interpreter_options,
    mission_argument,
    points_option,
    seed_option,
    weight_option,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from oath.instruct import Interpreter
    from oath.model import Mission
    from oath.picture.recording import Recorder
    from oath.service.server import Running
    from oath.store import Origin
    from oath.store.sqlite import SqliteJournal

BUDGET = 0.05
"""Time to improve an answer of the allocator unless another is given [s]: the mission waits."""


@click.command(
    epilog=examples(
        "oath serve missions/maze-25.yaml",
        "oath serve missions/maze-25.yaml --journal maze.journal --speed 10 --until-done",
        "oath serve missions/office.yaml --host 0.0.0.0 --token a-long-secret",
    )
)
@mission_argument
@click.option(
    "--journal",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File that keeps the mission; if there is one, its mission goes on.",
)
@click.option(
    "--record",
    metavar="FILE.mcap",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Recording of the mission for Foxglove, Rerun and others.",
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen at.")
@click.option(
    "--port",
    default=8080,
    show_default=True,
    type=click.IntRange(0, 65535),
    help="Port to listen at; 0 takes a free one.",
)
@click.option("--token", help="What operators must send.  [default: made up and printed]")
@click.option("--viewer-token", help="What those must send who may only watch.")
@click.option(
    "--speed",
    default=1.0,
    show_default=True,
    type=click.FloatRange(0.1, 100.0),
    help="Mission seconds per second.",
)
@click.option("--until-done", is_flag=True, help="Stop once every task is done or cannot be.")
@click.option(
    "--rate",
    default=100.0,
    show_default=True,
    type=click.FloatRange(1.0, 1e6),
    help="Requests per second that each client may make.",
)
@allocator_option
@weight_option
@budget_option
@seed_option
@points_option(1000)
@interpreter_options
def serve(
    mission: Path,
    journal: Path | None,
    record: Path | None,
    host: str,
    port: int,
    token: str | None,
    viewer_token: str | None,
    speed: float,
    until_done: bool,
    rate: float,
    allocator: str,
    makespan_weight: float | None,
    budget: float | None,
    seed: int,
    points: int,
    interpreter: Callable[[], Interpreter],
) -> None:
    """Run a mission live, with a console in the browser and an API for other systems.

    Prints the console's address once; the token in it lets operators in. Ctrl-C ends the server,
    not the mission: with --journal it goes on where it was when the server starts again, with the
    mission and the settings that it began with.
    """
    from contextlib import closing

    from oath.service.auth import access
    from oath.service.server import listen
    from oath.service.server import serve as run

    settings = {
        "allocator": allocator,
        "makespan_weight": makespan_weight,
        "seconds": budget or BUDGET,
        "seed": seed,
        "points": points,
    }
    interpreter()  # a wrong choice is told now, not when the first words come
    with listen(host, port) as listener, TemporaryDirectory() as folder:
        port = listener.getsockname()[1]
        who, made_up = access(host=host, port=port, token=token, viewer=viewer_token)
        if journal is None:
            click.echo("note: without --journal, the mission ends with the server", err=True)
        path = journal or Path(folder, "mission.journal")
        running, kept = (_resumed if path.exists() else _begun)(
            mission, path, settings, interpreter, record
        )
        name = f"[{host}]" if ":" in host else host
        link = f"?token={who.operator}" if made_up else ""
        with closing(kept):
            run(
                running,
                kept,
                listener,
                who,
                speed=speed,
                until_done=until_done,
                rate=rate,
                on_ready=lambda: click.echo(f"console: http://{name}:{port}/{link}"),
            )


def _begun(
    mission: Path,
    path: Path,
    settings: dict[str, Any],
    interpreter: Callable[[], Interpreter],
    record: Path | None,
) -> tuple[Running, SqliteJournal]:
    """Make a mission ready and begin its journal; bad input leaves none behind."""
    import oath
    from oath.store import Origin
    from oath.store.sqlite import SqliteJournal

    origin = Origin.of(mission, **settings)
    running = _running(oath.load(mission), origin, interpreter, record)
    return running, SqliteJournal.create(path, origin)


def _resumed(
    mission: Path,
    path: Path,
    settings: dict[str, Any],
    interpreter: Callable[[], Interpreter],
    record: Path | None,
) -> tuple[Running, SqliteJournal]:
    """Open a journal and make its mission ready as it was."""
    from oath.errors import BadInput
    from oath.store import Origin
    from oath.store.sqlite import SqliteJournal

    journal = SqliteJournal(path)
    try:
        kept, given = journal.origin.mission(), Origin.of(mission, **settings)
        if given.mission().name != kept.name:
            raise BadInput(
                f"is the journal of {kept.name}, not of {mission}",
                file=str(path),
                remedy="name another journal, or its mission",
            )
        if given != journal.origin:
            told = "goes on with the mission and settings it began with; others were given"
            click.echo(f"note: {path} {told}", err=True)
        return _running(kept, journal.origin, interpreter, record), journal
    except BaseException:
        journal.close()
        raise


def _running(
    mission: Mission,
    origin: Origin,
    interpreter: Callable[[], Interpreter],
    record: Path | None,
) -> Running:
    from oath.allocate import Budget
    from oath.allocate import allocator as named
    from oath.scene import prepare, require_reachable
    from oath.service.server import Running
    from oath.world.roadmap import Params

    chosen = named(origin.allocator, makespan_weight=origin.makespan_weight)
    scene = prepare(mission, Params(points=origin.points), origin.seed)
    require_reachable(scene)
    return Running(
        scene=scene,
        name=origin.allocator,
        allocator=chosen,
        budget=Budget(seconds=origin.seconds),
        seed=origin.seed,
        interpreter=interpreter,
        recorder=None if record is None else _recorder(record, mission),
    )


def _recorder(path: Path, mission: Mission) -> Recorder:
    from oath.picture.recording import Recorder

    return Recorder(path, mission)
