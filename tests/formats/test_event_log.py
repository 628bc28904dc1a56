"""Events survive the log unchanged, and a damaged log is named as such."""

from __future__ import annotations

import json
import math
from dataclasses import fields as dataclass_fields
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from oath.errors import BadInput
from oath.events import (
    Allocated,
    AnyEvent,
    Commanded,
    MissionFinished,
    MissionStarted,
    Moved,
    ObstacleAdded,
    ObstacleFound,
    ObstacleRemoved,
    Planned,
    PriorityChanged,
    RobotFailed,
    RobotPaused,
    RobotResumed,
    StopServed,
    TaskAdded,
    TaskCancelled,
)
from oath.formats.event_log import TYPES, read, to_line
from oath.model import RouteStop, Stop, Task

TASK = Task(
    id="aa",
    type="special",
    stops=(Stop(name="pickup", at=(5, 19.5)), Stop(name="delivery", at=(5, 16), place="c")),
)

LINES: list[tuple[AnyEvent, str]] = [
    (
        MissionStarted(t=0, mission="maze-25", allocator="lns", seed=7),
        '"type":"mission_started","schema":"oath/events/1","mission":"maze-25","allocator":"lns","seed":7}',
    ),
    (
        Allocated(
            t=0,
            round=1,
            seconds=0.5,
            routes={"r2": (RouteStop(task="bb", stop="pickup"),), "r1": ()},
            unassigned={"x": "no robot"},
        ),
        '"type":"allocated","round":1,"seconds":0.5,"routes":{"r2":[{"task":"bb","stop":"pickup"}],'
        '"r1":[]},"unassigned":{"x":"no robot"}}',
    ),
    (
        Planned(t=0, robot="r1", seconds=0.25, length=12.5, reason="allocated"),
        '"type":"planned","robot":"r1","seconds":0.25,"length":12.5,"reason":"allocated"}',
    ),
    (
        Planned(t=0, robot="r1", seconds=0, length=None, reason="obstacle", unreachable="bb"),
        '"type":"planned","robot":"r1","seconds":0.0,"length":null,"reason":"obstacle",'
        '"unreachable":"bb"}',
    ),
    (
        Moved(t=0, robot="r1", from_=(1, 19), to=(1.4, 18.6), start=0, end=0.57),
        '"type":"moved","robot":"r1","from":[1.0,19.0],"to":[1.4,18.6],"start":0.0,"end":0.57}',
    ),
    (
        StopServed(t=0, robot="r1", task="bb", stop="visit", at=(1, 4)),
        '"type":"stop_served","robot":"r1","task":"bb","stop":"visit","at":[1.0,4.0]}',
    ),
    (
        ObstacleFound(t=0, robot="r1", obstacle="bush-1", polygon=((3, 8), (4, 8), (4, 9))),
        '"type":"obstacle_found","robot":"r1","obstacle":"bush-1",'
        '"polygon":[[3.0,8.0],[4.0,8.0],[4.0,9.0]]}',
    ),
    (
        Commanded(t=0, command={"intent": "undo", "parameters": {"n": 1}}, source="operator"),
        '"type":"commanded","command":{"intent":"undo","parameters":{"n":1}},"source":"operator"}',
    ),
    (
        TaskAdded(t=0, task=TASK),
        '"type":"task_added","task":{"id":"aa","pickup":[5.0,19.5],"delivery":"c",'
        '"delivery_at":[5.0,16.0],"type":"special","priority":"normal"}}',
    ),
    (
        TaskAdded(
            t=0, task=replace(TASK, stops=(Stop(name="visit", at=(1, 2)),), service_time=5)
        ),
        '"type":"task_added","task":{"id":"aa","visit":[1.0,2.0],"type":"special",'
        '"priority":"normal","service_time":5.0}}',
    ),
    (TaskCancelled(t=0, task="aa"), '"type":"task_cancelled","task":"aa"}'),
    (
        PriorityChanged(t=0, task="aa", priority="high"),
        '"type":"priority_changed","task":"aa","priority":"high"}',
    ),
    (
        ObstacleAdded(t=0, obstacle="w", kind="wall", polygon=((7, 5), (8, 5), (8, 4.8))),
        '"type":"obstacle_added","obstacle":"w","kind":"wall","polygon":[[7.0,5.0],[8.0,5.0],[8.0,4.8]]}',
    ),
    (ObstacleRemoved(t=0, obstacle="w"), '"type":"obstacle_removed","obstacle":"w"}'),
    (RobotFailed(t=0, robot="r1"), '"type":"robot_failed","robot":"r1"}'),
    (RobotPaused(t=0, robot="r1"), '"type":"robot_paused","robot":"r1"}'),
    (RobotResumed(t=0, robot="r1"), '"type":"robot_resumed","robot":"r1"}'),
    (MissionFinished(t=0, summary={"n": 1}), '"type":"mission_finished","summary":{"n":1}}'),
]  # fmt: skip


