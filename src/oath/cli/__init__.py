"""The program `oath`. Results go to stdout, everything else to stderr.

Exit codes: 0 ok, 1 the mission cannot be done or a check failed, 2 bad input.
"""

from __future__ import annotations

import json
import os
import sys
from contextlib import AbstractContextManager, nullcontext
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
from oath.cli.replay import record, replay
from oath.cli.serve import serve
from oath.cli.talk import acts, chat, interpret
from oath.errors import OathError
from oath.terminal import (
    counting,
    print_json,
    print_plan,
    print_summary,
    progress,
    recording,
    write,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from oath.events import AnyEvent
    from oath.instruct import Interpreter
    from oath.model import Mission
    from oath.picture.recording import Recorder
    from oath.scene import Assigned

CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


class Program(click.Group):
    """Turns errors into one line on stderr and an exit code."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; nothing reaches the user as a traceback."""
        try:
            return super().invoke(ctx)
        except OathError as error:
            click.echo(f"error: {error}", err=True)
            ctx.exit(2)
        except BrokenPipeError:
            # Whoever read our output has seen enough; Python must not complain when it flushes.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(1)
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            click.echo(f"error: {where}{error.strerror or error}", err=True)
            ctx.exit(2)


@click.group(cls=Program, context_settings=CONTEXT)
@click.version_option(package_name="oath-fleet", prog_name="oath")
def main() -> None:
    """Assign tasks to a mixed robot fleet among obstacles, plan every motion, run the mission."""


@main.command(
    epilog=examples(
        "oath run missions/maze-25-gates.yaml --out out",
        "oath run missions/office.yaml --seed 7 --json",
        "oath run missions/maze-25.yaml --script missions/maze-25-script.yaml --out out",
    )
)
@mission_argument
@allocator_option
@weight_option
@budget_option
@seed_option
@points_option(1000)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for events.jsonl, summary.json and routes.png.",
)
@click.option(
    "--script",
    type=click.Path(path_type=Path),
    help="Timed instructions and commands to play into the mission (YAML).",
)
@click.option(
    "--record",
    "recorded",
    metavar="FILE.mcap",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Recording of the mission for Foxglove, Rerun and others.",
)
@interpreter_options
@json_option
def run(
    mission: Path,
    allocator: str,
    makespan_weight: float | None,
    budget: float | None,
    seed: int,
    points: int,
    out: Path | None,
    script: Path | None,
    recorded: Path | None,
    interpreter: Callable[[], Interpreter],
    as_json: bool,
) -> None:
    """Run a mission in the built-in simulator, to its last delivery."""
    import oath

    loaded = oath.load(mission)
    entries = []
    if script is not None:
        from oath.formats.script import read as read_script

        entries = read_script(script)
    with recording(out, loaded) as journal, progress(len(loaded.tasks)) as show:

        def on_event(event: AnyEvent) -> None:
            journal(event)
            show(event)

        runtime = oath.prepare(
            loaded,
            allocator=allocator,
            makespan_weight=makespan_weight,
            seconds=budget,
            seed=seed,
            points=points,
            on_event=on_event,
        )
        with _recorder(recorded, loaded) as recorder:
            result = runtime.run(acts(runtime, entries, interpreter))
            if recorder is not None:
                recorder.play(result.events)
    if out is not None:
        from oath.picture import draw_run

        write(out / "summary.json", json.dumps(result.summary, indent=2) + "\n")
        roadmap = result.scene.world.roadmap
        draw_run(
            loaded,
            result.events,
            out / "routes.png",
            nodes=roadmap.nodes(),
            edges=roadmap.edges(),
        )
    if as_json:
        print_json(result.summary)
    else:
        print_summary(result.summary, out)
    if result.summary["unserved"]:
        raise click.exceptions.Exit(1)


def _recorder(path: Path | None, mission: Mission) -> AbstractContextManager[Recorder | None]:
    if path is None:
        return nullcontext()
    from oath.picture.recording import Recorder

    return Recorder(path, mission)


