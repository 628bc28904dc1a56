"""The built-in simulator: continuous time, constant speeds, sensing of unknown obstacles."""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import shapely
from numpy.typing import NDArray

from oath.events import AnyEvent, Moved, ObstacleFound, StopServed
from oath.fleet import Order, Pose
from oath.model import Mission, Motion, Obstacle, Point, Robot
from oath.world.workspace import Workspace

_LOOK = 0.05
"""Robots look around every so many metres [m], and at every waypoint."""

_COARSE = 100
"""Who senses far looks this often per sensing range instead: large maps cost no more than small."""

_OUTLINE = 4000
"""At most so many points of an obstacle's outline are looked at, or one every `_LOOK`."""

_BUMPER = 0.02
"""A robot notices what blocks it this near to its body whether it sees it or not [m]."""


class _Sight:
    """What a robot can see of one unknown obstacle."""

    def __init__(self, obstacle: Obstacle, workspace: Workspace) -> None:
        self.obstacle, self._workspace = obstacle, workspace
        self._polygon = shapely.Polygon(obstacle.polygon)
        shapely.prepare(self._polygon)
        ring = self._polygon.exterior
        along = np.arange(0.0, ring.length, max(_LOOK, ring.length / _OUTLINE))
        outline = shapely.get_coordinates(shapely.line_interpolate_point(ring, along))
        self._outline = np.concatenate([outline, np.array(obstacle.polygon)])
        self._centre = np.array(obstacle.polygon).mean(axis=0)
        self._reach = float(np.hypot(*(self._outline - self._centre).T).max())

    def far(self, at: NDArray[np.float64]) -> float:
        """A lower bound of the distance [m], quickly."""
        return math.hypot(*(at - self._centre)) - self._reach

    def distance(self, at: NDArray[np.float64]) -> float:
        """Distance [m] to the obstacle, 0 inside."""
        return float(shapely.distance(shapely.Point(at), self._polygon))

    def seen(self, at: NDArray[np.float64], within: float) -> bool:
        """Whether a part of it is in line of sight within some distance [m]."""
        if self.distance(at) == 0.0:
            return True
        away = self._outline - at
        length = np.hypot(*away.T)
        near = length <= within
        if not near.any():
            return False
        # The line of sight ends just short of the outline that it looks at.
        ends = at + away[near] * (1 - 1e-6 / np.maximum(length[near], 1e-6))[:, None]
        starts = np.repeat(at[None], len(ends), axis=0)
        core = self._workspace.core
        return bool(core.free(starts, ends, 0.0, self._workspace.blocked(None)).any())


@dataclass(slots=True)
class _Body:
    """One simulated robot."""

    robot: Robot
    motion: Motion
    at: Point
    order: Order | None = None
    path: tuple[Point, ...] = ()
    move: tuple[Point, Point, float, float] | None = None
    """From, to, start and end of the current move."""
    heading: float = 0.0
    """[rad] of the last move."""
    ticket: int = 0
    """Scheduled happenings with an older ticket are void."""


