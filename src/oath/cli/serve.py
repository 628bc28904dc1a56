"""The command `serve`: a mission server with its console."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from oath.commands import Live
    from oath.instruct import Dialogue, Interpreter, Reply

from oath.cli.options import (
    allocator_option,
    budget_option,
    examples,
    mission_argument,
    points_option,
    seed_option,
    weight_option,
)


@click.command(
    epilog=examples(
        "oath serve missions/maze-25.yaml",
        "oath serve missions/maze-25.yaml --journal maze.journal --speed 10 --until-done",
        "oath serve missions/office.yaml --host 0.0.0.0 --token a-long-secret",
    )
)
@mission_argument
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
def serve(
    mission: Path,
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
) -> None:
    """Run a mission live, with a console in the browser and an API for other systems.

    Prints the console's address once; its token lets operators in. Ctrl-C ends the server, not the
    mission: with --journal it goes on where it was when the server starts again.
    """
    import oath
    from oath.allocate import Budget
    from oath.allocate import allocator as named
    from oath.scene import prepare, require_reachable
    from oath.service.auth import access
    from oath.service.server import Running, listen
    from oath.service.server import serve as run
    from oath.world.roadmap import Params

    loaded, chosen = oath.load(mission), named(allocator, makespan_weight=makespan_weight)
    with listen(host, port) as listener:
        port = listener.getsockname()[1]
        who, made_up = access(host=host, port=port, token=token, viewer=viewer_token)
        scene = prepare(loaded, Params(points=points), seed)
        require_reachable(scene)
        running = Running(
            scene=scene,
            name=allocator,
            allocator=chosen,
            budget=Budget(seconds=budget),
            seed=seed,
            interpreter=_interpreter,
        )
        name = f"[{host}]" if ":" in host else host
        link = f"?token={who.operator}" if made_up else ""
        run(
            running,
            listener,
            who,
            speed=speed,
            until_done=until_done,
            rate=rate,
            on_ready=lambda: click.echo(f"console: http://{name}:{port}/{link}"),
        )


def _interpreter() -> Interpreter:
    try:
        from oath.instruct.offline import Offline
    except ModuleNotFoundError:
        return _Deaf()
    return Offline()


class _Deaf:
    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        from oath.instruct import Reply

        return Reply(status="clarification", message="Words are not understood yet.")