@main.command(
    epilog=examples(
        "oath plan missions/maze-25.yaml --allocator lns --budget 200ms --json",
        "oath plan missions/maze-15.yaml --allocator exact --makespan-weight 0 --max-tasks 5",
    )
)
@mission_argument
@allocator_option
@weight_option
@click.option("--max-tasks", type=click.IntRange(min=1), help="Tasks per robot in all.")
@budget_option
@seed_option
@points_option(2000)
@json_option
def plan(
    mission: Path,
    allocator: str,
    makespan_weight: float | None,
    max_tasks: int | None,
    budget: float | None,
    seed: int,
    points: int,
    as_json: bool,
) -> None:
    """Assign all tasks once, without executing anything."""
    import oath
    from oath.allocate import Budget
    from oath.allocate import allocator as named
    from oath.scene import assign, prepare, require_reachable
    from oath.world.roadmap import Params

    loaded, chosen = oath.load(mission), named(allocator, makespan_weight=makespan_weight)
    scene = prepare(loaded, Params(points=points), seed)
    require_reachable(scene)
    assigned = assign(scene, chosen, Budget(seconds=budget), seed, max_tasks)
    weight = 1.0 if makespan_weight is None else makespan_weight
    report = _plan_report(loaded, allocator, assigned, weight)
    if as_json:
        print_json(report)
    else:
        print_plan(report)
    if report["unassigned"]:
        raise click.exceptions.Exit(1)


def _plan_report(
    mission: Mission, allocator: str, assigned: Assigned, makespan_weight: float
) -> dict[str, Any]:
    assignment = assigned.assignment
    return {
        "allocator": allocator,
        "seconds": assigned.seconds,
        "total_distance": assigned.total_distance,
        "makespan": assigned.makespan,
        "objective": assigned.total_distance + makespan_weight * assigned.makespan,
        "lower_bound": assignment.lower_bound,
        "optimal": assignment.optimal,
        "routes": {
            robot: [
                {
                    "task": entry.task,
                    "stop": entry.stop,
                    "at": list(mission.task(entry.task).stop(entry.stop).at),
                }
                for entry in route
            ]
            for robot, route in assignment.routes.items()
        },
        "unassigned": dict(assignment.unassigned),
    }


@main.command(epilog=examples("oath check missions/office.yaml"))
@mission_argument
@seed_option
@points_option(1000)
@json_option
def check(mission: Path, seed: int, points: int, as_json: bool) -> None:
    """Validate a mission and point out what will go wrong or looks odd."""
    import oath
    from oath.scene import lint, prepare, unreachable
    from oath.world.roadmap import Params

    scene = prepare(oath.load(mission), Params(points=points), seed)
    faults = [f"task '{task}': {why}" for task, why in unreachable(scene).items()]
    warnings = lint(scene)
    if as_json:
        print_json({"mission": scene.mission.name, "errors": faults, "warnings": warnings})
    else:
        for kind, lines in (("error", faults), ("warning", warnings)):
            for line in lines:
                click.echo(f"{kind}: {line}")
        loaded = scene.mission
        click.echo(
            f"{loaded.name}: {len(loaded.robots)} robots, {len(loaded.tasks)} tasks, "
            f"{len(faults)} errors, {len(warnings)} warnings"
        )
    if faults:
        raise click.exceptions.Exit(1)


@main.command(
    name="map",
    epilog=examples("oath map missions/maze-25.yaml --points 2000 --png roadmap.png"),
)
@mission_argument
@seed_option
@points_option(1000)
@click.option("--png", type=click.Path(dir_okay=False, path_type=Path), help="Draw it to a file.")
@json_option
def map_(mission: Path, seed: int, points: int, png: Path | None, as_json: bool) -> None:
    """Build the roadmap; print counts, connectivity and build time."""
    import oath
    from oath.scene import prepare, unreachable
    from oath.world.roadmap import Params

    scene = prepare(oath.load(mission), Params(points=points), seed)
    roadmap = scene.world.roadmap
    out_of_reach = unreachable(scene)
    report = {
        "points": roadmap.sampled,
        "nodes": roadmap.graph.size,
        "edges": len(roadmap.edges()),
        "components": max(roadmap.parts(mode) for mode in range(len(roadmap.modes))),
        "seconds": {
            "sampling": roadmap.seconds.sampling,
            "triangulation": roadmap.seconds.triangulation,
            "collision": roadmap.seconds.collision,
            "total": roadmap.seconds.total,
        },
        "unreachable": sorted(out_of_reach),
    }
    if png is not None:
        from oath.picture import draw_map

        draw_map(scene.mission, roadmap.nodes(), roadmap.edges(), png)
    if as_json:
        print_json(report)
    else:
        click.echo(
            f"{scene.mission.name}: {report['points']} points, {report['nodes']} nodes, "
            f"{report['edges']} edges, {report['components']} components, "
            f"built in {roadmap.seconds.total * 1e3:.1f} ms"
        )
        for task, why in out_of_reach.items():
            click.echo(f"  out of reach: task '{task}': {why}")
    if out_of_reach:
        raise click.exceptions.Exit(1)


