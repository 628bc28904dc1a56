"""The event log, schema ``oath/events/1``: one JSON object a line.

Every line has ``seq`` (0, 1, 2, ...), ``t`` [s] and ``type``, then the event's own fields in a
fixed order. Numbers are written with all the digits they need to read back unchanged, so a replay
sees exactly the events that happened.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal, NoReturn, get_args, get_origin, get_type_hints

from oath.errors import BadInput, did_you_mean
from oath.events import SCHEMA, AnyEvent, MissionStarted
from oath.formats.yaml_document import read_bytes
from oath.model import Point, Polygon, Priority, Route, RouteStop, Stop, StopName, Task

TYPES: dict[str, type[AnyEvent]] = {event.type: event for event in get_args(AnyEvent)}
"""The event classes by their name in the log."""


def to_line(seq: int, event: AnyEvent) -> str:
    """Return an event as a line of the log, without the line break.

    Parameters
    ----------
    seq
        The event's place in the log, from 0.
    event
        The event. Values inside of `Commanded.command` and `MissionFinished.summary` must be
        those of JSON (tuples come back as lists).

    Raises
    ------
    BadInput
        If a number is not finite, or a value has no JSON.

    Examples
    --------
    >>> from oath.events import RobotPaused
    >>> to_line(3, RobotPaused(t=1.5, robot="r1"))
    '{"seq":3,"t":1.5,"type":"robot_paused","robot":"r1"}'
    """
    line: dict[str, Any] = {"seq": seq, "t": float(event.t), "type": event.type}
    if isinstance(event, MissionStarted):
        line["schema"] = SCHEMA
    for name, kind in _KINDS[event.type].items():
        value = getattr(event, name)
        if name == "t" or (name == "unreachable" and value is None):
            continue
        line[name.removesuffix("_")] = _floats(value) if kind in _REAL else _plain(value)
    try:
        return json.dumps(line, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise BadInput(
            f"event {seq} ({event.type}) has a value without JSON: {error}",
            remedy="use finite numbers, text, lists and mappings",
        ) from None


def _plain(value: Any) -> Any:
    """Return a field's value as JSON has it."""
    if isinstance(value, RouteStop):
        return {"task": value.task, "stop": value.stop}
    if isinstance(value, Task):
        return _plain_task(value)
    if isinstance(value, Mapping):
        wrong = [key for key in value if not isinstance(key, str)]
        if wrong:
            raise BadInput(f"the key {wrong[0]!r} is not text", remedy="use text for keys")
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value


def _floats(value: Any) -> Any:
    """Return numbers as floats, so that equal events give equal bytes: 5 is written 5.0."""
    if isinstance(value, tuple | list):
        return [_floats(item) for item in value]
    return None if value is None else float(value)


def _plain_task(task: Task) -> dict[str, Any]:
    plain: dict[str, Any] = {"id": task.id}
    for stop in task.stops:
        plain[stop.name] = _floats(stop.at) if stop.place is None else stop.place
        if stop.place is not None:
            plain[f"{stop.name}_at"] = _floats(stop.at)
    plain |= {"type": task.type, "priority": task.priority}
    if task.service_time:
        plain["service_time"] = float(task.service_time)
    return plain


def read(
    path: str | Path, *, places: Mapping[str, Point] | None = None
) -> list[tuple[int, AnyEvent]]:
    """Read a whole log.

    Parameters
    ----------
    path
        The file of JSON lines.
    places
        Points [m] of named places, for tasks that were logged by hand with a place's name only.

    Returns
    -------
    list of (int, event)
        Sequence numbers 0, 1, 2, ... and the events; empty if the file is.

    Raises
    ------
    BadInput
        If the file is missing, or any line is truncated, out of sequence, of an unknown type or
        holds a wrong value: names the file, the line and the field.
    """
    lines = read_bytes(Path(path), limit=10_000_000_000).split(b"\n")
    if not lines[-1]:
        lines.pop()
    return list(_events(lines, str(path), places or {}))


def rebuilt(line: Mapping[str, Any]) -> AnyEvent:
    """Return the event of a line that `to_line` wrote and `json.loads` read.

    Nothing is checked: several times faster than `read`, for lines that something else vouches
    for.

    Examples
    --------
    >>> rebuilt({"seq": 3, "t": 1.5, "type": "robot_paused", "robot": "r1"})
    RobotPaused(t=1.5, robot='r1')
    """
    values: dict[str, Any] = {}
    for name, key, make in _MAKERS[line["type"]]:
        if key in line:
            values[name] = line[key] if make is None else make(line[key])
    return TYPES[line["type"]](**values)


