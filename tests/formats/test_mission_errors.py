"""Every kind of bad mission gives one error that names file, field, value and remedy."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from oath.errors import BadInput
from oath.formats.mission import load

BASE: dict[str, Any] = {
    "schema": "oath/mission/1",
    "name": "base",
    "map": {
        "bounds": [0, 0, 10, 10],
        "walls": [[[5, 0], [5, 4]]],
        "wall_thickness": 0.2,
        "obstacles": [
            {"id": "bush-1", "kind": "bush", "polygon": [[7, 7], [8, 7], [8, 8], [7, 8]]},
            {
                "id": "gate-1",
                "kind": "gate",
                "polygon": [[1, 7], [2, 7], [2, 8], [1, 8]],
                "known": False,
            },
        ],
    },
    "motions": {"ground": {}, "drone": {"ignores": ["bush"], "cost": {"gate": 2.0}}},
    "places": {"dock": [1, 1], "shelf": [9, 9]},
    "task_types": ["normal", "special"],
    "robots": [
        {"id": "r1", "start": [1, 2], "motion": "ground", "can": ["normal"], "capacity": 3},
        {"id": "r2", "start": [3, 2], "motion": "drone", "can": {"normal": 1.0, "special": 0.5}},
    ],
    "tasks": [
        {"id": "t1", "pickup": [2, 2], "delivery": "dock", "type": "normal"},
        {"id": "t2", "visit": "shelf", "type": "special", "priority": "high", "service_time": 5},
    ],
    "zones": {"lab": [[8, 0], [10, 0], [10, 2], [8, 2]]},
    "rules": ["G !lab"],
}

GONE = object()


def edited(*edits: tuple[str, Any]) -> dict[str, Any]:
    """Return the base mission with values set (or removed) at dotted paths."""
    mission = copy.deepcopy(BASE)
    for path, value in edits:
        *way, last = [int(step) if step.isdigit() else step for step in path.split("/")]
        at: Any = mission
        for step in way:
            at = at[step]
        if value is GONE:
            del at[last]
        elif isinstance(at, list) and last == len(at):
            at.append(value)
        else:
            at[last] = value
    return mission


def error_of(path: Path) -> BadInput:
    with pytest.raises(BadInput) as caught:
        load(path)
    return caught.value


def write(folder: Path, mission: object) -> Path:
    path = folder / "m.yaml"
    path.write_text(yaml.safe_dump(mission, sort_keys=False))
    return path


INF, NAN = float("inf"), float("nan")
BOWTIE = [[0, 0], [2, 2], [2, 0], [0, 2]]

# what to edit, the field, what the problem must say, what the remedy must say
CASES: list[tuple[list[tuple[str, Any]], str, list[str], str]] = [
    # keys and shapes
    ([("robts", [])], "robts", ["unknown key 'robts'"], "did you mean 'robots'?"),
    ([("robots/1/spede", 1)], "robots[1].spede", ["'r2'", "'spede'"], "'speed'"),
    ([("map/wals", [])], "map.wals", ["unknown key"], "'walls'"),
    ([("map/obstacles/0/kin", "x")], "map.obstacles[0].kin", ["'bush-1'"], "'kind'"),
    ([("motions/drone/ignore", [])], "motions.drone.ignore", ["'drone'"], "'ignores'"),
    ([("tasks/0/prio", "low")], "tasks[0].prio", ["'t1'", "unknown key"], "priority"),
    ([("robots/0/start", GONE)], "robots[0].start", ["'r1'", "missing"], "add `start"),
    (
        [("robots/0/start", GONE), ("robots/0/strat", [1, 1])],
        "robots[0].strat",
        ["unknown key 'strat'", "1 more problem"],
        "'start'",
    ),
    ([("robots/0/id", GONE)], "robots[0].id", ["missing"], "add"),
    ([("robots", GONE)], "robots", ["missing"], "add"),
    ([("robots", [])], "", ["at least 1 robot"], "add a robot"),
    ([("robots", None)], "", ["at least 1 robot"], "add a robot"),
    ([("robots", {"r1": {}})], "robots", ["must be a list"], "write ["),
    ([("robots/0", "r1")], "robots[0]", ["'r1'", "must be a mapping"], "key: value"),
    ([("map", "office.yaml")], "map", ["'office.yaml'", "mapping"], "key: value"),
    ([("tasks", "t1")], "tasks", ["'t1'", "list"], "write ["),
    ([("places", [1, 2])], "places", ["[1, 2]", "mapping"], "key: value"),
    ([("schema", "oath/mission/2")], "schema", ["'oath/mission/2'"], "oath/mission/1"),
    ([("schema", 1)], "schema", ["unknown schema 1"], "oath/mission/1"),
    ([("name", 7)], "name", ["7 is not text"], "quotes"),
    # numbers
    ([("robots/0/speed", 0)], "robots[0].speed", ["'r1'", "speed 0", "above 0 m/s"], "positive"),
    ([("robots/0/speed", -1)], "robots[0].speed", ["speed -1"], "m/s"),
    ([("robots/0/speed", "fast")], "robots[0].speed", ["'fast'", "a number"], "quotes"),
    ([("robots/0/speed", True)], "robots[0].speed", ["true", "a number"], "number"),
    ([("robots/0/speed", NAN)], "robots[0].speed", ["nan", "finite"], "finite"),
    ([("robots/0/speed", INF)], "robots[0].speed", ["inf", "finite"], "finite"),
    ([("robots/0/speed", 1e300)], "robots[0].speed", ["1e+300", "1e+08"], "unit"),
    ([("robots/0/speed", 10**90)], "robots[0].speed", ["within"], "unit"),
    ([("robots/0/speed", 1e-9)], "robots[0].speed", ["1e-09", "at least 1e-06"], "positive"),
    ([("robots/0/radius", 0)], "robots[0].radius", ["radius 0", "above 0 m"], "positive"),
    ([("robots/0/radius", -0.2)], "robots[0].radius", ["-0.2"], "positive"),
    ([("robots/0/sensing", -1)], "robots[0].sensing", ["sensing -1"], "positive"),
    ([("robots/0/capacity", 0)], "robots[0].capacity", ["capacity 0"], "1, 2"),
    ([("robots/0/capacity", -2)], "robots[0].capacity", ["capacity -2"], "1, 2"),
    ([("robots/0/capacity", 1.5)], "robots[0].capacity", ["1.5", "whole"], "1, 2"),
    ([("robots/0/capacity", True)], "robots[0].capacity", ["true", "whole"], "1, 2"),
    ([("map/wall_thickness", 0)], "map.wall_thickness", ["wall_thickness 0"], "positive"),
    ([("map/wall_thickness", -1)], "map.wall_thickness", ["wall_thickness -1"], "positive"),
    ([("tasks/1/service_time", -5)], "tasks[1].service_time", ["'t2'", "-5"], "valid number"),
    ([("robots/1/can/special", 0)], "robots[1].can.special", ["'r2'", "0 must be above 0"], ""),
    ([("robots/1/can/special", 1.1)], "robots[1].can.special", ["1.1", "at most 1"], ""),
    ([("motions/drone/cost/gate", 0.5)], "motions.drone.cost.gate", ["0.5", "least 1"], ""),
    # points and outlines
    ([("robots/0/start", [1])], "robots[0].start", ["[1]", "point [x, y]"], "two numbers"),
    ([("robots/0/start", "dock")], "robots[0].start", ["'dock'", "point"], "two numbers"),
    ([("robots/0/start", [1, NAN])], "robots[0].start", ["nan"], "finite"),
    ([("places/dock", [1, "2"])], "places.dock", ["place 'dock'", "'2'"], "number"),
    ([("tasks/0/pickup", 3)], "tasks[0].pickup", ["3", "place's name or a point"], "name"),
    ([("tasks/0/pickup", [1, 2, 3])], "tasks[0].pickup", ["[1, 2, 3]"], "two numbers"),
    ([("map/bounds", [0, 0, 10])], "map.bounds", ["four numbers"], "x_min"),
    ([("map/bounds", [10, 0, 0, 10])], "map.bounds", ["x_min 10", "x_max 0"], "x_min"),
    ([("map/bounds", [0, 5, 10, 5])], "map.bounds", ["y_min 5", "y_max 5"], "x_min"),
    ([("map/bounds", [0, 0, INF, 5])], "map.bounds", ["inf"], "finite"),
    ([("map/walls/0", [[1, 1]])], "map.walls[0]", ["fewer than 2"], "both ends"),
    ([("map/walls/0", [[1, 1], [1, 1]])], "map.walls[0]", ["fewer than 2"], "both ends"),
    ([("map/walls", [1, 2])], "map.walls[0]", ["list of points"], "[x, y]"),
    ([("zones/lab", [[0, 0], [1, 1]])], "zones.lab", ["'lab'", "fewer than 3"], "3 corners"),
    ([("zones/lab", [[0, 0], [1, 1], [2, 2]])], "zones.lab", ["no area"], "one line"),
    ([("zones/lab", BOWTIE)], "zones.lab", ["crosses", "[1 1]"], "in order"),
    (
        [("map/obstacles/0/polygon", BOWTIE)],
        "map.obstacles[0].polygon",
        ["obstacle 'bush-1'", "crosses"],
        "in order",
    ),
    # words
    ([("robots/0/id", 1)], "robots[0].id", ["1 is not text"], 'quotes: "1"'),
    ([("robots/0/id", False)], "robots[0].id", ["boolean"], "quotes"),
    ([("robots/0/id", "")], "robots[0].id", ["is empty"], "write"),
    ([("robots/0/id", " a")], "robots[0].id", ["' a'", "spaces"], "remove"),
    ([("robots/0/id", "a" * 101)], "robots[0].id", ["longer than 100"], "shorten"),
    ([("tasks/0/id", 12)], "tasks[0].id", ["12 is not text"], "quotes"),
    ([("tasks/1/priority", "hihg")], "tasks[1].priority", ["'hihg'"], "'high'"),
    ([("tasks/1/priority", 1)], "tasks[1].priority", ["1", "low, normal, high"], "known"),
    ([("map/obstacles/1/known", "no")], "map.obstacles[1].known", ["'no'", "true or"], "quotes"),
    ([("robots/0/can", "normal")], "robots[0].can", ["'normal'", "a list"], "[type"),
    ([("robots/0/can", [1])], "robots[0].can", ["1 is not text"], "quotes"),
    ([("rules/0", 3)], "rules[0]", ["rule 0", "3 is not text"], "quotes"),
    ([("rules/0", {"G": "!lab"})], "rules[0]", ["must be text"], "quotes"),
    ([("rules", "G !lab")], "rules", ["'G !lab'", "list"], "write ["),
    ([("rules/0", " ")], "rules[0]", ["is empty"], "write"),
    ([("task_types", "normal")], "task_types", ["'normal'", "list"], "[name"),
    # names
    ([("robots/1/id", "r1")], "robots[1].id", ["'r1'", "taken"], "rename"),
    ([("tasks/1/id", "t1")], "tasks[1].id", ["'t1'", "taken"], "rename"),
    ([("map/obstacles/1/id", "bush-1")], "map.obstacles[1].id", ["'bush-1'"], "rename"),
    ([("task_types/1", "normal")], "task_types[1]", ["'normal'", "taken"], "rename"),
    ([("tasks/0/id", "dock")], "tasks[0].id", ["'dock'", "share"], "rename"),
    ([("tasks/0/id", "lab")], "tasks[0].id", ["'lab'", "share"], "rename"),
    ([("places/lab", [1, 1])], "places.lab", ["'lab'", "share"], "rename"),
    ([("robots/0/motion", "grund")], "robots[0].motion", ["'grund'"], "'ground'"),
    ([("tasks/0/delivery", "dok")], "tasks[0].delivery", ["'t1'", "'dok'"], "'dock'"),
    ([("tasks/0/type", "norml")], "tasks[0].type", ["'t1'", "'norml'"], "'normal'"),
    ([("robots/0/can", ["norml"])], "robots[0].can", ["'r1'", "'norml'"], "'normal'"),
    (
        [("motions/drone/cost/bush", 2)],
        "motions.drone",
        ["'drone'", "'bush'", "both"],
        "remove it",
    ),
    ([("motions/drone/ignores", ["wall"])], "motions.drone.ignores", ["'wall'"], "every motion"),
    ([("motions/drone/cost/wall", 2)], "motions.drone.cost.wall", ["'wall'"], "every motion"),
    ([("motions/drone/ignores", "bush")], "motions.drone.ignores", ["'bush'", "list"], "[kind"),
    # stops
    ([("tasks/0/delivery", GONE)], "tasks[0]", ["'t1'", "pickup"], "pickup and delivery"),
    ([("tasks/0/visit", [1, 1])], "tasks[0]", ["visit"], "or visit"),
    ([("tasks/1/visit", GONE)], "tasks[1]", ["(none)"], "or visit"),
    # a task nobody can do
    ([("robots/1/can", ["normal"])], "tasks[1].type", ["'t2'", "'special'"], "`can`"),
    # places in the world
    ([("places/dock", [-1, 1])], "places.dock", ["[-1, 1]", "[0, 0, 10, 10]"], "map.bounds"),
    ([("robots/0/start", [1, 11])], "robots[0].start", ["'r1'", "outside"], "inside"),
    ([("tasks/0/pickup", [10.1, 1])], "tasks[0].pickup", ["'t1'", "10.1"], "inside"),
    ([("robots/0/start", [5, 2])], "robots[0].start", ["lies in map.walls[0]"], "move"),
    (
        [("robots/0/start", [5.22, 2])],
        "robots[0].start",
        ["clearance 0.12 m", "radius 0.2 m", "'r1'"],
        "radius",
    ),
    ([("robots/0/start", [7.5, 7.5])], "robots[0].start", ["'bush-1'"], "move"),
    ([("robots/0/start", [1.5, 7.5])], "robots[0].start", ["'gate-1'"], "move"),
    ([("robots/0/start", [2.1, 7.5])], "robots[0].start", ["clearance 0.1 m"], "move"),
    ([("tasks/0/pickup", [5, 2])], "tasks[0].pickup", ["'t1'", "lies in map.walls[0]"], "move"),
    (
        [("tasks/0/pickup", [5.22, 2])],
        "tasks[0].pickup",
        ["clearance 0.12 m is below the radius 0.2 m of robot 'r1'", "no other robot"],
        "move the stop",
    ),
    ([("places/dock", [5, 4.25])], "tasks[0].delivery", ["'dock'", "0.15 m"], "move"),
    (
        [("tasks/1/visit", [7.5, 7.5]), ("robots/1/motion", "ground")],
        "tasks[1].visit",
        ["'t2'", "'bush-1'"],
        "move",
    ),
    # map files
    ([("map/file", "no.yaml")], "map.file", ["'no.yaml'", "no such file"], "relative"),
    ([("map/file", "no.txt")], "map.file", ["suffix '.txt'"], ".yaml"),
    ([("map/file", "d.map")], "map.file", ["'d.map'"], "relative"),
    ([("map/file", "a\0b.map")], "map.file", ["no such file"], "relative"),
    ([("map/file", "x" * 5000 + ".map")], "map.file", ["no such file"], "relative"),
    ([("map/file", 3)], "map.file", ["3 is not text"], "quotes"),
    ([("map/file", "small.map")], "map.bounds", ["[0, 0, 10, 10]", "[0, 0, 2, 2]"], "shrink"),
]


def case_id(case: tuple[list[tuple[str, Any]], str, list[str], str]) -> str:
    return ",".join(f"{path}={'-' if value is GONE else value}"[:40] for path, value in case[0])


@pytest.mark.parametrize("case", CASES, ids=case_id)
def test_bad_value_gives_one_clear_error(
    case: tuple[list[tuple[str, Any]], str, list[str], str], tmp_path: Path
) -> None:
    edits, field, parts, remedy = case
    (tmp_path / "d.map").mkdir()
    (tmp_path / "small.map").write_text("type octile\nheight 2\nwidth 2\nmap\n..\n..\n")
    path = write(tmp_path, edited(*edits))
    error = error_of(path)
    assert (error.field or "") == field
    assert error.file is not None
    assert re.fullmatch(re.escape(str(path)) + r":\d+", error.file)
    for part in parts:
        assert part in error.problem
    assert remedy in error.remedy
    assert error.remedy
    assert "\n" not in str(error)


TEXTS: list[tuple[str, bytes, str, str]] = [
    ("empty", b"", "is empty", "write a mission"),
    ("only a comment", b"# nothing\n", "is empty", "write a mission"),
    ("a list", b"- 1\n", "list, not a mapping", "key: value"),
    ("a word", b"hello\n", "single value, not a mapping", "key: value"),
    ("not YAML", b"robots: [1,\n", "is not YAML", "brackets"),
    ("tabs", b"robots:\n\t- id: a\n", "is not YAML", "indentation"),
    ("junk", bytes(range(256)), "UTF-8", "UTF-8"),
    ("zeros", b"\0" * 64, "is not YAML", "check"),
    ("Latin-1", "name: Büro\n".encode("latin-1"), "byte 7 is 0xfc", "UTF-8"),
    ("UTF-16", "name: x\n".encode("utf-16"), "UTF-8", "UTF-8"),
    ("two documents", b"a: 1\n---\nb: 2\n", "is not YAML", "check"),
    ("same key twice", b"name: a\nname: b\n", "'name' appears twice", "rename"),
    ("key no", b"places:\n  no: [1, 1]\n", "the key no is a boolean", 'quotes: "no"'),
    ("key on", b"on: 1\n", "the key on is a boolean", 'quotes: "on"'),
    ("key 1", b"places: {1: [1, 1]}\n", "the key 1 is a number", 'quotes: "1"'),
    ("key list", b"? [1]\n: 2\n", "a key is a list", "text"),
    ("unknown alias", b"name: *a\n", "is not YAML", "check"),
    ("own alias", b"name: &a [*a]\n", "alias", "write"),
    ("deep", b"name: " + b"[" * 100_000, "deeper than 40", "flatten"),
    ("python tag", b"name: !!python/name:os.system x\n", "os.system", "quotes"),
    ("set tag", b"name: !!set {a}\n", "tag", "remove"),
    ("bad date", b"name: 2024-13-45\n", "'2024-13-45'", "quotes"),
    ("date", b"robots: [{id: 2024-01-01, start: [1, 1]}]\n", "2024-01-01 is not", "quotes"),
    ("long number", b"name: " + b"1" * 5000, "more than 100", "shorten"),
    (
        "alias bomb",
        b"a: &a [1]\n"
        + b"".join(
            b"%c: &%c [%b]\n" % (c, c, b",".join([b"*%c" % (c - 1)] * 50)) for c in b"bcdefg"
        ),
        "aliases add more than",
        "write",
    ),
]


@pytest.mark.parametrize("case", TEXTS, ids=lambda case: case[0])
def test_text_that_is_no_mission(case: tuple[str, bytes, str, str], tmp_path: Path) -> None:
    _, text, problem, remedy = case
    path = tmp_path / "m.yaml"
    path.write_bytes(text)
    error = error_of(path)
    assert error.file is not None
    assert error.file.startswith(str(path))
    assert problem in error.problem
    assert remedy in error.remedy


def test_missing_file_and_folder(tmp_path: Path) -> None:
    assert "no such file" in error_of(tmp_path / "no.yaml").problem
    assert "is a directory" in error_of(tmp_path).problem
    assert "cannot be read" in error_of(Path("a\0b")).problem


def test_the_line_is_named(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(
        "robots:\n  - {id: a, start: [1, 1]}\n  - id: b\n    start: [2, 1]\n    speed: 0\n"
    )
    assert str(error_of(path)) == (
        f"{path}:5: robots[1].speed: robot 'b': speed 0 must be above 0 m/s; "
        "give a positive number of m/s"
    )


def test_the_line_is_named_through_a_merged_mapping(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("robots:\n- &r\n  id: a\n  start: [1, 1]\n- {<<: *r, id: b, sped: 1}\n")
    assert error_of(path).file == f"{path}:5"
    path.write_text("robots:\n- &r\n  id: a\n  start: [1, 1]\n- {<<: *r}\n")
    assert "'a' is taken already in line 3" in error_of(path).problem


def test_more_problems_are_counted(tmp_path: Path) -> None:
    mission = edited(("robots/0/speed", 0), ("robots/1/speed", 0), ("tasks/0/id", 4))
    assert "(and 2 more problems in this file)" in error_of(write(tmp_path, mission)).problem


def test_different_stops_block_different_robots(tmp_path: Path) -> None:
    """One robot serves the whole task: that each stop suits some robot is not enough."""
    mission = edited(
        ("robots/0/radius", 0.1),
        ("robots/0/motion", "ground"),
        ("tasks/0/pickup", [5.22, 2]),
        ("tasks/0/delivery", [7.5, 7.5]),
    )
    error = error_of(write(tmp_path, mission))
    assert error.field == "tasks[0].delivery"
    assert "'bush-1'" in error.problem
    assert "no other robot" in error.problem


PATHS = [
    "schema", "name", "map", "map/bounds", "map/bounds/0", "map/walls", "map/walls/0",
    "map/walls/0/0", "map/wall_thickness", "map/file", "map/obstacles", "map/obstacles/0",
    "map/obstacles/0/polygon", "map/obstacles/0/known", "motions", "motions/drone",
    "motions/drone/ignores", "motions/drone/cost", "places", "places/dock", "task_types", "robots",
    "robots/0", "robots/0/id", "robots/0/start", "robots/0/motion", "robots/0/can",
    "robots/1/can/special", "robots/0/capacity", "robots/0/speed", "robots/0/radius",
    "robots/0/sensing", "tasks", "tasks/0", "tasks/0/id", "tasks/0/pickup", "tasks/0/delivery",
    "tasks/0/visit", "tasks/1/type", "tasks/1/service_time", "zones", "zones/lab", "rules",
    "rules/0",
]  # fmt: skip

scalars = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["dock", "normal", "ground", "m.yaml", "no.map", 1e-7, 1e8, 0, 1, 3, 5])
)
anything = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=8,
)
coordinates = st.lists(st.lists(st.floats(-1e9, 1e9), min_size=2, max_size=2), max_size=6)


@settings(
    max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(edits=st.lists(st.tuples(st.sampled_from(PATHS), anything | coordinates), max_size=2))
def test_any_mutation_loads_or_is_bad_input(edits: list[tuple[str, Any]], tmp_path: Path) -> None:
    try:
        mission = edited(*edits)
    except (TypeError, LookupError):
        return  # an earlier edit removed what a later one edits
    path = tmp_path / "m.yaml"
    path.write_text(yaml.safe_dump(mission, allow_unicode=False))
    try:
        load(path)
    except BadInput as error:
        assert error.file
        assert error.remedy


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    text=st.binary(max_size=200) | st.text(max_size=200).map(lambda t: t.encode(errors="replace"))
)
def test_any_bytes_are_bad_input(text: bytes, tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_bytes(text)
    assert error_of(path).file


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_any_damaged_text_loads_or_is_bad_input(data: st.DataObject, tmp_path: Path) -> None:
    text = yaml.safe_dump(BASE, sort_keys=False, default_flow_style=None).encode()
    at = data.draw(st.integers(0, len(text)))
    until = data.draw(st.integers(at, min(at + 5, len(text))))
    path = tmp_path / "m.yaml"
    path.write_bytes(text[:at] + data.draw(st.binary(max_size=3)) + text[until:])
    try:
        load(path)
    except BadInput as error:
        assert error.file
