"""Everything that can happen in a mission (event log schema ``oath/events/1``).

An event carries the mission clock `t` [s]; its place in the log is its sequence number, which the
journal gives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from oath.model import Point, Polygon, Priority, Route, StopName, Task

SCHEMA = "oath/events/1"

PlanReason = Literal["allocated", "obstacle", "command"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened at time `t` [s]."""

    type: ClassVar[str]
    t: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionStarted(Event):
    """The mission began; every robot is at its start."""

    type: ClassVar[str] = "mission_started"
    mission: str
    allocator: str
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Allocated(Event):
    """An allocation round ended; `routes` replaces the routes of all robots.

    `round` counts how often one had been asked for when it began: it answers all of those.
    """

    type: ClassVar[str] = "allocated"
    round: int
    seconds: float
    routes: Mapping[str, Route]
    unassigned: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned(Event):
    """A robot has a new plan of this length [m] for its whole route.

    `length` is None if there is none: then `unreachable` names the task whose stop cannot be
    reached.
    """

    type: ClassVar[str] = "planned"
    robot: str
    seconds: float
    length: float | None
    reason: PlanReason
    unreachable: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved(Event):
    """A robot drove straight at constant speed from `from_` (at `start`) to `to` (at `end` = t)."""

    type: ClassVar[str] = "moved"
    robot: str
    from_: Point
    to: Point
    start: float
    end: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StopServed(Event):
    """A robot finished its work at a stop of a task."""

    type: ClassVar[str] = "stop_served"
    robot: str
    task: str
    stop: StopName
    at: Point


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleFound(Event):
    """A robot sensed an obstacle that nobody knew."""

    type: ClassVar[str] = "obstacle_found"
    robot: str
    obstacle: str
    polygon: Polygon


@dataclass(frozen=True, slots=True, kw_only=True)
class Commanded(Event):
    """An operator, API or interpreter asked for a change."""

    type: ClassVar[str] = "commanded"
    command: Mapping[str, Any]
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskAdded(Event):
    """A task joined the mission."""

    type: ClassVar[str] = "task_added"
    task: Task


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskCancelled(Event):
    """A task left the mission."""

    type: ClassVar[str] = "task_cancelled"
    task: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorityChanged(Event):
    """A task's priority changed."""

    type: ClassVar[str] = "priority_changed"
    task: str
    priority: Priority


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleAdded(Event):
    """An obstacle appeared, and everyone knows of it."""

    type: ClassVar[str] = "obstacle_added"
    obstacle: str
    kind: str
    polygon: Polygon


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleRemoved(Event):
    """An obstacle is gone."""

    type: ClassVar[str] = "obstacle_removed"
    obstacle: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotFailed(Event):
    """A robot is out of the mission."""

    type: ClassVar[str] = "robot_failed"
    robot: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotPaused(Event):
    """A robot holds where it is."""

    type: ClassVar[str] = "robot_paused"
    robot: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotResumed(Event):
    """A paused robot goes on."""

    type: ClassVar[str] = "robot_resumed"
    robot: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionFinished(Event):
    """Nothing more will happen; `summary` is the run's summary."""

    type: ClassVar[str] = "mission_finished"
    summary: Mapping[str, Any]


AnyEvent = (
    MissionStarted
    | Allocated
    | Planned
    | Moved
    | StopServed
    | ObstacleFound
    | Commanded
    | TaskAdded
    | TaskCancelled
    | PriorityChanged
    | ObstacleAdded
    | ObstacleRemoved
    | RobotFailed
    | RobotPaused
    | RobotResumed
    | MissionFinished
)
