"""The kinds of value a field can hold, and one clear error when it does not hold one.

Every kind is a type for pydantic models. Numbers are finite, of a stated unit and range; a boolean
is no number and a number is no name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypeVar, get_args

import shapely
from pydantic import BaseModel, ConfigDict, PlainValidator, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from oath.errors import BadInput, did_you_mean
from oath.formats.yaml_document import Document, FieldPath
from oath.model import Point, Polygon

LARGEST = 1e8
"""Bound on every length, time and factor: beyond it doubles no longer resolve a micrometre."""
SMALLEST = 1e-6
"""Bound from below on what must be above 0: the planners count in micrometres."""
LONGEST_NAME = 100


class Section(BaseModel):
    """A mapping of a file: frozen, and without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


AnySection = TypeVar("AnySection", bound=Section)


def wrong(problem: str, remedy: str) -> PydanticCustomError:
    """Return the error of a value; `problem` continues "the field ..."."""
    context = {"problem": problem, "remedy": remedy}
    return PydanticCustomError("oath", "{problem}; {remedy}", context)


def show(value: object) -> str:
    """Return a value as it would stand in YAML, shortened."""
    if isinstance(value, bool):
        return str(value).lower()
    if value is None:
        return "(empty)"
    text = repr(value) if isinstance(value, str | list | dict | int | float) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def finite(value: object, unit: str = "") -> float:
    """Return a finite number of sane size as a float.

    Raises
    ------
    PydanticCustomError
        If it is a boolean, text, NaN, infinite or beyond `LARGEST`.
    """
    of_unit = f" of {unit}" if unit else ""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise wrong(f"{show(value)} must be a number", f"give a number{of_unit} without quotes")
    if not math.isfinite(value):
        raise wrong(f"{show(value)} must be finite", f"give a finite number{of_unit}")
    if abs(value) > LARGEST:
        raise wrong(f"{show(value)} must be within ±{LARGEST:g}{of_unit}", "check the unit")
    return float(value)


def number(
    unit: str, *, above: float | None = None, least: float | None = None, most: float = LARGEST
) -> PlainValidator:
    """Return the validator of a number in a range; `above` 0 means at least `SMALLEST`."""
    space = f" {unit}" if unit else ""
    kind = "positive" if above == 0 else "valid"

    def check(value: object) -> float:
        given = finite(value, unit)
        remedy = f"give a {kind} number" + (f" of {unit}" if unit else "")
        if above is not None and given <= above:
            raise wrong(f"{show(value)} must be above {above:g}{space}", remedy)
        if above is not None and given < above + SMALLEST:
            raise wrong(f"{show(value)} must be at least {above + SMALLEST:g}{space}", remedy)
        if least is not None and given < least:
            raise wrong(f"{show(value)} must be at least {least:g}{space}", remedy)
        if given > most:
            raise wrong(f"{show(value)} must be at most {most:g}{space}", remedy)
        return given

    return PlainValidator(check)


