"""Recordings, read by a reader that is not ours: what is in them and when."""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import atan2, pi
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

import oath
from missions import bush, delivery, gate, robot, visit, yard
from oath.commands import parse
from oath.errors import BadInput
from oath.events import AnyEvent, Moved, StopServed
from oath.formats.event_log import to_line
from oath.model import Mission
from oath.picture.recording import RATE, Recorder
from oath.picture.statuses import robot_statuses, task_statuses
from oath.state import State


def fields(data: bytes) -> dict[int, list[Any]]:
    """Decode a protobuf message: by field number doubles, whole numbers and raw bytes."""
    found: dict[int, list[Any]] = {}

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    at = 0
    while at < len(data):
        tag = varint()
        value: Any
        if tag & 7 == 0:
            value = varint()
        elif tag & 7 == 1:
            (value,) = struct.unpack_from("<d", data, at)
            at += 8
        elif tag & 7 == 5:
            value = data[at : at + 4]
            at += 4
        else:
            length = varint()
            value = data[at : at + length]
            at += length
        found.setdefault(tag >> 3, []).append(value)
    return found


def numbers(data: bytes, count: int) -> tuple[float, ...]:
    """The first doubles of a message such as a vector; what is left out is 0."""
    given = fields(data)
    return tuple(given.get(k + 1, [0.0])[0] for k in range(count))


@dataclass
class Content:
    """What a reader finds in a recording."""

    schemas: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Name and encoding of each topic's schema."""
    messages: list[tuple[str, int, bytes]] = field(default_factory=list)
    """Topic, log time [ns] and data, in the order of the file."""

    def of(self, topic: str) -> list[tuple[float, bytes]]:
        return [(time / 1e9, data) for name, time, data in self.messages if name == topic]

    def scene(self, topic: str, until: float = 1e9) -> dict[str, dict[int, list[Any]]]:
        """The entities that stand in a scene at some time, by id."""
        shown: dict[str, dict[int, list[Any]]] = {}
        for t, data in self.of(topic):
            update = fields(data)
            if t > until:
                break
            for deletion in update.get(1, []):
                del shown[fields(deletion)[3][0].decode()]
            for entity in map(fields, update.get(2, [])):
                shown[entity[3][0].decode()] = entity
        return shown

    def poses(self, robot: str) -> dict[float, tuple[float, float, float]]:
        """x, y and heading by time."""
        found = {}
        for t, data in self.of(f"/robots/{robot}/pose"):
            pose = fields(fields(data)[3][0])
            x, y, _ = numbers(pose[1][0] if 1 in pose else b"", 3)
            _, _, z, w = numbers(pose[2][0], 4)
            found[t] = (x, y, 2 * atan2(z, w))
        return found


def content(path: Path) -> Content:
    found = Content()
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert schema is not None
            assert schema.data, "readers need the schema to decode"
            found.schemas[channel.topic] = (schema.name, schema.encoding)
            found.messages.append((channel.topic, message.log_time, message.data))
        assert [one.name for one in reader.iter_metadata()] == ["oath"]
    return found


def ran(mission: Mission, *commands: tuple[float, str, Mapping[str, Any]]) -> list[AnyEvent]:
    runtime = oath.prepare(mission, points=200)

    def script() -> Iterator[tuple[float, Any]]:
        for at, intent, given in commands:
            command = parse({"intent": intent, "parameters": given})
            yield at, lambda command=command: runtime.command([command], "test")

    return list(runtime.run(script()).events)


def world() -> Mission:
    return yard(
        [
            robot("r1", (1, 1), can={"inspect": 1.0}),
            robot("fast one", (9, 1), speed=2.0, motion="drone", can={"carry": 1.0}),
        ],
        [
            delivery("a", (2, 6), (8, 8)),
            visit("b", (5, 8), type="inspect", service_time=1.5),
            visit("c", (9, 9)),
        ],
        walls=(((4.0, 4.0), (4.0, 9.0)),),
        obstacles=(gate("found", ((6, 5), (7, 5), (6.2, 5.2), (6, 6)), known=False),),
        zones={"lab": ((0.5, 8.0), (1.5, 8.0), (1.5, 9.0))},
        places={"dock": (9.5, 0.5)},
    )


