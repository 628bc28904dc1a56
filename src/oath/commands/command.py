"""What every command is and does, and the live world that it is asked of."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from oath.errors import BadInput, did_you_mean
from oath.events import AnyEvent
from oath.model import Point
from oath.scene import Scene
from oath.state import State

Name = Annotated[
    str, StringConstraints(strip_whitespace=True, min_length=1, max_length=64, pattern=r"\S")
]
"""The name of something: a task's label, a place, a robot, an obstacle."""

Coordinate = Annotated[float, Field(allow_inf_nan=False, strict=True, ge=-1e6, le=1e6)]

XY = Annotated[tuple[Coordinate, Coordinate], Field(description="[x, y] in metres")]


@dataclass(frozen=True, slots=True)
class Live:
    """The mission as it is now.

    Attributes
    ----------
    scene, state
        The mission made ready, and what has happened in it.
    poses
        Where each robot is [m]; those left out are where they were last seen.
    """

    scene: Scene
    state: State
    poses: Mapping[str, Point] = field(default_factory=dict)

    def pose(self, robot: str) -> Point:
        """Where a robot is [m]."""
        return self.poses.get(robot, self.state.robots[robot].position)


class Command(BaseModel):
    """A change, or a question, that somebody asks of a running mission."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    intent: ClassVar[str]
    immediate: ClassVar[bool] = False
    """It makes things safer: nobody is asked to confirm it."""

    def filled(self, live: Live) -> Command:
        """The same command with the live world's own names, and what was left open made up.

        Raises
        ------
        BadInput
            If it names something that does not exist.
        """
        return self

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """What happens if a filled command is carried out now.

        Raises
        ------
        BadInput
            If that is not possible, and why.
        """
        raise NotImplementedError

    def says(self, live: Live) -> str:
        """A filled command in plain words, e.g. ``adds task aa at (5.0, 19.5), ...``."""
        raise NotImplementedError


def named(what: str, field: str, name: str, known: Iterable[str]) -> str:
    """Return the known name that is meant: the same, or the only one that differs in case.

    Raises
    ------
    BadInput
        If there is none.

    Examples
    --------
    >>> named("place", "delivery_point", "C", ["b", "c"])
    'c'
    """
    names = list(known)
    if name in names:
        return name
    same = [other for other in names if other.casefold() == name.casefold()]
    if len(same) == 1:
        return same[0]
    raise BadInput(f"there is no {what} {name!r}", field=field, remedy=did_you_mean(name, names))


def show_point(at: Point) -> str:
    """Return a point as people write it, e.g. ``(5.0, 19.5)``."""
    return "(" + ", ".join(f"{value:.10g}" if value % 1 else f"{value:.1f}" for value in at) + ")"
