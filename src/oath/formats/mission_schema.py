"""The mission file's shape, schema ``oath/mission/1``: every field, its kind and its default."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainValidator, model_validator

from oath.formats.fields import (
    XY,
    Bounds,
    Count,
    Flag,
    Line,
    Name,
    Outline,
    Section,
    Text,
    choice,
    name,
    none_as,
    number,
    point,
    show,
    wrong,
)
from oath.model import WALL, Point, Priority, StopName

SCHEMA = "oath/mission/1"

Positive = number("m", above=0)


def _stop(value: object) -> Point | str:
    if isinstance(value, str):
        return name(value)
    if isinstance(value, list):
        return point(value)
    problem = f"{show(value)} must be a place's name or a point [x, y]"
    raise wrong(problem, "name a place, in quotes if it looks like a number, or give [x, y]")


def _names(value: object) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise wrong(f"{show(value)} must be a list of names", "write [name, name, ...]")
    return tuple(name(item) for item in value)


def _capabilities(value: object) -> object:
    """Read a list of task types as full capability of each."""
    if isinstance(value, list):
        return dict.fromkeys(_names(value), 1.0)
    if not isinstance(value, dict):
        remedy = "write [type, ...] or {type: 0.5, ...}"
        raise wrong(f"{show(value)} must be a list or mapping of task types", remedy)
    return value


def _kind(value: object) -> str:
    kind = name(value)
    if kind == WALL:
        raise wrong("'wall' cannot be ignored or costed", "walls block every motion; remove it")
    return kind


def _kinds(value: object) -> frozenset[str]:
    if not isinstance(value, list):
        raise wrong(f"{show(value)} must be a list of obstacle kinds", "write [kind, ...]")
    return frozenset(_kind(item) for item in value)


StopAt = Annotated[Point | str, PlainValidator(_stop)]
Names = Annotated[tuple[str, ...], PlainValidator(_names)]
Kind = Annotated[str, PlainValidator(_kind)]
Capability = Annotated[float, number("", above=0, most=1)]
Factor = Annotated[float, number("", least=1)]
OrNoList = BeforeValidator(none_as(list))
OrNoDict = BeforeValidator(none_as(dict))
Lines = Annotated[list[Line], OrNoList]


class ObstacleSection(Section):
    """One entry of ``map.obstacles``."""

    id: Name
    kind: Name = "obstacle"
    polygon: Outline
    known: Flag = True


class MapSection(Section):
    """``map``: bounds, walls and obstacles, or a map file, or both."""

    file: Text | None = None
    bounds: Bounds | None = None
    walls: Lines = Field(default_factory=list)
    wall_thickness: Annotated[float, Positive] = 0.2
    obstacles: Annotated[list[ObstacleSection], OrNoList] = Field(default_factory=list)


class MotionSection(Section):
    """One entry of ``motions``."""

    ignores: Annotated[frozenset[str], PlainValidator(_kinds)] = frozenset()
    cost: Annotated[dict[Kind, Factor], OrNoDict] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _not_both(self) -> MotionSection:
        for kind in self.cost:
            if kind in self.ignores:
                problem = f"has the kind {kind!r} both under ignores and under cost"
                raise wrong(problem, "remove it from one of them")
        return self


class RobotSection(Section):
    """One entry of ``robots``."""

    id: Name
    start: XY
    motion: Name | None = None
    can: Annotated[dict[Name, Capability], BeforeValidator(_capabilities)] | None = None
    capacity: Count = 1
    speed: Annotated[float, number("m/s", above=0)] = 1.0
    radius: Annotated[float, Positive] = 0.2
    sensing: Annotated[float, Positive] = 1.5


class TaskSection(Section):
    """One entry of ``tasks``: pickup and delivery, or visit."""

    id: Name
    pickup: StopAt | None = None
    delivery: StopAt | None = None
    visit: StopAt | None = None
    type: Name | None = None
    priority: Annotated[Priority, choice("low", "normal", "high")] = "normal"
    service_time: Annotated[float, number("s", least=0)] = 0.0

    @model_validator(mode="after")
    def _stops(self) -> TaskSection:
        given = [key for key in ("pickup", "delivery", "visit") if getattr(self, key) is not None]
        if given not in (["pickup", "delivery"], ["visit"]):
            problem = f"has the stops {', '.join(given) or '(none)'}"
            raise wrong(problem, "give either pickup and delivery, or visit")
        return self

    @property
    def stops(self) -> list[tuple[StopName, Point | str]]:
        """The stops in the order of service."""
        given: list[tuple[StopName, Point | str | None]] = [
            ("pickup", self.pickup),
            ("delivery", self.delivery),
            ("visit", self.visit),
        ]
        return [(key, at) for key, at in given if at is not None]


class MissionFile(Section):
    """The whole file."""

    schema_: Annotated[str, Field(alias="schema")] = SCHEMA
    name: Name | None = None
    map: MapSection = MapSection()
    motions: Annotated[dict[Name, Annotated[MotionSection, OrNoDict]], OrNoDict] = Field(
        default_factory=dict
    )
    places: Annotated[dict[Name, XY], OrNoDict] = Field(default_factory=dict)
    task_types: Names | None = None
    robots: list[RobotSection]
    tasks: Annotated[list[TaskSection], OrNoList] = Field(default_factory=list)
    zones: Annotated[dict[Name, Outline], OrNoDict] = Field(default_factory=dict)
    rules: Annotated[list[Text], OrNoList] = Field(default_factory=list)

    @model_validator(mode="before")
    @classmethod
    def _has_robots(cls, value: Any) -> Any:
        if isinstance(value, dict) and value.get("robots", ()) in ([], None):
            raise wrong("robots is empty: a mission needs at least 1 robot", "add a robot")
        return value