COMMANDS = (
    (1.0, "obstacle_update", {"obstacle_location": [[7.5, 2.0], [8.5, 2.0]]}),
    (1.5, "cancel_task", {"task_label": "c"}),
    (2.0, "pause_robot", {"robot": "r1"}),
    (2.5, "remove_obstacle", {"obstacle": "wall-1"}),
    (4.0, "resume_robot", {"robot": "r1"}),
)


@pytest.fixture(scope="module")
def events() -> list[AnyEvent]:
    return ran(world(), *COMMANDS)


@pytest.fixture(scope="module")
def recorded(events: list[AnyEvent], tmp_path_factory: pytest.TempPathFactory) -> Content:
    path = tmp_path_factory.mktemp("recording") / "yard.mcap"
    with Recorder(path, world()) as recorder:
        recorder.play(events)
    return content(path)


def test_topics_and_their_schemas(recorded: Content) -> None:
    scene = ("foxglove.SceneUpdate", "protobuf")
    names = ("map", "obstacles", "tasks", "robots", "routes", "driven")
    assert recorded.schemas == {f"/{name}": scene for name in names} | {
        "/tf": ("foxglove.FrameTransform", "protobuf"),
        "/robots/r1/pose": ("foxglove.PoseInFrame", "protobuf"),
        "/robots/fast one/pose": ("foxglove.PoseInFrame", "protobuf"),
        "/events": ("oath.Event", "jsonschema"),
        "/progress": ("oath.Progress", "jsonschema"),
    }


def test_log_times_are_the_mission_clock_and_never_go_back(
    recorded: Content, events: list[AnyEvent]
) -> None:
    times = [time for _, time, _ in recorded.messages]
    assert times == sorted(times)
    assert times[0] == 0
    assert times[-1] == round(events[-1].t * 1e9)


def test_every_event_is_there_as_in_the_log(recorded: Content, events: list[AnyEvent]) -> None:
    told = recorded.of("/events")
    assert [data.decode() for _, data in told] == [to_line(i, e) for i, e in enumerate(events)]
    assert [t for t, _ in told] == pytest.approx([event.t for event in events], abs=1e-9)


@pytest.mark.parametrize("id", ["r1", "fast one"])
def test_poses_are_those_of_the_log(id: str, recorded: Content, events: list[AnyEvent]) -> None:
    poses, end = recorded.poses(id), events[-1].t
    assert list(poses) == pytest.approx([k / RATE for k in range(int(end * RATE) + 1)] + [end])
    moves = [event for event in events if isinstance(event, Moved) and event.robot == id]
    assert len(moves) > 3
    here, heading = world().robot(id).start, 0.0
    for t, (x, y, turned) in poses.items():
        while moves and moves[0].end <= t + 1e-9:
            here = moves[0].to
            heading = atan2(here[1] - moves[0].from_[1], here[0] - moves[0].from_[0])
            moves.pop(0)
        if moves and moves[0].start <= t:
            (x0, y0), (x1, y1) = moves[0].from_, moves[0].to
            share = (t - moves[0].start) / (moves[0].end - moves[0].start)
            here = (x0 + share * (x1 - x0), y0 + share * (y1 - y0))
            heading = atan2(y1 - y0, x1 - x0)
        assert (x, y) == pytest.approx(here, abs=1e-6)
        assert abs((turned - heading + pi) % (2 * pi) - pi) < 1e-6


def test_transforms_say_the_same_as_poses(recorded: Content) -> None:
    seen: dict[str, list[tuple[float, ...]]] = {}
    for _, data in recorded.of("/tf"):
        transform = fields(data)
        assert transform[2] == [b"map"]
        at = transform.get(4, [b""])[0]
        seen.setdefault(transform[3][0].decode(), []).append(numbers(at, 2))
    for id, places in seen.items():
        assert places == [pose[:2] for pose in recorded.poses(id).values()]


def test_the_map_has_walls_zones_and_places(recorded: Content) -> None:
    assert set(recorded.scene("/map")) == {"bounds", "walls", "zone lab", "place dock"}


def test_obstacles_come_and_go(recorded: Content) -> None:
    assert set(recorded.scene("/obstacles", 0.9)) == set()
    assert set(recorded.scene("/obstacles", 2.4)) >= {"wall-1"}
    # What was found stays; it is not convex, so its outline must do.
    last = recorded.scene("/obstacles")
    assert set(last) <= {"found"}
    assert not any(12 in entity for entity in last.values())


