"""Commands about obstacles: one has appeared, one is gone."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from oath.commands.command import XY, Command, Live, Name, named, show_point
from oath.errors import BadInput
from oath.events import AnyEvent, ObstacleAdded, ObstacleRemoved
from oath.model import Point, Polygon

THICKNESS = 0.2
"""Width of an obstacle told as a segment, where the map's walls have none [m]."""


class ObstacleUpdate(Command):
    """Something stands in the way: a polygon, or a wall from one point to another."""

    intent: ClassVar[str] = "obstacle_update"

    obstacle_location: Annotated[list[XY], Field(min_length=2, max_length=1000)] = Field(
        description="the corners in order [[x, y], ...] in metres, or the two ends of a wall"
    )
    obstacle_type: Name | None = Field(
        None, description="its kind, e.g. wall or bush; wall if left out"
    )

    def filled(self, live: Live) -> ObstacleUpdate:
        """See `Command`."""
        return self.model_copy(update={"obstacle_type": self.obstacle_type or "wall"})

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        kind = self.obstacle_type or "wall"
        return (
            ObstacleAdded(
                t=live.state.t,
                obstacle=_free_id(live, kind),
                kind=kind,
                polygon=self.polygon(live.scene.mission.map.wall_thickness or THICKNESS),
            ),
        )

    def polygon(self, thickness: float) -> Polygon:
        """The corners; a segment becomes a rectangle this thick [m]."""
        points = tuple(self.obstacle_location)
        if len(points) > 3 and points[0] == points[-1]:
            points = points[:-1]
        if len(points) != 2:
            return points
        return _rectangle(points[0], points[1], thickness)

    def says(self, live: Live) -> str:
        """See `Command`."""
        (event,) = self.events(live)
        assert isinstance(event, ObstacleAdded)
        points = list(map(show_point, self.obstacle_location))
        is_segment = len(points) == 2
        shape = f"from {points[0]} to {points[1]}" if is_segment else f"around {' '.join(points)}"
        return f"adds {event.obstacle} ({event.kind}) {shape}"


def _rectangle(a: Point, b: Point, thickness: float) -> Polygon:
    length = math.dist(a, b)
    if length < 1e-6:
        raise BadInput(
            f"both ends of the obstacle are {show_point(a)}",
            field="obstacle_location",
            remedy="give two different ends, or three or more corners",
        )
    x, y = -(b[1] - a[1]) / length * thickness / 2, (b[0] - a[0]) / length * thickness / 2
    return (
        (a[0] + x, a[1] + y),
        (b[0] + x, b[1] + y),
        (b[0] - x, b[1] - y),
        (a[0] - x, a[1] - y),
    )


def _free_id(live: Live, kind: str) -> str:
    """The first of wall-1, wall-2, ... that no obstacle ever had."""
    taken = live.state.obstacle_ids
    return next(id for n in range(1, len(taken) + 2) if (id := f"{kind}-{n}") not in taken)


class RemoveObstacle(Command):
    """An obstacle is gone."""

    intent: ClassVar[str] = "remove_obstacle"

    obstacle: Name = Field(description="the obstacle's id")

    def filled(self, live: Live) -> RemoveObstacle:
        """See `Command`."""
        known = live.state.obstacles
        return RemoveObstacle(obstacle=named("obstacle", "obstacle", self.obstacle, known))

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        return (ObstacleRemoved(t=live.state.t, obstacle=self.obstacle),)

    def says(self, live: Live) -> str:
        """See `Command`."""
        return f"removes {self.obstacle} ({live.state.obstacles[self.obstacle].kind})"