@main.command(epilog=examples("oath verify missions/maze-25-gates.yaml out/events.jsonl"))
@mission_argument
@click.argument("events", metavar="EVENTS", type=click.Path(path_type=Path))
@json_option
def verify(mission: Path, events: Path, as_json: bool) -> None:
    """Judge an event log independently of what made it; list every violation."""
    import oath
    from oath.formats.event_log import read
    from oath.verify import verify as judge

    loaded = oath.load(mission)
    log = [event for _, event in read(events, places=loaded.places)]
    verdict = judge(loaded, log)
    if as_json:
        print_json(
            {
                "ok": verdict.ok,
                "checked": dict(verdict.checked),
                "least_separation": verdict.least_separation,
                "violations": [
                    {
                        "rule": violation.rule,
                        "seq": violation.seq,
                        "robot": violation.robot,
                        "message": violation.message,
                    }
                    for violation in verdict.violations
                ],
            }
        )
    else:
        for violation in verdict.violations:
            click.echo(f"violation: {violation}")
        counts = ", ".join(f"{count} {what}" for what, count in verdict.checked.items())
        click.echo(f"{'ok' if verdict.ok else 'NOT ok'}: judged {counts}")
        if verdict.least_separation is not None:
            click.echo(f"least distance between two robots: {verdict.least_separation:.2f} m")
    if not verdict.ok:
        raise click.exceptions.Exit(1)


main.add_command(interpret)
main.add_command(chat)
main.add_command(serve)
main.add_command(replay)
main.add_command(record)


@main.command(
    epilog=examples("oath bench optimality --quick", "oath bench all --out report --seeds 10")
)
@click.argument("study", metavar="STUDY")
@click.option("--quick", is_flag=True, help="A sketch in about a minute.")
@click.option("--seeds", default=5, show_default=True, type=click.IntRange(1), help="Repetitions.")
@click.option(
    "--out",
    default=Path("bench-out"),
    show_default=True,
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for tables, plots and what is finished so far.",
)
def bench(study: str, quick: bool, seeds: int, out: Path) -> None:
    """Run a study of the paper, or all of them, and write tables, plots and a report.

    An interrupted study goes on where it stopped. STUDY is one of: sampling, tuning, clusters,
    types, selection, efficiency, endtoend, optimality, scaling, automaton, churn, language,
    instructions, latency, all.
    """
    from oath import bench as studies

    names = list(studies.STUDIES) if study == "all" else [study]
    chosen = [studies.study(name) for name in names]
    outcomes = []
    for one in chosen:
        with counting(one.title) as show:
            folder = out / ("quick" if quick else f"seeds-{seeds}")
            outcome = studies.run_study(one, folder, quick=quick, seeds=seeds, on_progress=show)
        outcomes.append(outcome)
        click.echo(f"{one.title}\n\n{studies.markdown(outcome.table)}\n\n{outcome.finding}")
        click.echo(f"The paper: {one.paper}\nsee {outcome.png}, {outcome.csv}\n")
    if study == "all":
        command = "oath bench all" + (" --quick" if quick else f" --seeds {seeds}")
        studies.report(outcomes, folder / "report.md", command=command)
        click.echo(f"see {folder / 'report.md'}")