def test_a_cancelled_task_disappears(recorded: Content) -> None:
    assert set(recorded.scene("/tasks", 1.4)) == {"a/pickup", "a/delivery", "b/visit", "c/visit"}
    assert set(recorded.scene("/tasks", 1.6)) == {"a/pickup", "a/delivery", "b/visit"}


def test_robots_have_frames_and_labels(recorded: Content) -> None:
    def label(t: float) -> str:
        entity = recorded.scene("/robots", t)["r1"]
        assert entity[2] == [b"r1"]
        text: str = fields(entity[13][0])[6][0].decode()
        return text

    assert label(0.0) == "r1"
    assert label(3.0) == "r1 paused"


def test_ways_driven_grow_by_every_move(recorded: Content, events: list[AnyEvent]) -> None:
    moves = [event for event in events if isinstance(event, Moved)]
    assert len(recorded.scene("/driven")) == len(moves)
    assert Counter(id.split("/")[0] for id in recorded.scene("/driven")) == Counter(
        move.robot for move in moves
    )


def test_progress_ends_with_all_tasks_done(recorded: Content, events: list[AnyEvent]) -> None:
    told = [json.loads(data) for _, data in recorded.of("/progress")]
    assert told[0] == {"waiting": 3, "assigned": 0, "carried": 0, "done": 0, "stranded": 0}
    assert told[-1] == {"waiting": 0, "assigned": 0, "carried": 0, "done": 2, "stranded": 0}
    assert any(one["carried"] for one in told)
    assert len(told) < len([event for event in events if isinstance(event, StopServed)]) * 3


def test_a_raster_map_is_a_grid(tmp_path: Path) -> None:
    mission = oath.load("missions/office.yaml")
    with Recorder(tmp_path / "a.mcap", mission) as recorder:
        recorder.play([])
    ((t, data),) = content(tmp_path / "a.mcap").of("/grid")
    grid, cells = fields(data), mission.map.grid
    assert t == 0.0
    assert cells is not None
    rows, columns = cells.occupied.shape
    (raw,) = (one for one in grid[9] if len(one) == rows * columns)
    assert raw.count(100) == int(cells.occupied.sum())


def test_a_recording_is_fed_while_the_mission_runs(tmp_path: Path) -> None:
    """Poses of now and events of now, as a server has them."""
    mission = world()
    with Recorder(tmp_path / "a.mcap", mission) as recorder:
        runtime = oath.prepare(mission, points=200, on_event=recorder.event)
        runtime.start()
        for tick in range(200):
            runtime.advance(tick / 10)
            poses = runtime.poses().items()
            recorder.poses(tick / 10, {id: (*pose.at, pose.heading) for id, pose in poses})
        runtime.finish()
    found = content(tmp_path / "a.mcap")
    times = [time for _, time, _ in found.messages]
    assert times == sorted(times)
    assert len(found.of("/events")) == len(runtime.events)
    assert len(found.poses("r1")) == 200


def test_files_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("mine")
    with pytest.raises(BadInput, match="exists already"):
        Recorder(tmp_path / "a.mcap", world())
    assert (tmp_path / "a.mcap").read_text() == "mine"


def test_statuses() -> None:
    from dataclasses import replace

    mission = yard(
        [robot(id, (1, 1)) for id in ("r1", "r2", "r3", "r4")],
        [visit(id, (2, 2)) for id in "abcde"],
        obstacles=(bush("x", ((1, 1), (2, 1), (2, 2))),),
    )
    state = State.of(mission)
    from oath.model import RouteStop

    route = (RouteStop(task="a", stop="visit"),)
    one = replace(state.robots["r1"], route=route, carrying=("b",))
    state = replace(
        state,
        robots={**state.robots, "r1": one},
        completed=frozenset("c"),
        stranded={"d": "why"},
        paused=frozenset(["r2", "r3"]),
        failed=frozenset(["r3"]),
    )
    assert task_statuses(state) == {
        "a": "assigned",
        "b": "carried",
        "c": "done",
        "d": "stranded",
        "e": "waiting",
    }
    assert robot_statuses(state) == {
        "r1": "working",
        "r2": "paused",
        "r3": "failed",
        "r4": "idle",
    }