def write(folder: Path, *lines: str) -> Path:
    path = folder / "events.jsonl"
    path.write_text("".join(line + "\n" for line in lines))
    return path


@pytest.mark.parametrize(("event", "line"), LINES, ids=lambda value: getattr(value, "type", ""))
def test_known_lines(event: AnyEvent, line: str, tmp_path: Path) -> None:
    assert to_line(0, event) == '{"seq":0,"t":0.0,' + line
    assert read(write(tmp_path, to_line(0, event))) == [(0, event)]


def test_every_event_type_has_a_known_line() -> None:
    assert {event.type for event, _ in LINES} == set(TYPES)


names = st.text(max_size=5)
numbers = st.floats(allow_nan=False, allow_infinity=False)
xy = st.tuples(numbers, numbers)
polygons = st.lists(xy, min_size=3, max_size=5).map(tuple)
stop_names = st.sampled_from(["pickup", "delivery", "visit"])
priorities = st.sampled_from(["low", "normal", "high"])
routes = st.lists(st.builds(RouteStop, task=names, stop=stop_names), max_size=3).map(tuple)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | numbers | names,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3),
    max_leaves=5,
)
json_objects = st.dictionaries(names, json_values, max_size=3)


@st.composite
def tasks(draw: st.DrawFn) -> Task:
    wanted = draw(st.sampled_from([("pickup", "delivery"), ("visit",)]))
    place = st.none() | names
    stops = tuple(Stop(name=name, at=draw(xy), place=draw(place)) for name in wanted)
    return Task(
        id=draw(names),
        type=draw(names),
        stops=stops,
        priority=draw(priorities),
        service_time=draw(st.floats(0, 1e6)),
    )


KINDS: dict[str, st.SearchStrategy[Any]] = {
    "polygon": polygons,
    "at": xy,
    "from_": xy,
    "to": xy,
    "stop": stop_names,
    "priority": priorities,
    "reason": st.sampled_from(["allocated", "obstacle", "command"]),
    "routes": st.dictionaries(names, routes, max_size=3),
    "unassigned": st.dictionaries(names, names, max_size=3),
    "command": json_objects,
    "summary": json_objects,
    "round": st.integers(),
    "seed": st.integers(),
    "length": st.none() | numbers,
    "unreachable": st.none() | names,
}
NUMBERS = ("t", "seconds", "start", "end")


def events_of(type: type[AnyEvent]) -> st.SearchStrategy[AnyEvent]:
    fields: dict[str, st.SearchStrategy[Any]] = {}
    for name in (field.name for field in dataclass_fields(type)):
        other = tasks() if name == "task" and type is TaskAdded else names
        fields[name] = numbers if name in NUMBERS else KINDS.get(name, other)
    return st.builds(type, **fields)


events = st.one_of([events_of(type) for type in TYPES.values()])


@settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(log=st.lists(events, max_size=4))
def test_round_trip(log: list[AnyEvent], tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    lines = [to_line(seq, event) for seq, event in enumerate(log)]
    path.write_text("".join(line + "\n" for line in lines))
    found = read(path)
    assert found == list(enumerate(log))
    assert [to_line(seq, event) for seq, event in found] == lines
    for (_, event), original in zip(found, log, strict=True):
        for name in ("routes", "unassigned"):  # a replay must not see another order of robots
            if hasattr(original, name):
                assert list(getattr(event, name)) == list(getattr(original, name))


def test_an_empty_log_has_no_events(tmp_path: Path) -> None:
    assert read(write(tmp_path)) == []


def test_the_last_line_break_may_be_missing(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    path.write_text(to_line(0, RobotPaused(t=0, robot="a")))
    assert len(read(str(path))) == 1


def test_a_place_s_name_needs_coordinates_from_somewhere(tmp_path: Path) -> None:
    task = {"id": "a", "pickup": [1, 2], "delivery": "c", "type": "normal"}
    line = json.dumps({"seq": 0, "t": 0, "type": "task_added", "task": task})
    path = write(tmp_path, line)
    [(_, event)] = read(path, places={"c": (5.0, 16.0)})
    assert isinstance(event, TaskAdded)
    assert event.task.stop("delivery") == Stop(name="delivery", at=(5, 16), place="c")
    assert event.task.priority == "normal"
    with pytest.raises(BadInput) as caught:
        read(path)
    assert caught.value.field == "task.delivery"
    assert "'delivery_at'" in caught.value.remedy


@pytest.mark.parametrize(
    "event",
    [
        RobotPaused(t=math.nan, robot="a"),
        Moved(t=0, robot="a", from_=(0, math.inf), to=(0, 0), start=0, end=1),
        MissionFinished(t=0, summary={"x": math.nan}),
        MissionFinished(t=0, summary={"x": object()}),
        MissionFinished(t=0, summary={"x": {1: 2}}),
    ],
)
def test_what_json_cannot_say_is_not_written(event: AnyEvent) -> None:
    with pytest.raises(BadInput):
        to_line(0, event)


GOOD = to_line(0, RobotPaused(t=0, robot="a"))
MOVED = to_line(0, LINES[4][0])
ROUTED = to_line(0, LINES[1][0])
ADDED = to_line(0, LINES[8][0])

# the lines, the number of the bad one, the field, what the message must say
BAD: list[tuple[list[str], int, str | None, list[str]]] = [
    ([GOOD, GOOD[:-5]], 2, None, ["not a JSON object", "truncated"]),
    ([GOOD, ""], 2, None, ["not a JSON object"]),
    (["[1]"], 1, None, ["not a JSON object"]),
    (["[" * 100_000], 1, None, ["not a JSON object"]),
    (['{"seq":' + "1" * 5000 + "}"], 1, None, ["not a JSON object"]),
    ([GOOD.replace('"seq":0,', "")], 1, "seq", ["seq is missing"]),
    ([GOOD, GOOD], 2, "seq", ["seq 0 must be 1", "lost"]),
    ([GOOD.replace("0", "1", 1)], 1, "seq", ["seq 1 must be 0"]),
    ([GOOD.replace('"seq":0', '"seq":0.0')], 1, "seq", ["0.0", "whole"]),
    ([GOOD.replace('"seq":0', '"seq":false')], 1, "seq", ["false", "whole"]),
    ([GOOD.replace('"t":0.0,', "")], 1, "t", ["t is missing"]),
    ([GOOD.replace("0.0", '"0"')], 1, "t", ['"0"', "number"]),
    ([GOOD.replace("0.0", "true")], 1, "t", ["true", "number"]),
    ([GOOD.replace("0.0", "NaN")], 1, "t", ["NaN", "finite"]),
    ([GOOD.replace("0.0", "1e999")], 1, "t", ["Infinity", "finite"]),
    ([GOOD.replace("0.0", "1" * 400)], 1, "t", ["finite"]),
    ([GOOD.replace("robot_paused", "robot_pausd")], 1, "type", ["unknown", "'robot_paused'"]),
    ([GOOD.replace('"robot":"a"', '"robt":"a"')], 1, "robot", ["robot is missing"]),
    ([GOOD.replace('"a"', '"a","rob":1')], 1, "rob", ["unknown key", "'robot'"]),
    ([GOOD.replace('"a"', "7")], 1, "robot", ["7 must be text"]),
    ([GOOD.replace('"a"', '"a","robot":"b"')], 1, "robot", ["appears twice"]),
    ([to_line(0, LINES[0][0]).replace("events/1", "events/2")], 1, "schema", ["oath/events/2"]),
    ([MOVED.replace("[1.4,18.6]", "[1.4]")], 1, "to", ["[1.4]", "point"]),
    ([MOVED.replace("18.6", "null")], 1, "to[1]", ["null", "number"]),
    ([MOVED.replace('"from"', '"from_"')], 1, "from", ["missing"]),
    ([ROUTED.replace("pickup", "pikup")], 1, "routes.r2[0].stop", ['"pikup"', "'pickup'"]),
    ([ROUTED.replace('"r1":[]', '"r1":{}')], 1, "routes.r1", ["{}", "list"]),
    ([ROUTED.replace('"task":"bb",', "")], 1, "routes.r2[0].task", ["missing"]),
    ([ROUTED.replace('"no robot"', "3")], 1, "unassigned.x", ["3 must be text"]),
    ([ROUTED.replace('"round":1', '"round":"1"')], 1, "round", ['"1"', "whole"]),
    ([ADDED.replace('"delivery":"c",', "")], 1, "task", ["'aa'", "pickup"]),
    ([ADDED.replace("normal", "norml")], 1, "task.priority", ['"norml"', "'normal'"]),
    ([ADDED.replace('"id":"aa",', "")], 1, "task.id", ["missing"]),
    ([ADDED.replace('"type":"special"', '"typ":"special"')], 1, "task.type", ["missing"]),
    ([to_line(0, LINES[6][0]).replace("[4.0,9.0]", "4")], 1, "polygon[2]", ["4", "point"]),
    ([to_line(0, LINES[7][0]).replace(":1}", ":NaN}")], 1, "command.parameters.n", ["NaN"]),
]  # fmt: skip


@pytest.mark.parametrize(("lines", "number", "field", "parts"), BAD)
def test_damaged_lines(
    lines: list[str], number: int, field: str | None, parts: list[str], tmp_path: Path
) -> None:
    path = write(tmp_path, *lines)
    with pytest.raises(BadInput) as caught:
        read(path)
    error = caught.value
    assert error.file == f"{path}:{number}"
    assert error.field == field
    for part in parts:
        assert part in str(error)
    assert error.remedy


def test_not_a_log(tmp_path: Path) -> None:
    for path, part in ((tmp_path, "directory"), (tmp_path / "no.jsonl", "no such file")):
        with pytest.raises(BadInput, match=part):
            read(path)
    path = tmp_path / "junk"
    path.write_bytes(b"\xff\xfe\n")
    with pytest.raises(BadInput, match="UTF-8"):
        read(path)


@settings(
    max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_any_damaged_line_reads_or_is_bad_input(data: st.DataObject, tmp_path: Path) -> None:
    line: dict[str, Any] = json.loads(to_line(0, data.draw(st.sampled_from(LINES))[0]))
    at: Any = line
    while isinstance(at, dict | list) and at:
        key = data.draw(st.sampled_from(list(at) if isinstance(at, dict) else range(len(at))))
        if not isinstance(at[key], dict | list) or data.draw(st.booleans()):
            at[key] = data.draw(json_values)
            break
        at = at[key]
    path = write(tmp_path, json.dumps(line))
    try:
        read(path)
    except BadInput as error:
        assert error.file == f"{path}:1"
