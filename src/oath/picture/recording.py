"""Recordings of missions in the MCAP format, with Foxglove's own message types.

Foxglove, Rerun and every other reader of MCAP play them. Log times are the mission clock from 0.

==========================  =======================  ==========================================
topic                       type                     what
==========================  =======================  ==========================================
``/map``                    foxglove.SceneUpdate     bounds, walls, zones and places, once
``/grid``                   foxglove.Grid            occupied cells of a raster map, once
``/obstacles``              foxglove.SceneUpdate     what is known to stand in the way
``/tasks``                  foxglove.SceneUpdate     stops, coloured by how far their task is
``/robots``                 foxglove.SceneUpdate     bodies with labels, each in its own frame
``/routes``, ``/driven``    foxglove.SceneUpdate     the stops ahead; the ways behind
``/tf``                     foxglove.FrameTransform  where each robot is, 10 times a second
``/robots/ID/pose``         foxglove.PoseInFrame     the same for one robot
``/events``                 JSON                     the event log, schema ``oath/events/1``
``/progress``               JSON                     how many tasks are how far, to be plotted
==========================  =======================  ==========================================
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from heapq import merge
from math import atan2, cos, sin
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from oath.dispatch import advance
from oath.errors import BadInput, StoreError
from oath.events import AnyEvent, Moved
from oath.formats.event_log import TYPES, to_line
from oath.model import Mission, Point
from oath.picture import ROBOT_COLOURS, shapes
from oath.picture.statuses import robot_statuses, task_statuses
from oath.state import State

if TYPE_CHECKING:
    from foxglove import messages as fox

RATE = 10.0
"""Poses per second of the mission clock."""

PoseTuple = tuple[float, float, float]
"""x, y [m] and heading [rad, from the x axis]."""

_EVENT_SCHEMA = {
    "title": "oath.Event",
    "type": "object",
    "properties": {
        "seq": {"type": "integer"},
        "t": {"type": "number", "description": "mission clock [s]"},
        "type": {"enum": list(TYPES)},
        "robot": {"type": "string"},
    },
    "required": ["seq", "t", "type"],
}
_PROGRESS_SCHEMA = {
    "title": "oath.Progress",
    "type": "object",
    "properties": {status: {"type": "integer"} for status in shapes.TASK_COLOURS},
}


class Recorder:
    """Writes a recording: tell it events and poses in the order of time, or `play` it a log.

    Parameters
    ----------
    path
        The file; it must not exist.
    mission
        The mission as it was when it started.

    Raises
    ------
    BadInput
        If the file exists, or foxglove-sdk is not installed.
    StoreError
        If it cannot be written.
    """

    def __init__(self, path: str | Path, mission: Mission) -> None:
        try:
            import foxglove
            from foxglove import channels
        except ImportError:
            raise BadInput(
                "recordings need foxglove-sdk", remedy="pip install 'oath-fleet[record]'"
            ) from None
        if Path(path).exists():
            raise BadInput("exists already", file=str(path), remedy="name another file")
        self._path = path
        self._context = context = foxglove.Context()  # its channels close when it is gone
        try:
            self._writer = foxglove.open_mcap(path, context=context)
        except (OSError, RuntimeError) as error:
            raise StoreError(f"{path}: the recording cannot be written ({error})") from None
        self._writer.write_metadata("oath", {"mission": mission.name})
        self._scenes = {
            name: channels.SceneUpdateChannel(f"/{name}", context=context)
            for name in ("map", "obstacles", "tasks", "robots", "routes", "driven")
        }
        self._tf = channels.FrameTransformChannel("/tf", context=context)
        self._poses = {
            robot.id: channels.PoseInFrameChannel(f"/robots/{robot.id}/pose", context=context)
            for robot in mission.robots
        }
        self._grid = channels.GridChannel("/grid", context=context)
        self._events = foxglove.Channel("/events", schema=_EVENT_SCHEMA, context=context)
        self._progress = foxglove.Channel("/progress", schema=_PROGRESS_SCHEMA, context=context)
        self._mission, self._state = mission, State.of(mission)
        self._shown: dict[str, dict[str, object]] = {name: {} for name in self._scenes}
        self._seq, self._now = 0, 0
        self._colour = {
            robot.id: ROBOT_COLOURS[i % len(ROBOT_COLOURS)]
            for i, robot in enumerate(mission.robots)
        }
        self._show("map", shapes.ground(mission))
        if mission.map.grid is not None:
            self._grid.log(shapes.grid(mission.map.grid, self._stamp()), log_time=0)
        self._draw_state()

    def event(self, event: AnyEvent) -> None:
        """Record what happened next."""
        self._state, _ = advance(self._state, event)
        self._at(event.t)
        self._events.log(to_line(self._seq, event), log_time=self._now)
        self._seq += 1
        if isinstance(event, Moved):
            way = shapes.way([event.from_, event.to], self._colour[event.robot])
            self._show("driven", {f"{event.robot}/{self._seq}": way})
        self._draw_state()

    def poses(self, t: float, poses: Mapping[str, PoseTuple]) -> None:
        """Record where robots are at a time [s]."""
        from foxglove import messages as fox

        self._at(t)
        for robot, (x, y, heading) in poses.items():
            turn = fox.Quaternion(z=sin(heading / 2), w=cos(heading / 2))
            at = fox.Vector3(x=x, y=y)
            self._tf.log(
                fox.FrameTransform(
                    timestamp=self._stamp(),
                    parent_frame_id=shapes.WORLD,
                    child_frame_id=robot,
                    translation=at,
                    rotation=turn,
                ),
                log_time=self._now,
            )
            self._poses[robot].log(
                fox.PoseInFrame(
                    timestamp=self._stamp(),
                    frame_id=shapes.WORLD,
                    pose=fox.Pose(position=at, orientation=turn),
                ),
                log_time=self._now,
            )

    def play(self, events: Sequence[AnyEvent]) -> None:
        """Record a whole event log, which may be cut off, with poses at `RATE`."""
        told = (((event.t, 0), event) for event in events)
        seen = (((t, 1), poses) for t, poses in _samples(self._mission, events))
        for (t, _), one in merge(told, seen, key=lambda pair: pair[0]):
            if isinstance(one, dict):
                self.poses(t, one)
            else:
                self.event(one)

    def close(self) -> None:
        """Finish the file; without it readers must repair it first.

        Raises
        ------
        StoreError
            If not all of it could be written, because the disk is full, say.
        """
        try:
            self._writer.close()
        except RuntimeError as error:
            raise StoreError(f"{self._path}: the recording is not whole ({error})") from None

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # -- inside

    def _at(self, t: float) -> None:
        self._now = max(self._now, round(t * 1e9))

    def _stamp(self) -> fox.Timestamp:
        from foxglove import messages as fox

        seconds, rest = divmod(self._now, 10**9)
        return fox.Timestamp(sec=seconds, nsec=rest)

    def _show(
        self,
        topic: str,
        entities: Mapping[str, shapes.Entity],
        gone: Sequence[str] = (),
    ) -> None:
        """Record entities that are new or changed, by id: their frame and their shapes."""
        from foxglove import messages as fox

        if not entities and not gone:
            return
        stamp = self._stamp()
        self._scenes[topic].log(
            fox.SceneUpdate(
                deletions=[fox.SceneEntityDeletion(timestamp=stamp, id=id) for id in gone],
                entities=[
                    fox.SceneEntity(
                        timestamp=stamp, frame_id=frame, id=id, frame_locked=True, **parts
                    )
                    for id, (frame, parts) in entities.items()
                ],
            ),
            log_time=self._now,
        )

    def _update(
        self, topic: str, now: dict[str, Any], draw: Callable[[str, Any], shapes.Entity]
    ) -> None:
        """Record what differs from what was shown last; `now` says by id what it looks like."""
        before, self._shown[topic] = self._shown[topic], now
        changed = [id for id in now if before.get(id) != now[id]]
        self._show(topic, {id: draw(id, now[id]) for id in changed}, sorted(before.keys() - now))

    def _draw_state(self) -> None:
        state = self._state
        tasks, robots = task_statuses(state), robot_statuses(state)
        counts = Counter(tasks.values())
        progress: dict[str, object] = {status: counts[status] for status in shapes.TASK_COLOURS}
        if self._shown.get("progress") != progress:
            self._shown["progress"] = progress
            self._progress.log(json.dumps(progress), log_time=self._now)
        self._update("obstacles", dict(state.obstacles), lambda _, one: shapes.obstacle(one))
        stops = {
            f"{id}/{stop.name}": (task, stop, tasks[id])
            for id, task in state.tasks.items()
            for stop in task.stops
        }
        self._update("tasks", stops, lambda _, look: shapes.stop(*look))
        self._update(
            "robots",
            {id: (robots[id], robot.carrying) for id, robot in state.robots.items()},
            lambda id, look: shapes.body(self._mission.robot(id), self._colour[id], *look),
        )
        self._update(
            "routes",
            {id: self._route(id) for id in state.robots},
            lambda id, way: shapes.way(way, self._colour[id], ahead=True),
        )

    def _route(self, id: str) -> list[Point]:
        """Where a robot was last seen, and the stops ahead of it."""
        robot, tasks = self._state.robots[id], self._state.tasks
        return [robot.position, *(tasks[one.task].stop(one.stop).at for one in robot.route)]


def _samples(
    mission: Mission, events: Sequence[AnyEvent]
) -> Iterator[tuple[float, dict[str, PoseTuple]]]:
    """Yield where robots are, from the beginning of a log to its end."""
    moves: dict[str, list[Moved]] = {robot.id: [] for robot in mission.robots}
    for event in events:
        if isinstance(event, Moved):
            moves[event.robot].append(event)
    here: dict[str, PoseTuple] = {robot.id: (*robot.start, 0.0) for robot in mission.robots}
    done = dict.fromkeys(moves, 0)
    end = events[-1].t if events else 0.0
    for tick in range(int(end * RATE) + 2):
        t = min(tick / RATE, end)
        for robot, own in moves.items():
            while done[robot] < len(own) and own[done[robot]].start <= t:
                here[robot] = _along(own[done[robot]], t)
                if own[done[robot]].end > t:
                    break
                done[robot] += 1
        yield t, dict(here)
        if t >= end:
            return


def _along(move: Moved, t: float) -> PoseTuple:
    """Where a robot is during a move, or at its end."""
    (x0, y0), (x1, y1) = move.from_, move.to
    share = min((t - move.start) / (move.end - move.start), 1.0) if move.end > move.start else 1.0
    return x0 + share * (x1 - x0), y0 + share * (y1 - y0), atan2(y1 - y0, x1 - x0)
