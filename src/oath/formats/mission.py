"""Read a mission file, schema ``oath/mission/1``."""

from __future__ import annotations

from pathlib import Path

from oath.errors import did_you_mean
from oath.formats import maps
from oath.formats.fields import show, validate
from oath.formats.mission_checks import check_geometry, check_names
from oath.formats.mission_schema import SCHEMA, MapSection, MissionFile, RobotSection, TaskSection
from oath.formats.yaml_document import Document, FieldPath, read_document
from oath.model import (
    Map,
    Mission,
    Motion,
    Obstacle,
    OccupancyGrid,
    Point,
    Robot,
    Stop,
    StopName,
    Task,
)

DEFAULT_MOTION = "ground"
DEFAULT_TYPE = "normal"
MARGIN = 1.0
"""How far default bounds reach beyond everything that the mission names [m]."""


def load(path: str | Path) -> Mission:
    """Read a mission file and check all of it that needs no roadmap.

    Parameters
    ----------
    path
        The YAML file. A map file that it names is looked up beside it.

    Returns
    -------
    Mission
        With every default filled in; lengths in metres, times in seconds.

    Raises
    ------
    BadInput
        If anything in it is wrong: names the file and line, the field, the value, the limit and
        the remedy.

    Examples
    --------
    >>> load("missing.yaml")
    Traceback (most recent call last):
    ...
    oath.errors.BadInput: missing.yaml: no such file; check the path
    """
    path = Path(path)
    document = read_document(path, what="mission")
    _check_schema(document)
    file = validate(MissionFile, document)
    motions = _motions(file)
    types = _task_types(file)
    check_names(document, file, motions=motions, types=types)
    mission = Mission(
        name=file.name or path.stem,
        map=_map(document, path, file),
        motions=motions,
        places=dict(file.places),
        task_types=types,
        robots=tuple(_robot(robot, motions, types) for robot in file.robots),
        tasks=tuple(_task(task, file, types) for task in file.tasks),
        zones=dict(file.zones),
        rules=tuple(rule.strip() for rule in file.rules),
        source=str(path),
    )
    check_geometry(document, mission)
    return mission


def files(path: str | Path) -> list[Path]:
    """Return the files that a mission consists of: its own first, then those of its map.

    Raises
    ------
    BadInput
        If one of them that names others is missing or broken.
    """
    path = Path(path)
    map = read_document(path, what="mission").value.get("map")
    named = map.get("file") if isinstance(map, dict) else None
    return [path, *(maps.files(path.parent / named) if isinstance(named, str) else [])]


def _check_schema(document: Document) -> None:
    """Look at the version before anything else: another version has other fields."""
    schema = document.value.get("schema", SCHEMA)
    if schema != SCHEMA:
        raise document.error(
            ("schema",), f"unknown schema {show(schema)}", remedy=f"this version reads '{SCHEMA}'"
        )


def _motions(file: MissionFile) -> dict[str, Motion]:
    if not file.motions:
        return {DEFAULT_MOTION: Motion(name=DEFAULT_MOTION)}
    return {
        name: Motion(name=name, ignores=section.ignores, cost=dict(section.cost))
        for name, section in file.motions.items()
    }


def _task_types(file: MissionFile) -> tuple[str, ...]:
    """Return the listed types; if none are, "normal" and those that robots name."""
    if file.task_types:
        return file.task_types
    named = (type for robot in file.robots for type in robot.can or ())
    return tuple(dict.fromkeys([DEFAULT_TYPE, *named]))


def _robot(section: RobotSection, motions: dict[str, Motion], types: tuple[str, ...]) -> Robot:
    return Robot(
        id=section.id,
        start=section.start,
        motion=section.motion or next(iter(motions)),
        can=dict.fromkeys(types, 1.0) if section.can is None else dict(section.can),
        capacity=section.capacity,
        speed=section.speed,
        radius=section.radius,
        sensing=section.sensing,
    )


def _task(section: TaskSection, file: MissionFile, types: tuple[str, ...]) -> Task:
    return Task(
        id=section.id,
        type=section.type or types[0],
        stops=tuple(_stop(name, at, file) for name, at in section.stops),
        priority=section.priority,
        service_time=section.service_time,
    )


def _stop(name: StopName, at: Point | str, file: MissionFile) -> Stop:
    if isinstance(at, str):
        return Stop(name=name, at=file.places[at], place=at)
    return Stop(name=name, at=at)


def _map(document: Document, path: Path, file: MissionFile) -> Map:
    section = file.map
    grid = None if section.file is None else _grid(document, path, section.file)
    return Map(
        bounds=_bounds(document, section, grid) or _box(file),
        walls=tuple(section.walls),
        wall_thickness=section.wall_thickness,
        grid=grid,
        obstacles=tuple(
            Obstacle(id=o.id, kind=o.kind, polygon=o.polygon, known=o.known)
            for o in section.obstacles
        ),
    )


def _grid(document: Document, path: Path, file: str) -> OccupancyGrid:
    field: FieldPath = ("map", "file")
    target = path.parent / file
    if target.suffix.lower() not in maps.FORMATS:
        raise document.error(
            field,
            f"map file {file!r} has the unknown suffix {target.suffix!r}",
            remedy=did_you_mean(target.suffix, list(maps.FORMATS)),
        )
    try:
        found = target.is_file()
    except (OSError, ValueError):  # a name too long, or a NUL in it
        found = False
    if not found:
        raise document.error(
            field,
            f"map file {file!r}: no such file {target}",
            remedy="give its path relative to the mission file",
        )
    return maps.read(target)


def _bounds(
    document: Document, section: MapSection, grid: OccupancyGrid | None
) -> tuple[float, float, float, float] | None:
    """Return the given bounds, or the map file's; the given ones must lie in the file's."""
    if grid is None:
        return section.bounds
    rows, columns = grid.occupied.shape
    x, y = grid.origin
    whole = (x, y, x + columns * grid.resolution, y + rows * grid.resolution)
    if section.bounds is None:
        return whole
    slack = 1e-6 * grid.resolution  # decimals of the file against sums of binary fractions
    x_min, y_min, x_max, y_max = section.bounds
    excess = max(whole[0] - x_min, whole[1] - y_min, x_max - whole[2], y_max - whole[3])
    if excess > slack:
        given, limits = (", ".join(f"{x:g}" for x in box) for box in (section.bounds, whole))
        raise document.error(
            ("map", "bounds"),
            f"bounds [{given}] reach beyond the map file's [{limits}]",
            remedy="shrink them, or leave them out to use the whole map",
        )
    return section.bounds


def _box(file: MissionFile) -> tuple[float, float, float, float]:
    """Return bounds around everything named, wide enough to drive around it."""
    named = [robot.start for robot in file.robots] + list(file.places.values())
    named += [at for task in file.tasks for _, at in task.stops if not isinstance(at, str)]
    outlines = [*file.map.walls, *(o.polygon for o in file.map.obstacles), *file.zones.values()]
    named += [corner for outline in outlines for corner in outline]
    xs, ys = zip(*named, strict=True)
    return min(xs) - MARGIN, min(ys) - MARGIN, max(xs) + MARGIN, max(ys) + MARGIN