def _events(
    lines: list[bytes], path: str, places: Mapping[str, Point]
) -> Iterator[tuple[int, AnyEvent]]:
    for seq, text in enumerate(lines):
        reader = _Line(f"{path}:{seq + 1}", places)
        yield seq, reader.event(text, seq)


class _Line:
    """Decodes one line; every method checks one kind of value and names its field if wrong."""

    def __init__(self, file: str, places: Mapping[str, Point]) -> None:
        self.file, self.places = file, places

    def fail(self, field: str, problem: str, remedy: str = "correct the line") -> NoReturn:
        raise BadInput(problem, file=self.file, field=field or None, remedy=remedy)

    def event(self, text: bytes, seq: int) -> AnyEvent:
        line = self._json(text)
        given = self.whole("seq", self._take(line, "seq"))
        if given != seq:
            self.fail("seq", f"seq {given} must be {seq}", "a line is lost, repeated or moved")
        type = self.text("type", self._take(line, "type"))
        if type not in TYPES:
            self.fail("type", f"unknown event type {type!r}", did_you_mean(type, list(TYPES)))
        if type == MissionStarted.type:
            schema = self._take(line, "schema")
            if schema != SCHEMA:
                self.fail("schema", f"unknown schema {schema!r}", f"this version reads '{SCHEMA}'")
        kinds = _KINDS[type]
        values: dict[str, Any] = {}
        for name, kind in kinds.items():
            key = name.removesuffix("_")
            if name == "unreachable" and key not in line:
                continue
            values[name] = _decoder(kind)(self, key, self._take(line, key))
        self._nothing_left("", line, [name.removesuffix("_") for name in kinds])
        return TYPES[type](**values)

    def _json(self, text: bytes) -> dict[str, Any]:
        try:
            line = json.loads(text.decode(), object_pairs_hook=self._object)
        except UnicodeDecodeError:
            self.fail("", "is not UTF-8 text", "the log is damaged here; cut it before this line")
        except (ValueError, RecursionError) as error:
            reason = "nests too deep" if isinstance(error, RecursionError) else str(error)
            remedy = "a truncated line comes from a crash while writing; remove it"
            self.fail("", f"is not a JSON object ({reason})", remedy)
        if not isinstance(line, dict):
            self.fail("", f"is not a JSON object but {_short(line)}")
        return line

    def _object(self, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            keys = [key for key, _ in pairs]
            twice = next(key for key in keys if keys.count(key) > 1)
            self.fail(twice, f"the key {twice!r} appears twice", "remove one of them")
        return found

    def _take(self, line: dict[str, Any], key: str, within: str = "") -> Any:
        if key not in line:
            self.fail(within + key, f"{key} is missing", f"add {key!r}")
        return line.pop(key)

    def _nothing_left(self, within: str, line: dict[str, Any], known: list[str]) -> None:
        for key in line:
            self.fail(within + key, f"unknown key {key!r}", did_you_mean(key, known))

    def text(self, field: str, value: Any) -> str:
        if not isinstance(value, str):
            self.fail(field, f"{_short(value)} must be text")
        return value

    def whole(self, field: str, value: Any) -> int:
        if not isinstance(value, int) or isinstance(value, bool):
            self.fail(field, f"{_short(value)} must be a whole number")
        return value

    def number(self, field: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fail(field, f"{_short(value)} must be a number")
        try:
            finite = math.isfinite(value)
        except OverflowError:
            finite = False
        if not finite:
            self.fail(field, f"{_short(value)} must be finite")
        return float(value)

    def number_or_none(self, field: str, value: Any) -> float | None:
        return None if value is None else self.number(field, value)

    def text_or_none(self, field: str, value: Any) -> str | None:
        return None if value is None else self.text(field, value)

    def point(self, field: str, value: Any) -> Point:
        if not isinstance(value, list) or len(value) != 2:
            self.fail(field, f"{_short(value)} must be a point [x, y]")
        return self.number(f"{field}[0]", value[0]), self.number(f"{field}[1]", value[1])

    def polygon(self, field: str, value: Any) -> Polygon:
        if not isinstance(value, list) or len(value) < 3:
            self.fail(field, f"{_short(value)} must be a list of at least 3 points [x, y]")
        return tuple(self.point(f"{field}[{i}]", item) for i, item in enumerate(value))

    def mapping(self, field: str, value: Any) -> dict[str, Any]:
        if not isinstance(value, dict):
            self.fail(field, f"{_short(value)} must be a mapping")
        self._finite(field, value)
        return value

    def _finite(self, field: str, value: Any) -> None:
        if isinstance(value, float):
            self.number(field, value)
        elif isinstance(value, dict):
            for key, item in value.items():
                self._finite(f"{field}.{key}", item)
        elif isinstance(value, list):
            for i, item in enumerate(value):
                self._finite(f"{field}[{i}]", item)

    def texts(self, field: str, value: Any) -> dict[str, str]:
        found = self.mapping(field, value)
        return {key: self.text(f"{field}.{key}", item) for key, item in found.items()}

    def routes(self, field: str, value: Any) -> dict[str, Route]:
        found = self.mapping(field, value)
        return {robot: self._route(f"{field}.{robot}", route) for robot, route in found.items()}

    def _route(self, field: str, value: Any) -> Route:
        if not isinstance(value, list):
            self.fail(field, f"{_short(value)} must be a list of stops")
        stops = []
        for i, item in enumerate(value):
            here = f"{field}[{i}]"
            line = dict(self.mapping(here, item))
            task = self.text(f"{here}.task", self._take(line, "task", f"{here}."))
            stop = self.choice(StopName, f"{here}.stop", self._take(line, "stop", f"{here}."))
            self._nothing_left(f"{here}.", line, ["task", "stop"])
            stops.append(RouteStop(task=task, stop=stop))
        return tuple(stops)

    def choice(self, options: Any, field: str, value: Any) -> Any:
        names = list(get_args(options))
        if value not in names:
            problem = f"{_short(value)} must be one of {', '.join(names)}"
            self.fail(field, problem, did_you_mean(str(value), names))
        return value

    def task(self, field: str, value: Any) -> Task:
        line = dict(self.mapping(field, value))
        within = f"{field}."
        id = self.text(f"{field}.id", self._take(line, "id", within))
        given = [name for name in get_args(StopName) if name in line]
        if given not in (["pickup", "delivery"], ["visit"]):
            problem = f"task {id!r} has the stops {', '.join(given) or '(none)'}"
            self.fail(field, problem, "give either pickup and delivery, or visit")
        task = Task(
            id=id,
            stops=tuple(self._stop(within, line, name) for name in given),
            type=self.text(f"{field}.type", self._take(line, "type", within)),
            priority=self.choice(Priority, f"{field}.priority", line.pop("priority", "normal")),
            service_time=self.number(f"{field}.service_time", line.pop("service_time", 0.0)),
        )
        known = ["id", *given, *(f"{name}_at" for name in given)]
        self._nothing_left(within, line, [*known, "type", "priority", "service_time"])
        return task

    def _stop(self, within: str, line: dict[str, Any], name: StopName) -> Stop:
        field, value = within + name, line.pop(name)
        if not isinstance(value, str):
            return Stop(name=name, at=self.point(field, value))
        if f"{name}_at" in line:
            at = self.point(f"{field}_at", line.pop(f"{name}_at"))
        elif value in self.places:
            at = self.places[value]
        else:
            remedy = f"add {name + '_at'!r}: [x, y], or read the log with its mission's places"
            self.fail(field, f"place {value!r} has no coordinates", remedy)
        return Stop(name=name, at=at, place=value)


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."


Decoder = Callable[[_Line, str, Any], Any]

_DECODERS: dict[Any, Decoder] = {
    str: _Line.text,
    int: _Line.whole,
    float: _Line.number,
    float | None: _Line.number_or_none,
    str | None: _Line.text_or_none,
    Point: _Line.point,
    Polygon: _Line.polygon,
    Task: _Line.task,
    Mapping[str, Any]: _Line.mapping,
    Mapping[str, str]: _Line.texts,
    Mapping[str, Route]: _Line.routes,
}


_REAL = (float, float | None, Point, Polygon)

_KINDS: dict[str, dict[str, Any]] = {
    name: {field.name: get_type_hints(event)[field.name] for field in fields(event)}
    for name, event in TYPES.items()
}
"""For every event type its fields in order, each with its kind."""


def _decoder(kind: Any) -> Decoder:
    if get_origin(kind) is Literal:
        return lambda line, field, value: line.choice(kind, field, value)
    return _DECODERS[kind]


def _maker(kind: Any) -> Callable[[Any], Any] | None:
    """What turns a value of JSON into one of this kind; None if they are the same."""
    if kind == Point:
        return tuple
    if kind == Polygon:
        return lambda value: tuple(map(tuple, value))
    if kind in (Task, Mapping[str, Route]):
        return lambda value: _DECODERS[kind](_Line("", {}), "", value)
    return None


_MAKERS = {
    type: [(name, name.removesuffix("_"), _maker(kind)) for name, kind in kinds.items()]
    for type, kinds in _KINDS.items()
}
"""For every event type its fields: name, key in the line, what makes the value."""
