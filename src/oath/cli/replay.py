"""Commands on journals: `replay` rebuilds any moment, `record` makes a recording of it all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from oath.cli.options import examples, json_option
from oath.errors import BadInput
from oath.terminal import print_json, write

if TYPE_CHECKING:
    from oath.state import State

journal_argument = click.argument(
    "journal", metavar="JOURNAL", type=click.Path(dir_okay=False, path_type=Path)
)


@click.command(
    epilog=examples(
        "oath replay maze.journal",
        "oath replay maze.journal --at 12.5 --json",
        "oath replay maze.journal --out events.jsonl",
    )
)
@journal_argument
@click.option("--seq", type=click.IntRange(0), help="Up to the event with this number.")
@click.option("--at", type=float, help="Up to this time of the mission clock [s].")
@click.option("--events", "show", is_flag=True, help="Show the events too.")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the events to this file, for `oath verify`.",
)
@json_option
def replay(
    journal: Path, seq: int | None, at: float | None, show: bool, out: Path | None, as_json: bool
) -> None:
    """Rebuild a moment of a mission from its journal; by default, the last one.

    The journal may be in use. If it is damaged, --seq reads what comes before the damage.
    """
    from oath.formats.event_log import to_line
    from oath.store import replayed
    from oath.store.sqlite import read

    if seq is not None and at is not None:
        raise click.UsageError("give --seq or --at, not both")
    stored = read(journal, last=seq)
    events = stored.events
    if seq is not None and len(events) <= seq:
        raise BadInput(
            f"there is no event {seq}",
            file=str(journal),
            remedy=f"the last one is {len(events) - 1}" if events else "it holds no event yet",
        )
    if at is not None:
        events = [event for event in events if event.t <= at]
    mission = stored.origin.mission()
    state = replayed(stored.origin.state(mission), events)
    lines = [to_line(i, event) for i, event in enumerate(events)]
    if out is not None:
        write(out, "".join(line + "\n" for line in lines))
    report = {"mission": mission.name, "events": len(events), **_plain(state)}
    if as_json:
        if show:
            report["log"] = [json.loads(line) for line in lines]
        print_json(report)
        return
    if show:
        click.echo("\n".join(lines))
    _print(report)


def _plain(state: State) -> dict[str, Any]:
    from oath.picture.statuses import robot_statuses, task_statuses

    robots, tasks = robot_statuses(state), task_statuses(state)
    return {
        "t": state.t,
        "finished": state.finished,
        "robots": {
            id: {
                "status": robots[id],
                "at": list(robot.position),
                "carrying": list(robot.carrying),
                "route": [{"task": stop.task, "stop": stop.stop} for stop in robot.route],
            }
            for id, robot in state.robots.items()
        },
        "tasks": {
            id: {"status": tasks[id], "type": task.type, "priority": task.priority}
            for id, task in state.tasks.items()
        },
        "obstacles": {
            id: {"kind": one.kind, "polygon": [list(at) for at in one.polygon]}
            for id, one in state.obstacles.items()
        },
    }


def _print(report: dict[str, Any]) -> None:
    tasks = report["tasks"]
    done = sum(task["status"] == "done" for task in tasks.values())
    end = ", finished" if report["finished"] else ""
    click.echo(
        f"{report['mission']} at {report['t']:.1f} s, after {report['events']} events{end}: "
        f"{done} of {len(tasks)} tasks done"
    )
    signs = {"pickup": "+", "delivery": "-", "visit": ""}
    for id, robot in report["robots"].items():
        x, y = robot["at"]
        words = [f"  {id} at ({x:.1f}, {y:.1f}): {robot['status']}"]
        if robot["carrying"]:
            words.append(f"carries {' '.join(robot['carrying'])}")
        if robot["route"]:
            words.append(" ".join(signs[stop["stop"]] + stop["task"] for stop in robot["route"]))
        click.echo(", ".join(words))
    for status in ("carried", "assigned", "waiting", "stranded"):
        ids = [id for id, task in tasks.items() if task["status"] == status]
        if ids:
            click.echo(f"  {status}: {' '.join(ids)}")
    if report["obstacles"]:
        known = (f"{id} ({one['kind']})" for id, one in report["obstacles"].items())
        click.echo(f"  obstacles: {', '.join(known)}")


@click.command(epilog=examples("oath record maze.journal maze.mcap"))
@journal_argument
@click.argument("file", metavar="FILE.mcap", type=click.Path(dir_okay=False, path_type=Path))
def record(journal: Path, file: Path) -> None:
    """Make a recording of a journal that Foxglove, Rerun and other MCAP readers play."""
    from oath.picture.recording import Recorder
    from oath.store.sqlite import read

    stored = read(journal)
    mission = stored.origin.mission()
    with Recorder(file, mission) as recorder:
        recorder.play(stored.events)
    last = stored.events[-1].t if stored.events else 0.0
    click.echo(f"{mission.name}: {len(stored.events)} events, {last:.1f} s, see {file}")
