"""Actions to robots, robots to events."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from oath.events import AnyEvent
from oath.model import Point, StopName


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """Drive along waypoints [m], then serve a stop for some time [s]."""

    path: tuple[Point, ...]
    task: str
    stop: StopName
    service_time: float


class Fleet(Protocol):
    """Robots that take orders and report what happens.

    Robots report each straight move (`Moved`), each served stop (`StopServed`) and each obstacle
    that they find (`ObstacleFound`).
    """

    def send(self, robot: str, order: Order) -> None:
        """Give a robot its next order; it begins where the robot comes to rest.

        A robot that is at work at the same stop already, and need not move, works on.
        """

    def cancel(self, robot: str, *, at_once: bool) -> Point:
        """Drop a robot's order; return where it comes to rest [m].

        It stops `at_once`, mid-edge, or finishes its current move first.
        """

    def events(self, until: float = math.inf) -> Sequence[AnyEvent]:
        """Wait for what happens next, until some time of the mission clock [s].

        Empty if nothing happens until then; with no such time: if nothing will happen without
        another order.
        """

    def poses(self) -> Mapping[str, Pose]:
        """Where every robot is, at the time until which events were told."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a robot is [m; world frame] and where it heads [rad, from the x axis]."""

    at: Point
    heading: float
