"""The program: what it prints where, how it exits, and what it leaves behind."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import oath
from oath.cli import main
from oath.formats import event_log

MAZE = "missions/maze-09.yaml"
TINY = """
    name: tiny
    map: {bounds: [0, 0, 10, 10], walls: [[[5, 0], [5, 6]]]}
    places: {dock: [8, 2]}
    robots: [{id: r1, start: [1, 1]}, {id: r2, start: [1, 3], speed: 0.5}]
    tasks:
      - {id: box, pickup: [2, 2], delivery: dock}
      - {id: look, visit: [2, 8], service_time: 2}
"""
SHUT = """
    map:
      bounds: [0, 0, 10, 10]
      walls: [[[5, 0], [5, 4]], [[5, 6], [5, 10]]]
      obstacles:
        - {id: gate, known: false, polygon: [[4.9, 3.9], [5.1, 3.9], [5.1, 6.1], [4.9, 6.1]]}
    robots: [{id: r1, start: [1, 1]}]
    tasks: [{id: in, visit: [8, 5]}, {id: out, visit: [2, 2]}]
"""
WALLED = SHUT.replace("known: false", "known: true")


def oath_(*args: object) -> Result:
    return CliRunner().invoke(main, [str(arg) for arg in args])


def real(*args: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run the program in a process of its own."""
    command = [sys.executable, "-m", "oath.cli", *map(str, args)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    def write(text: str, name: str = "mission.yaml") -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


Write = Callable[..., Path]


def json_of(result: Result) -> Any:
    """Return the only JSON object on stdout; there must be nothing else."""
    assert result.exit_code in (0, 1), result.output
    assert result.stderr == ""
    return json.loads(result.stdout)


# --- What each command answers --------------------------------------------------------------

SUMMARY = {
    "mission": str,
    "allocator": str,
    "seed": int,
    "robots": int,
    "tasks": int,
    "completed": int,
    "unserved": dict,
    "total_steps": int,
    "total_distance": float,
    "makespan": float,
    "allocation_seconds": float,
    "planning_seconds": float,
    "total_running_time": float,
    "rounds": int,
    "replans": int,
    "per_robot": dict,
}
PLAN = {
    "allocator": str,
    "seconds": float,
    "total_distance": float,
    "makespan": float,
    "objective": float,
    "lower_bound": float | None,
    "optimal": bool,
    "routes": dict,
    "unassigned": dict,
}
MAP = {
    "points": int,
    "nodes": int,
    "edges": int,
    "components": int,
    "seconds": dict,
    "unreachable": list,
}


def check_shape(value: dict[str, Any], shape: dict[str, Any]) -> None:
    assert value.keys() == shape.keys()
    for key, kind in shape.items():
        assert isinstance(value[key], kind), (key, value[key])


def test_run_json(write: Write) -> None:
    result = oath_("run", write(TINY), "--json", "--seed", 4, "--points", 100)
    assert result.exit_code == 0
    summary = json_of(result)
    check_shape(summary, SUMMARY)
    assert (summary["mission"], summary["seed"], summary["completed"]) == ("tiny", 4, 2)
    assert summary["per_robot"].keys() == {"r1", "r2"}
    for own in summary["per_robot"].values():
        check_shape(own, {"steps": int, "distance": float, "tasks": int})


def test_plan_json(write: Write) -> None:
    result = oath_("plan", write(TINY), "--json", "--points", 100)
    assert result.exit_code == 0
    plan = json_of(result)
    check_shape(plan, PLAN)
    stops = [stop for route in plan["routes"].values() for stop in route]
    assert {"task": "box", "stop": "delivery", "at": [8.0, 2.0]} in stops
    assert all(stop.keys() == {"task", "stop", "at"} for stop in stops)
    assert plan["objective"] == pytest.approx(plan["total_distance"] + plan["makespan"])


def test_map_json(write: Write) -> None:
    result = oath_("map", write(TINY), "--json", "--points", 150)
    assert result.exit_code == 0
    map = json_of(result)
    check_shape(map, MAP)
    check_shape(
        map["seconds"],
        dict.fromkeys(("sampling", "triangulation", "collision", "total"), float),
    )
    assert map["points"] == 150
    assert map["nodes"] >= 150
    assert map["unreachable"] == []


def test_check_and_verify_json(write: Write, tmp_path: Path) -> None:
    mission, out = write(TINY), tmp_path / "out"
    assert json_of(oath_("check", mission, "--json", "--points", 100)).keys() == {
        "mission",
        "errors",
        "warnings",
    }
    oath_("run", mission, "--out", out, "--points", 100)
    verdict = json_of(oath_("verify", mission, out / "events.jsonl", "--json"))
    assert verdict["ok"] is True
    assert verdict["violations"] == []
    assert verdict.keys() == {"ok", "checked", "least_separation", "violations"}


def test_what_people_read(write: Write, tmp_path: Path) -> None:
    mission, out = write(TINY), tmp_path / "out"
    run = oath_("run", mission, "--points", 100, "--out", out)
    assert (run.exit_code, run.stderr) == (0, "")
    assert "tiny: 2 of 2 tasks done by 2 robots" in run.stdout
    assert str(out / "routes.png") in run.stdout
    timed = oath_("run", mission, "--points", 100, "--budget", "5ms")
    assert timed.exit_code == 0, timed.stderr
    plan = oath_("plan", mission, "--points", 100, "--budget", "200ms")
    assert "+box -box" in plan.stdout
    assert "0 errors" in oath_("check", mission, "--points", 100).stdout
    assert "100 points" in oath_("map", mission, "--points", 100).stdout
    verify = oath_("verify", mission, out / "events.jsonl")
    assert verify.stdout.startswith("ok: judged")
    assert "least distance between two robots" in verify.stdout


@pytest.mark.parametrize("command", ["run", "plan", "check", "map", "verify"])
def test_help_shows_an_example(command: str) -> None:
    result = oath_(command, "--help")
    assert result.exit_code == 0
    assert "Example" in result.output
    assert f"oath {command} missions/" in result.output


def test_help_lists_the_commands() -> None:
    listed = oath_("--help").output
    for command in ("run", "plan", "check", "map", "verify"):
        assert f"\n  {command} " in listed


def test_the_version_is_told() -> None:
    try:
        installed = version("oath-fleet")
    except PackageNotFoundError:
        pytest.skip("the package is not installed, only on the path")
    assert oath_("--version").output == f"oath, version {installed}\n"


def test_the_examples_of_the_help_run(tmp_path: Path) -> None:
    for command in ("plan", "check", "map", "run"):
        lines = oath_(command, "--help").output.splitlines()
        for line in lines:
            words = line.split()
            if words[:2] == ["oath", command] and len(words) > 2:
                arguments = [
                    str(tmp_path / word) if before in ("--out", "--png") else word
                    for before, word in pairwise(words[1:])
                ]
                assert oath_(command, *arguments).exit_code == 0, line


# --- What a run leaves behind ---------------------------------------------------------------


def test_a_run_writes_log_summary_and_picture(write: Write, tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    result = oath_("run", write(TINY), "--json", "--out", out, "--points", 100)
    assert sorted(path.name for path in out.iterdir()) == [
        "events.jsonl",
        "routes.png",
        "summary.json",
    ]
    assert json.loads((out / "summary.json").read_text()) == json_of(result)
    assert (out / "routes.png").read_bytes().startswith(b"\x89PNG")
    events = event_log.read(out / "events.jsonl")
    assert [seq for seq, _ in events] == list(range(len(events)))
    lines = [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]
    assert lines[0]["type"] == "mission_started"
    assert lines[0]["schema"] == "oath/events/1"
    assert lines[-1]["type"] == "mission_finished"
    assert lines[-1]["summary"] == json_of(result)


def test_the_log_on_disk_is_what_happened(write: Write, tmp_path: Path) -> None:
    mission = write(TINY)
    oath_("run", mission, "--out", tmp_path / "out", "--points", 100, "--seed", 2)
    logged = [event for _, event in event_log.read(tmp_path / "out" / "events.jsonl")]
    again = oath.run(oath.load(mission), seed=2, points=100).events
    assert [(e.type, e.t) for e in logged] == [(e.type, e.t) for e in again]


def test_a_second_run_replaces_the_first(write: Write, tmp_path: Path) -> None:
    out = tmp_path / "out"
    oath_("run", MAZE, "--out", out)
    stranger = out / "notes.txt"
    stranger.write_text("mine")
    assert oath_("run", write(TINY), "--out", out, "--points", 100).exit_code == 0
    assert json.loads((out / "summary.json").read_text())["mission"] == "tiny"
    assert oath_("verify", tmp_path / "mission.yaml", out / "events.jsonl").exit_code == 0
    assert len(list(out.iterdir())) == 4
    assert stranger.read_text() == "mine"


def test_paths_with_spaces_and_other_letters(write: Write, tmp_path: Path) -> None:
    mission = write(TINY, "große Räume/mission für 机器人.yaml")
    out = tmp_path / "Ergebnis von heute ✓"
    done = real("run", mission, "--out", out, "--points", 100)
    assert (done.returncode, done.stderr) == (0, "")
    assert real("verify", mission, out / "events.jsonl").returncode == 0
    picture = tmp_path / "Bild ü.png"
    assert oath_("map", mission, "--points", 50, "--png", picture).exit_code == 0
    assert picture.exists()


def test_map_draws_a_picture(write: Write, tmp_path: Path) -> None:
    picture = tmp_path / "map.png"
    result = oath_("map", write(TINY), "--points", 100, "--png", picture, "--json")
    check_shape(json_of(result), MAP)
    assert picture.read_bytes().startswith(b"\x89PNG")


# --- Exit 1: it cannot be done, or a check failed -------------------------------------------


def test_a_run_that_leaves_tasks_exits_1(write: Write, tmp_path: Path) -> None:
    result = oath_("run", write(SHUT), "--points", 100, "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert "not done: in: no capable robot reaches its pickup" in result.stdout
    as_json = oath_("run", write(SHUT), "--points", 100, "--json")
    assert as_json.exit_code == 1
    assert json_of(as_json)["unserved"].keys() == {"in"}
    # What it left undone is no fault of the log.
    verify = oath_("verify", write(SHUT), tmp_path / "out" / "events.jsonl")
    assert verify.exit_code == 0, verify.output


def test_check_and_map_name_what_is_out_of_reach(write: Write) -> None:
    mission = write(WALLED)
    check = oath_("check", mission, "--points", 100)
    assert check.exit_code == 1
    assert "error: task 'in': visit (8, 5) is out of reach of r1" in check.stdout
    map = oath_("map", mission, "--points", 100, "--json")
    assert map.exit_code == 1
    assert json_of(map)["unreachable"] == ["in"]
    assert json_of(map)["components"] > 1


def test_check_warns_of_what_looks_odd(write: Write) -> None:
    odd = TINY.replace("{id: r1, start: [1, 1]}", "{id: r1, start: [1, 1], can: [inspect]}")
    result = oath_("check", write(odd), "--points", 100)
    assert result.exit_code == 0
    assert "warning: robot 'r1' can do none of the mission's tasks" in result.stdout
    assert "warning: no task is of type 'inspect'" in result.stdout


TAMPERED: dict[str, tuple[Callable[[list[dict[str, Any]]], None], str]] = {
    "a jump": (lambda log: first(log, "moved").update(to=[9.0, 9.0]), "contiguity"),
    "too fast": (lambda log: first(log, "moved").update(start=0.0, end=0.0, t=0.0), "speed"),
    "elsewhere": (lambda log: first(log, "stop_served").update(at=[9.0, 9.0]), "position"),
    "another robot": (lambda log: first(log, "stop_served").update(robot="r2"), "position"),
    "lost stop": (lambda log: drop(log, "stop_served"), "stop"),
    "no reason": (lambda log: log[-1]["summary"].update(completed=1), "summary"),
    "cut off": (lambda log: log.pop() and None, "cut_off"),
}


def first(log: list[dict[str, Any]], type: str) -> dict[str, Any]:
    return next(event for event in log if event["type"] == type)


def drop(log: list[dict[str, Any]], type: str) -> None:
    log.remove(first(log, type))
    for seq, event in enumerate(log):
        event["seq"] = seq


@pytest.fixture(scope="module")
def good_log(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    folder = tmp_path_factory.mktemp("good")
    mission = folder / "tiny.yaml"
    mission.write_text(TINY)
    oath_("run", mission, "--out", folder / "out", "--points", 100)
    return mission, (folder / "out" / "events.jsonl").read_text().splitlines()


@pytest.mark.parametrize("name", TAMPERED)
def test_verify_names_what_is_wrong_with_a_tampered_log(
    name: str, good_log: tuple[Path, list[str]], tmp_path: Path
) -> None:
    mission, lines = good_log
    tamper, rule = TAMPERED[name]
    log = [json.loads(line) for line in lines]
    tamper(log)
    path = tmp_path / "events.jsonl"
    path.write_text("".join(json.dumps(event) + "\n" for event in log))
    result = oath_("verify", mission, path)
    assert result.exit_code == 1, result.output
    assert "violation: " in result.stdout
    assert rule in result.stdout
    assert "NOT ok" in result.stdout
    as_json = oath_("verify", mission, path, "--json")
    assert as_json.exit_code == 1
    verdict = json_of(as_json)
    assert verdict["ok"] is False
    assert any(rule in violation["rule"] for violation in verdict["violations"])


# --- Exit 2: bad input ----------------------------------------------------------------------


def check_bad(result: Result | subprocess.CompletedProcess[str], *words: str) -> None:
    """Bad input is one line on stderr, and nothing else."""
    code = result.exit_code if isinstance(result, Result) else result.returncode
    assert code == 2, (result.stdout, result.stderr)
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr


BAD = {
    "no robots": ("tasks: []", ["robots"]),
    "not yaml": ("robots: [", ["not YAML"]),
    "empty": ("", ["empty"]),
    "a list": ("- 1", ["mapping"]),
    "unknown key": (TINY.replace("speed", "speeed"), ["robots[1].speeed", "did you mean 'speed'"]),
    "wrong type": (TINY.replace("speed: 0.5", "speed: fast"), ["robots[1].speed"]),
    "too small": (TINY.replace("speed: 0.5", "speed: 0"), ["robots[1].speed", "above 0"]),
    "in a wall": (TINY.replace("[2, 8]", "[5, 2]"), ["tasks[1].visit", "map.walls[0]"]),
    "outside": (TINY.replace("[2, 8]", "[2, 80]"), ["tasks[1].visit", "bounds"]),
    "a place": (TINY.replace("delivery: dock", "delivery: dok"), ["dok", "did you mean 'dock'"]),
    "twice": (TINY.replace("id: r2", "id: r1"), ["robots[1].id", "r1"]),
    "schema": (TINY + "    schema: oath/mission/9", ["oath/mission/9", "oath/mission/1"]),
    "rule": (
        TINY + '    rules: ["G !lb"]\n    zones: {lab: [[8, 8], [9, 8], [9, 9]]}',
        ["rules[0]"],
    ),
    "no rule": (TINY + '    rules: ["G !("]', ["rules[0]"]),
    "contradiction": (TINY + '    rules: ["F dock", "G !dock"]', ["rules", "contradict"]),
    "map file": (TINY.replace("map: {", "map: {file: no.yaml, "), ["no.yaml"]),
}
"""Mission files, and what the error must speak of; those of rules are found when it is prepared."""


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("command", ["run", "plan", "check", "map"])
def test_bad_missions(name: str, command: str, write: Write, tmp_path: Path) -> None:
    text, words = BAD[name]
    mission = write(text)
    out = tmp_path / "out"
    more = ["--out", out] if command == "run" else []
    check_bad(oath_(command, mission, "--points", 50, *more), str(mission), *words)
    assert not out.exists()


def test_a_mission_that_cannot_be_done_from_the_start_is_bad_input(
    write: Write, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    for command in (["run", "--out", out], ["plan"]):
        result = oath_(*command, write(WALLED), "--points", 100)
        check_bad(result, str(tmp_path / "mission.yaml"), "tasks[0]", "'in'", "out of reach")
    assert not out.exists()


def test_bad_input_leaves_an_earlier_run_as_it_was(write: Write, tmp_path: Path) -> None:
    out = tmp_path / "out"
    oath_("run", write(TINY), "--out", out, "--points", 100)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    for mission in (write(BAD["unknown key"][0]), write(WALLED), write(BAD["contradiction"][0])):
        assert oath_("run", mission, "--out", out, "--points", 100).exit_code == 2
        assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize("command", ["run", "plan", "check", "map"])
def test_missing_missions_and_folders(command: str, tmp_path: Path) -> None:
    check_bad(oath_(command, tmp_path / "no.yaml"), str(tmp_path / "no.yaml"), "no such file")
    check_bad(oath_(command, tmp_path), str(tmp_path), "directory")


def test_verify_refuses_what_is_no_log(good_log: tuple[Path, list[str]], tmp_path: Path) -> None:
    mission, lines = good_log
    check_bad(oath_("verify", mission, tmp_path / "no.jsonl"), "no.jsonl", "no such file")
    check_bad(oath_("verify", mission, tmp_path), "directory")
    check_bad(oath_("verify", tmp_path / "no.yaml", mission), "no.yaml", "no such file")
    path = tmp_path / "events.jsonl"
    for broken in (["{"], [*lines[:3], lines[3][:-5]], [lines[0], *lines[2:]], ["[]"], ["\x00"]):
        path.write_text("\n".join(broken) + "\n")
        check_bad(oath_("verify", mission, path), str(path))


def test_unknown_allocators(write: Write, tmp_path: Path) -> None:
    for command in (["run", "--out", tmp_path / "out"], ["plan"]):
        result = oath_(*command, write(TINY), "--allocator", "oaht")
        check_bad(result, "allocator 'oaht'", "did you mean 'oath'")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "options",
    [
        ["--budget", "soon"],
        ["--budget", "-1s"],
        ["--budget", "10"],
        ["--budget", "1e400s"],
        ["--points", "0"],
        ["--points", "many"],
        ["--seed", "-1"],
        ["--no-such-option"],
    ],
)
@pytest.mark.parametrize("command", ["run", "plan"])
def test_bad_options(command: str, options: list[str], write: Write) -> None:
    result = oath_(command, write(TINY), *options)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert options[0].lstrip("-") in result.stderr


def test_unknown_commands_and_missing_arguments() -> None:
    for args in (["rum"], ["run"], ["verify", MAZE]):
        result = oath_(*args)
        assert result.exit_code == 2
        assert result.stdout == ""


@pytest.mark.parametrize("command", ["run", "map"])
def test_a_place_that_cannot_be_written_to(command: str, write: Write, tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("mine")
    option = "--out" if command == "run" else "--png"
    result = oath_(command, write(TINY), "--points", 50, option, blocker / "inside.png")
    check_bad(result, str(blocker))
    assert blocker.read_text() == "mine"


def test_out_may_not_be_a_file(write: Write, tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("mine")
    result = oath_("run", write(TINY), "--points", 50, "--out", blocker)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert blocker.read_text() == "mine"


# --- As a process ---------------------------------------------------------------------------


def test_the_program_as_a_process(write: Write, tmp_path: Path) -> None:
    done = real("run", write(TINY), "--json", "--points", 100, "--out", tmp_path / "out")
    assert (done.returncode, done.stderr) == (0, "")
    check_shape(json.loads(done.stdout), SUMMARY)
    assert real("run", write(SHUT), "--points", 100).returncode == 1
    check_bad(real("run", tmp_path / "no.yaml"), "no such file")


def test_a_reader_that_goes_away_is_no_error_message(write: Write) -> None:
    command = [sys.executable, "-m", "oath.cli", "plan", str(write(TINY)), "--points", "50"]
    read, write_end = os.pipe()
    os.close(read)
    try:
        done = subprocess.run(
            command, stdout=write_end, stderr=subprocess.PIPE, text=True, check=False
        )
    finally:
        os.close(write_end)
    assert done.stderr == ""
    assert done.returncode in (0, 1)


def test_answers_in_any_locale(write: Write) -> None:
    named = TINY.replace("name: tiny", "name: Größe 机")
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    for options in ([], ["--json"]):
        done = real("run", write(named), "--points", 50, *options, env=environment)
        assert done.returncode == 0, done.stderr
        assert "Traceback" not in done.stderr


@pytest.mark.parametrize(("rule", "warned"), [("F box", 2), ("!dock W box", 0)])
def test_check_warns_of_rules_that_oblige_robots(rule: str, warned: int, write: Write) -> None:
    mission = write(TINY + f"    rules: ['{rule}']\n")
    warnings = json_of(oath_("check", mission, "--json", "--points", 100))["warnings"]
    assert sum("breaks the rules if it is given no task" in line for line in warnings) == warned
