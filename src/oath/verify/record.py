"""What the judge reads from a log: who was where when, what stood in the way, is the log in order.

Everything here is rebuilt from the events alone; nothing is taken from the planner or simulator.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from math import hypot, inf, isfinite
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from oath.events import (
    Allocated,
    AnyEvent,
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
from oath.model import Mission, Obstacle, Point, Robot

TOLERANCE = 1e-6
"""Slack on every length [m] and time [s] that is judged: rounding, and nothing more."""

RuleName = Literal[
    "order",
    "cut_off",
    "names",
    "summary",
    "unserved",
    "served_twice",
    "stop_order",
    "one_robot",
    "capability",
    "cancelled",
    "priority",
    "command",
    "position",
    "service_time",
    "service_overlap",
    "capacity",
    "contiguity",
    "bounds",
    "speed",
    "halted",
    "wall",
    "cell",
    "obstacle",
    "sensing",
    "mission_rule",
]
"""What can be violated, by one word each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """One thing in a log that must not be.

    Attributes
    ----------
    rule
        Which of the judge's rules is broken.
    seq
        The event's place in the log (0, 1, 2 ...), None if no single event is to blame.
    robot
        Who broke it, None if nobody in particular.
    message
        What happened, with values and limits, in words.
    """

    rule: RuleName
    message: str
    seq: int | None = None
    robot: str | None = None

    def __str__(self) -> str:
        place = "" if self.seq is None else f"event {self.seq}: "
        who = "" if self.robot is None else f"robot '{self.robot}': "
        return f"{place}{self.rule}: {who}{self.message}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """All moves of one robot in the order of the log, as arrays over n moves.

    Attributes
    ----------
    seq
        (n,) place of each move in the log.
    start, end
        (n,) [s].
    from_, to
        (n, 2) [m; world frame].
    halts
        Spans in which the robot must not move: from [s], until [s], and why.
    times, points
        (2n + 1,) [s] and (2n + 1, 2) [m]: the knots of the piecewise linear motion.
    """

    robot: Robot
    seq: NDArray[np.int64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    from_: NDArray[np.float64]
    to: NDArray[np.float64]
    halts: tuple[tuple[float, float, str], ...]
    times: NDArray[np.float64]
    points: NDArray[np.float64]

    @property
    def length(self) -> NDArray[np.float64]:
        """(n,) length of each move [m]."""
        length: NDArray[np.float64] = np.hypot(*(self.to - self.from_).T)
        return length

    def at(self, t: float) -> Point:
        """Return where the robot is at time `t` [s]."""
        x, y = (np.interp(t, self.times, self.points[:, axis]) for axis in (0, 1))
        return float(x), float(y)

    def standing_since(self, t: float) -> float | None:
        """Return when the robot stopped that stands at time `t` [s]; None while it drives."""
        driving = self.length > TOLERANCE
        if np.any(driving & (self.start < t - TOLERANCE) & (self.end > t + TOLERANCE)):
            return None
        ends = self.end[driving & (self.end <= t + TOLERANCE)]
        return float(ends.max()) if len(ends) else float(self.times[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Life:
    """An obstacle, and from when until when it stood there [s]."""

    obstacle: Obstacle
    since: float
    until: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record:
    """A log, sorted by who and what; events with unusable names or numbers are left out."""

    mission: Mission
    events: Sequence[AnyEvent]
    usable: tuple[tuple[int, AnyEvent], ...]
    tracks: dict[str, Track]
    lives: tuple[Life, ...]
    begin: float
    end: float

    @property
    def summary(self) -> MissionFinished | None:
        """The last word of the log, None if the log is cut off."""
        last = self.events[-1] if self.events else None
        return last if isinstance(last, MissionFinished) else None


def read(mission: Mission, events: Sequence[AnyEvent]) -> tuple[Record, list[Violation]]:
    """Sort a log by robots and obstacles, and judge its order, names and numbers."""
    faults = [*_order(mission, events)]
    ledger = _Ledger(mission)
    usable = []
    for seq, event in enumerate(events):
        problems = [*_numbers(event)] or [*ledger.enter(event)]
        if problems:
            robot = getattr(event, "robot", None)
            rule: RuleName = "order" if problems[0].startswith("not a number") else "names"
            faults += [Violation(rule=rule, seq=seq, robot=robot, message=p) for p in problems]
        else:
            usable.append((seq, event))
    times = [e.start if isinstance(e, Moved) else e.t for _, e in usable] or [0.0]
    begin, end = min(times), max([event.t for _, event in usable], default=0.0)
    if usable and isinstance(usable[0][1], MissionStarted):
        begin = usable[0][1].t
    record = Record(
        mission=mission,
        events=events,
        usable=tuple(usable),
        tracks={robot.id: _track(robot, usable, begin) for robot in mission.robots},
        lives=tuple(_lives(mission, usable, begin)),
        begin=begin,
        end=end,
    )
    return record, faults


def _order(mission: Mission, events: Sequence[AnyEvent]) -> Iterator[Violation]:
    if not events or not isinstance(events[0], MissionStarted):
        yield Violation(rule="order", seq=0, message="the log does not start with mission_started")
    elif events[0].mission != mission.name:
        text = f"the log is of mission '{events[0].mission}', not of '{mission.name}'"
        yield Violation(rule="order", seq=0, message=text)
    if not events or not isinstance(events[-1], MissionFinished):
        text = "the log is cut off: it does not end with mission_finished"
        yield Violation(rule="cut_off", seq=len(events) - 1 if events else None, message=text)
    last = -inf
    for seq, event in enumerate(events):
        if event.t < last - TOLERANCE:
            text = f"time goes back from {last:.6g} s to {event.t:.6g} s"
            yield Violation(rule="order", seq=seq, message=text)
        last = max(last, event.t)
        if isinstance(event, MissionStarted) and seq > 0:
            yield Violation(rule="order", seq=seq, message="the mission starts a second time")
        if isinstance(event, MissionFinished) and seq < len(events) - 1:
            text = f"{len(events) - 1 - seq} events come after mission_finished"
            yield Violation(rule="order", seq=seq, message=text)
        if isinstance(event, Moved):
            yield from _span(seq, event)


def _span(seq: int, move: Moved) -> Iterator[Violation]:
    if abs(move.t - move.end) > TOLERANCE:
        text = f"a move that ends at {move.end:.6g} s is logged for {move.t:.6g} s"
        yield Violation(rule="order", seq=seq, robot=move.robot, message=text)
    if move.end < move.start - TOLERANCE:
        text = f"a move ends at {move.end:.6g} s before it starts at {move.start:.6g} s"
        yield Violation(rule="order", seq=seq, robot=move.robot, message=text)


def _numbers(event: AnyEvent) -> Iterator[str]:
    # A NaN would slip through every comparison below, so it is stopped here.
    for item in fields(event):
        value = getattr(event, item.name)
        parts = value if item.name in ("from_", "to", "at") else (value,)
        if any(isinstance(part, float) and not isfinite(part) for part in parts):
            yield f"not a number: '{item.name.rstrip('_')}' is {value}"


@dataclass(slots=True)
class _Ledger:
    """Which names are in use at this point of the log."""

    mission: Mission
    robots: set[str] = field(init=False)
    stops: dict[str, set[str]] = field(init=False)
    cancelled: set[str] = field(init=False)
    obstacles: dict[str, bool] = field(init=False)

    def __post_init__(self) -> None:
        self.robots = {robot.id for robot in self.mission.robots}
        self.stops = {task.id: {s.name for s in task.stops} for task in self.mission.tasks}
        self.cancelled = set()
        self.obstacles = {obstacle.id: True for obstacle in self.mission.map.obstacles}

    def enter(self, event: AnyEvent) -> Iterator[str]:
        """Note what the event defines; yield what it names wrongly."""
        match event:
            case TaskAdded(task=task):
                if task.id in self.stops and task.id not in self.cancelled:
                    yield f"task '{task.id}' is added but it exists already"
                self.stops[task.id] = {stop.name for stop in task.stops}
                self.cancelled.discard(task.id)
            case TaskCancelled(task=task):
                yield from self._task(task)
                self.cancelled.add(task)
            case PriorityChanged(task=task):
                yield from self._task(task)
            case StopServed(robot=robot, task=task, stop=stop):
                yield from self._robot(robot)
                yield from self._task(task)
                if stop not in self.stops.get(task, {stop}):
                    yield f"task '{task}' has no stop '{stop}'"
            case ObstacleAdded(obstacle=obstacle):
                if self.obstacles.get(obstacle):
                    yield f"obstacle '{obstacle}' is added but it exists already"
                self.obstacles[obstacle] = True
            case ObstacleRemoved(obstacle=obstacle):
                yield from self._obstacle(obstacle)
                self.obstacles[obstacle] = False
            case ObstacleFound(robot=robot, obstacle=obstacle):
                yield from self._robot(robot)
                yield from self._obstacle(obstacle)
            case Moved() | Planned() | RobotFailed() | RobotPaused() | RobotResumed():
                yield from self._robot(event.robot)
            case Allocated(routes=routes, unassigned=unassigned):
                for robot in routes:
                    yield from self._robot(robot)
                tasks = {entry.task for route in routes.values() for entry in route}
                for task in sorted(tasks | set(unassigned)):
                    yield from self._task(task)
            case _:
                pass

    def _robot(self, robot: str) -> Iterator[str]:
        if robot not in self.robots:
            yield f"the mission has no robot '{robot}'"

    def _task(self, task: str) -> Iterator[str]:
        if task not in self.stops:
            yield f"there is no task '{task}'"

    def _obstacle(self, obstacle: str) -> Iterator[str]:
        if not self.obstacles.get(obstacle):
            yield f"there is no obstacle '{obstacle}'"


def _track(robot: Robot, usable: Sequence[tuple[int, AnyEvent]], begin: float) -> Track:
    mine = [(seq, e) for seq, e in usable if isinstance(e, Moved) and e.robot == robot.id]
    spans = np.array([(move.start, move.end) for _, move in mine], dtype=float).reshape(-1, 2)
    ends = np.array([(*move.from_, *move.to) for _, move in mine], dtype=float).reshape(-1, 2, 2)
    times = np.concatenate([[begin], spans.ravel()])
    return Track(
        robot=robot,
        seq=np.array([seq for seq, _ in mine], dtype=np.int64),
        start=spans[:, 0],
        end=spans[:, 1],
        from_=ends[:, 0],
        to=ends[:, 1],
        halts=tuple(_halts(robot.id, usable)),
        # Moves that overlap in time are reported; here they only must not upset interpolation.
        times=np.maximum.accumulate(times),
        points=np.concatenate([[robot.start], ends.reshape(-1, 2)]),
    )


def _halts(
    robot: str, usable: Sequence[tuple[int, AnyEvent]]
) -> Iterator[tuple[float, float, str]]:
    paused: float | None = None
    failed: float | None = None
    for _, event in usable:
        match event:
            case RobotPaused(robot=who, t=t) if who == robot and paused is None:
                paused = t
            case RobotResumed(robot=who, t=t) if who == robot and paused is not None:
                yield paused, t, "paused"
                paused = None
            case RobotFailed(robot=who, t=t) if who == robot and failed is None:
                failed = t
            case _:
                pass
    if paused is not None:
        yield paused, inf, "paused"
    if failed is not None:
        yield failed, inf, "failed"


def _lives(
    mission: Mission, usable: Sequence[tuple[int, AnyEvent]], begin: float
) -> Iterator[Life]:
    standing = {obstacle.id: (obstacle, begin) for obstacle in mission.map.obstacles}
    for _, event in usable:
        if isinstance(event, ObstacleAdded):
            added = Obstacle(id=event.obstacle, kind=event.kind, polygon=event.polygon)
            standing[added.id] = (added, event.t)
        elif isinstance(event, ObstacleRemoved):
            obstacle, since = standing.pop(event.obstacle)
            yield Life(obstacle=obstacle, since=since, until=event.t)
    for obstacle, since in standing.values():
        yield Life(obstacle=obstacle, since=since, until=inf)


def apart(a: Point, b: Point) -> float:
    """Return the distance of two points [m]."""
    return hypot(a[0] - b[0], a[1] - b[1])
