"""What the program shows: results, progress on a terminal, and the files of a run."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections.abc import Iterator

    from oath.events import AnyEvent
    from oath.model import Mission


def print_json(value: object) -> None:
    """Print one JSON object to stdout."""
    click.echo(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False))


def write(path: Path, text: str) -> None:
    """Write a whole file or leave the old one."""
    draft = path.with_name(path.name + ".part")
    draft.write_text(text, encoding="utf-8")
    draft.replace(path)


@contextmanager
def recording(out: Path | None, mission: Mission) -> Iterator[Callable[[AnyEvent], None]]:
    """Journal every event to events.jsonl, line by line: a run cut off leaves whole lines."""
    if out is None:
        yield lambda event: None
        return
    from oath.formats.event_log import to_line

    draft = out / "events.jsonl.part"
    file: IO[str] | None = None
    count = 0

    def write(event: AnyEvent) -> None:
        nonlocal file, count
        if file is None:  # only now: bad input must leave nothing behind
            out.mkdir(parents=True, exist_ok=True)
            file = draft.open("w", encoding="utf-8")
        file.write(to_line(count, event).rstrip("\n") + "\n")
        count += 1

    try:
        yield write
    finally:
        if file is not None:
            file.close()
    draft.replace(out / "events.jsonl")


@contextmanager
def progress(tasks: int) -> Iterator[Callable[[AnyEvent], None]]:
    """Show tasks done, the mission clock and the time left, on a terminal only."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    from oath.events import StopServed

    console = Console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("tasks  mission clock {task.fields[clock]:.0f} s  left"),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
        transient=True,
    )
    with bar:
        job = bar.add_task("running", total=tasks, clock=0.0)

        def show(event: AnyEvent) -> None:
            done = isinstance(event, StopServed) and event.stop != "pickup"
            bar.update(job, advance=int(done), clock=event.t)

        yield show


@contextmanager
def counting(title: str) -> Iterator[Callable[[int, int], None]]:
    """Show how many cases are done, and the time left, on a terminal only."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal, transient=True) as bar:
        job = bar.add_task(title, total=None)
        yield lambda done, total: bar.update(job, completed=done, total=total)


def print_summary(summary: dict[str, Any], out: Path | None) -> None:
    """Print a run's summary in words, and where its files are."""
    click.echo(
        f"{summary['mission']}: {summary['completed']} of {summary['tasks']} tasks done by "
        f"{summary['robots']} robots (allocator {summary['allocator']}, seed {summary['seed']})"
    )
    click.echo(
        f"  driven {summary['total_distance']:.1f} m in {summary['total_steps']} steps, "
        f"makespan {summary['makespan']:.1f} s"
    )
    click.echo(
        f"  {summary['rounds']} rounds in {summary['allocation_seconds'] * 1e3:.0f} ms, "
        f"{summary['replans']} replans, planning {summary['planning_seconds'] * 1e3:.0f} ms"
    )
    width = max(map(len, summary["per_robot"]))
    for robot, numbers in summary["per_robot"].items():
        click.echo(
            f"  {robot:{width}}  {numbers['tasks']:3d} tasks  {numbers['distance']:7.1f} m"
            f"  {numbers['steps']:4d} steps"
        )
    for task, reason in summary["unserved"].items():
        click.echo(f"  not done: {task}: {reason}")
    if out is not None:
        click.echo(f"  see {out / 'routes.png'}, {out / 'summary.json'}, {out / 'events.jsonl'}")


def print_plan(report: dict[str, Any]) -> None:
    """Print an assignment, a line a robot."""
    click.echo(
        f"{report['allocator']}: {report['total_distance']:.1f} m in all, makespan "
        f"{report['makespan']:.1f} s, found in {report['seconds'] * 1e3:.1f} ms"
    )
    if report["optimal"]:
        click.echo("  proven optimal")
    elif report["lower_bound"] is not None:
        click.echo(f"  objective {report['objective']:.1f}, at least {report['lower_bound']:.1f}")
    signs = {"pickup": "+", "delivery": "-", "visit": ""}
    for robot, route in report["routes"].items():
        stops = " ".join(signs[entry["stop"]] + entry["task"] for entry in route)
        click.echo(f"  {robot}: {stops or 'idle'}")
    for task, reason in report["unassigned"].items():
        click.echo(f"  unassigned: {task}: {reason}")
    click.echo("  (+ picks up, - delivers)")