def _count(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise wrong(f"{show(value)} must be a whole number", "give 1, 2, 3, ...")
    if not 1 <= value <= 1_000_000:
        raise wrong(f"{show(value)} must lie in [1, 1000000]", "give 1, 2, 3, ...")
    return value


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise wrong(f"{show(value)} must be true or false", "write true or false without quotes")
    return value


def plain_text(value: object) -> str:
    """Return text; a number or boolean is told to be quoted."""
    if isinstance(value, str):
        if not value.strip():
            raise wrong("is empty", "write some text")
        return value
    if isinstance(value, bool):
        remedy = "put it in quotes (an unquoted yes, no, on or off is a boolean in YAML)"
        raise wrong(f"{show(value)} is a boolean, not text", remedy)
    if value is None or isinstance(value, list | dict):
        raise wrong(f"{show(value)} must be text", "write one word, in quotes if in doubt")
    raise wrong(f"{show(value)} is not text but a number or date", f'put it in quotes: "{value}"')


def name(value: object) -> str:
    """Return text that can name something: printable, without spaces around it, not too long."""
    text = plain_text(value)
    if text != text.strip() or not text.isprintable():
        raise wrong(f"{show(text)} has outer spaces or unprintable characters", "remove them")
    if len(text) > LONGEST_NAME:
        raise wrong(f"{show(text)} is longer than {LONGEST_NAME} characters", "shorten it")
    return text


def choice(*options: str) -> PlainValidator:
    """Return the validator of one of a few words."""

    def check(value: object) -> str:
        if value not in options or not isinstance(value, str):
            remedy = did_you_mean(str(value), list(options))
            if "known" not in remedy:
                remedy += f" (known: {', '.join(options)})"
            raise wrong(f"{show(value)} must be one of {', '.join(options)}", remedy)
        return value

    return PlainValidator(check)


def point(value: object) -> Point:
    """Return [x, y] in metres as a tuple."""
    if not isinstance(value, list) or len(value) != 2:
        raise wrong(f"{show(value)} must be a point [x, y]", "give two numbers in metres")
    return finite(value[0], "metres"), finite(value[1], "metres")


def points(value: object) -> Polygon:
    """Return a list of points without immediate repetitions."""
    if not isinstance(value, list):
        raise wrong(f"{show(value)} must be a list of points", "write [[x, y], [x, y], ...]")
    found = [point(item) for item in value]
    return tuple(p for i, p in enumerate(found) if i == 0 or p != found[i - 1])


def polyline(value: object) -> Polygon:
    """Return at least two points that are joined by straight pieces."""
    corners = points(value)
    if len(corners) < 2:
        problem = f"{show(value)} has fewer than 2 distinct points"
        raise wrong(problem, "give both ends, [[x, y], [x, y], ...], or remove it")
    return corners


def polygon(value: object) -> Polygon:
    """Return the corners of a simple polygon with some area, the first not repeated at the end."""
    corners = points(value)
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners = corners[:-1]
    if len(set(corners)) < 3:
        raise wrong(f"{show(value)} has fewer than 3 distinct corners", "give 3 corners or more")
    shape = shapely.Polygon(corners)
    if shape.convex_hull.area < SMALLEST**2:
        raise wrong(f"{show(value)} has no area", "give corners that are not on one line")
    if not shape.is_valid:
        reason = shapely.is_valid_reason(shape).replace("[", " at [")
        problem = f"{show(value)} crosses or touches itself ({reason})"
        raise wrong(problem, "give the corners in order around the outline")
    return corners


def _bounds(value: object) -> tuple[float, float, float, float]:
    if not isinstance(value, list) or len(value) != 4:
        remedy = "give [x_min, y_min, x_max, y_max] in metres"
        raise wrong(f"{show(value)} must be four numbers", remedy)
    x_min, y_min, x_max, y_max = (finite(item, "metres") for item in value)
    for axis, low, high in (("x", x_min, x_max), ("y", y_min, y_max)):
        if high - low < SMALLEST:
            problem = f"{show(value)} has {axis}_min {low:g} not below {axis}_max {high:g}"
            raise wrong(problem, "give [x_min, y_min, x_max, y_max]")
    return x_min, y_min, x_max, y_max


def none_as(empty: Callable[[], Any]) -> Callable[[object], Any]:
    """Return a validator that reads a key without a value as an empty collection."""
    return lambda value: empty() if value is None else value


Name = Annotated[str, PlainValidator(name)]
Text = Annotated[str, PlainValidator(plain_text)]
Flag = Annotated[bool, PlainValidator(_flag)]
Count = Annotated[int, PlainValidator(_count)]
XY = Annotated[Point, PlainValidator(point)]
Outline = Annotated[Polygon, PlainValidator(polygon)]
Line = Annotated[Polygon, PlainValidator(polyline)]
Bounds = Annotated[tuple[float, float, float, float], PlainValidator(_bounds)]


def validate(model: type[AnySection], document: Document) -> AnySection:
    """Return a document's value as a model.

    Raises
    ------
    BadInput
        For the first thing that is wrong, with how many more there are.
    """
    try:
        return model.model_validate(document.value)
    except ValidationError as error:
        raise _bad_input(model, document, error) from None


def subject(value: Any, path: FieldPath) -> str:
    """Return a phrase for what stands at `path` in a file's value, with its id if it has one.

    Examples
    --------
    >>> subject({"robots": [{"id": "r1", "speed": 0}]}, ("robots", 0, "speed"))
    "robot 'r1': speed"
    >>> subject({"zones": {"lab": []}}, ("zones", "lab"))
    "zone 'lab'"
    """
    owner, words = "", ""
    kind = "value"
    for step in path:
        value = _item(value, step)
        if isinstance(step, str) and kind not in _NAMED:
            words, kind = step, step
            continue
        id = value.get("id") if isinstance(value, dict) else None
        label = step if isinstance(step, str) else id if isinstance(id, str) else None
        singular = kind.removesuffix("s").replace("_", " ")
        owner = f"{singular} {label!r}" if label is not None else f"{singular} {step}"
        words, kind = "", ""
    return f"{owner}: {words}" if owner and words else owner or words


_NAMED = frozenset(
    {"robots", "tasks", "obstacles", "motions", "places", "zones", "walls", "rules", "task_types"}
)
"""The fields whose entries are named in messages by their id, key or place in the list."""


def _item(value: Any, step: str | int) -> Any:
    try:
        return value[step]
    except (TypeError, LookupError):
        return None


def _bad_input(model: type[Section], document: Document, error: ValidationError) -> BadInput:
    details = error.errors(include_url=False)
    first = details[0]
    if first["type"] == "missing":  # most likely misspelt, if the same mapping has an unknown key
        unknown = (d for d in details if d["type"] == "extra_forbidden")
        first = next((d for d in unknown if d["loc"][:-1] == first["loc"][:-1]), first)
    path = tuple(step for step in first["loc"] if step != "[key]")
    problem, remedy = _phrase(model, document.value, path, first)
    more = len(details) - 1
    if more:
        problem += f" (and {more} more problem{'s' if more > 1 else ''} in this file)"
    return document.error(path, problem, remedy=remedy)


def _phrase(
    model: type[Section], value: Any, path: FieldPath, detail: ErrorDetails
) -> tuple[str, str]:
    """Say one pydantic error in our words: problem and remedy."""
    if detail["type"] == "extra_forbidden":
        known = [f.alias or name for name, f in _section(model, path[:-1]).model_fields.items()]
        where = subject(value, path[:-1])
        problem = f"{where + ': ' if where else ''}unknown key {str(path[-1])!r}"
        return problem, did_you_mean(str(path[-1]), known)
    about = subject(value, path)
    about = f"{about} " if about else ""
    match detail["type"]:
        case "oath":
            context: Mapping[str, Any] = detail["ctx"]
            return about + context["problem"], context["remedy"]
        case "missing":
            return f"{about}is missing", f"add `{path[-1]}: ...`"
        case "list_type":
            return f"{about}{show(detail['input'])} must be a list", "write [..., ...]"
        case "dict_type" | "model_type":
            problem = f"{about}{show(detail['input'])} must be a mapping"
            return problem, "write {key: value, ...}"
        case _:
            return f"{about}{show(detail['input'])} is wrong: {detail['msg']}", "see the docs"


def _section(model: type[Section], path: FieldPath) -> type[Section]:
    """Return the model of the mapping at `path`."""
    for step in path:
        field = next(
            (f for name, f in model.model_fields.items() if (f.alias or name) == step), None
        )
        if field is not None:
            model = _inner(field.annotation) or model
    return model


def _inner(annotation: Any) -> type[Section] | None:
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return annotation
    return next((m for m in map(_inner, get_args(annotation)) if m is not None), None)