class SimFleet:
    """Simulated robots of a mission, in a world where its unknown obstacles exist.

    Parameters
    ----------
    mission
        The robots and the world.
    now, positions, found
        A mission under way: its clock [s], where robots stand [m], and which of the unknown
        obstacles are known by now.
    """

    def __init__(
        self,
        mission: Mission,
        *,
        now: float = 0.0,
        positions: Mapping[str, Point] = MappingProxyType({}),
        found: Collection[str] = (),
    ) -> None:
        existing = tuple(replace(obstacle, known=True) for obstacle in mission.map.obstacles)
        workspace = Workspace(replace(mission.map, obstacles=existing))
        self._unknown = {
            obstacle.id: _Sight(obstacle, workspace)
            for obstacle in mission.map.obstacles
            if not obstacle.known and obstacle.id not in found
        }
        self._bodies = {
            robot.id: _Body(
                robot, mission.motions[robot.motion], positions.get(robot.id, robot.start)
            )
            for robot in mission.robots
        }
        self._now = now
        self._agenda: list[tuple[float, int, str, int, str]] = []
        self._count = 0
        self._due: list[AnyEvent] = []
        for body in self._bodies.values():
            self._look_around(body)

    def send(self, robot: str, order: Order) -> None:
        """Give a robot its next order, see `Fleet`."""
        body = self._bodies[robot]
        if body.order is not None and replace(body.order, path=()) == order and not body.path:
            return  # it is at work there already
        body.order, body.path = order, order.path
        if body.move is None:
            self._go_on(body)

    def cancel(self, robot: str, *, at_once: bool) -> Point:
        """Drop a robot's order; return where it comes to rest [m]."""
        body = self._bodies[robot]
        body.order, body.path = None, ()
        if body.move is None:
            body.ticket += 1  # what it was serving is left
            return body.at
        if at_once:
            self._end_move(body)
            return body.at
        return body.move[1]

    def events(self, until: float = math.inf) -> Sequence[AnyEvent]:
        """What happens next, see `Fleet`."""
        while not self._due and self._agenda and self._agenda[0][0] <= until:
            t, _, robot, ticket, what = heapq.heappop(self._agenda)
            body = self._bodies[robot]
            if ticket != body.ticket:
                continue
            self._now = t
            if what == "arrive":
                self._end_move(body)
                self._look_around(body)
                self._go_on(body)
            elif what == "serve":
                self._serve(body)
            else:
                self._find(body, what)
        if not self._due and until < math.inf:
            self._now = max(self._now, until)
        due, self._due = self._due, []
        return due

    def poses(self) -> Mapping[str, Pose]:
        """Where every robot is now."""
        return {id: self._pose(body) for id, body in self._bodies.items()}

    # -- inside

    def _schedule(self, body: _Body, t: float, what: str) -> None:
        self._count += 1
        entry = (t, self._count, body.robot.id, body.ticket, what)
        heapq.heappush(self._agenda, entry)

    def _go_on(self, body: _Body) -> None:
        """Begin the next move of the order, or its service."""
        if body.order is None:
            return
        while body.path and body.path[0] == body.at:
            body.path = body.path[1:]
        body.ticket += 1
        if not body.path:
            self._schedule(body, self._now + body.order.service_time, "serve")
            return
        a, b = body.at, body.path[0]
        end = self._now + math.dist(a, b) / body.robot.speed
        body.move, body.path = (a, b, self._now, end), body.path[1:]
        body.heading = math.atan2(b[1] - a[1], b[0] - a[0])
        self._schedule(body, end, "arrive")
        for id, sight in self._unknown.items():
            driven = self._first_sight(body, sight, a, b)
            if driven is not None:
                self._schedule(body, self._now + driven / body.robot.speed, id)

    def _pose(self, body: _Body) -> Pose:
        if body.move is None:
            return Pose(body.at, body.heading)
        a, b, start, end = body.move
        if self._now < end:
            share = (self._now - start) / (end - start)
            b = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))
        return Pose(b, body.heading)

    def _end_move(self, body: _Body) -> None:
        """Come to rest now, at the end of the current move or on the way."""
        assert body.move is not None
        self._tell_move(body)
        body.at, body.move = body.move[0], None
        body.ticket += 1

    def _tell_move(self, body: _Body) -> None:
        """Report how far the robot came on its current move, if it is on one; the rest is left."""
        if body.move is None or self._now <= body.move[2]:
            return
        a, b, start, end = body.move
        here = self._pose(body).at
        body.move = (here, b, self._now, end)
        self._due.append(
            Moved(t=self._now, robot=body.robot.id, from_=a, to=here, start=start, end=self._now)
        )

    def _serve(self, body: _Body) -> None:
        order = body.order
        assert order is not None
        body.order = None
        self._due.append(
            StopServed(
                t=self._now, robot=body.robot.id, task=order.task, stop=order.stop, at=body.at
            )
        )

    def _find(self, body: _Body, id: str) -> None:
        sight = self._unknown.pop(id, None)
        if sight is not None:
            self._tell_move(body)  # where it was found from is told before what was found
            self._due.append(
                ObstacleFound(
                    t=self._now,
                    robot=body.robot.id,
                    obstacle=id,
                    polygon=sight.obstacle.polygon,
                )
            )

    def _look_around(self, body: _Body) -> None:
        at = np.array(body.at, dtype=float)
        for id, sight in list(self._unknown.items()):
            if sight.far(at) <= body.robot.sensing and self._notices(body, sight, at):
                self._find(body, id)

    def _notices(self, body: _Body, sight: _Sight, at: NDArray[np.float64]) -> bool:
        bump = body.robot.radius + _BUMPER
        blocks = body.motion.blocked_by(sight.obstacle.kind)
        if blocks and sight.distance(at) <= bump:
            return True
        return sight.seen(at, body.robot.sensing)

    def _first_sight(self, body: _Body, sight: _Sight, a: Point, b: Point) -> float | None:
        """How far along a move [m] the robot first notices an obstacle, if it does."""
        length = math.dist(a, b)
        start = np.array(a, dtype=float)
        along = (np.array(b, dtype=float) - start) / length
        reach = max(body.robot.sensing, body.robot.radius + _BUMPER)
        look = max(_LOOK, body.robot.sensing / _COARSE)
        driven = 0.0
        while driven < length:
            at = start + along * driven
            skip = sight.far(at) - reach
            if skip <= 0.0:
                if self._notices(body, sight, at):
                    return driven
                skip = min(look, self._to_contact(body, sight, at))
            driven += max(skip, 1e-3)
        return None

    def _to_contact(self, body: _Body, sight: _Sight, at: NDArray[np.float64]) -> float:
        if not body.motion.blocked_by(sight.obstacle.kind):
            return math.inf
        return sight.distance(at) - body.robot.radius - _BUMPER
