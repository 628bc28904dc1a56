"""Small missions in code: by hand with few words, or random and odd from a seed."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import shapely
from hypothesis import strategies as st

from oath.model import (
    Map,
    Mission,
    Motion,
    Obstacle,
    Point,
    Polygon,
    Priority,
    Robot,
    Stop,
    Task,
)

MOTIONS = {
    "ground": Motion(name="ground"),
    "drone": Motion(name="drone", ignores=frozenset({"bush"})),
    "wader": Motion(name="wader", cost={"bush": 3.0}),
}
"""One that everything blocks, one that ignores bushes, one that pays for them."""

TYPES = ("carry", "inspect")
SIZE = 10.0


def box(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def robot(id: str, start: Point, **changes: Any) -> Robot:
    values: dict[str, Any] = {
        "motion": "ground",
        "can": dict.fromkeys(TYPES, 1.0),
        "capacity": 1,
        "speed": 1.0,
        "radius": 0.2,
        "sensing": 1.5,
    }
    return Robot(id=id, start=start, **(values | changes))


def delivery(id: str, pickup: Point, to: Point, **changes: Any) -> Task:
    stops = (Stop(name="pickup", at=pickup), Stop(name="delivery", at=to))
    return Task(id=id, **({"type": TYPES[0], "stops": stops} | changes))


def visit(id: str, at: Point, **changes: Any) -> Task:
    return Task(id=id, **({"type": TYPES[0], "stops": (Stop(name="visit", at=at),)} | changes))


def gate(id: str, polygon: Polygon, *, known: bool = False) -> Obstacle:
    """Something that blocks every motion."""
    return Obstacle(id=id, kind="gate", polygon=polygon, known=known)


def bush(id: str, polygon: Polygon, *, known: bool = False) -> Obstacle:
    """Something that drones ignore and waders pay for."""
    return Obstacle(id=id, kind="bush", polygon=polygon, known=known)


def yard(robots: Sequence[Robot], tasks: Sequence[Task], **changes: Any) -> Mission:
    """Return a mission in a walled yard of 10 m x 10 m; `changes` go to its map or to itself."""
    of_map = ("bounds", "walls", "wall_thickness", "obstacles")
    about = {key: changes.pop(key) for key in of_map if key in changes}
    map = Map(**({"bounds": (0.0, 0.0, SIZE, SIZE), "wall_thickness": 0.2} | about))
    values: dict[str, Any] = {
        "name": "yard",
        "map": map,
        "motions": MOTIONS,
        "places": {},
        "task_types": TYPES,
        "robots": tuple(robots),
        "tasks": tuple(tasks),
        "zones": {},
        "rules": (),
    }
    return Mission(**(values | changes))


CELL_DOOR = box(6.9, 4.0, 7.1, 6.0)
"""Where the door of `cell` is: the only way into the room on the right."""


def cell(robots: Sequence[Robot], tasks: Sequence[Task], **changes: Any) -> Mission:
    """Return a yard whose right part is a room, x > 7, with one door, 4 < y < 6."""
    walls = (((7.0, 0.0), (7.0, 4.0)), ((7.0, 6.0), (7.0, SIZE)))
    return yard(robots, tasks, walls=walls, **changes)


RULES = ("G !lab", "!lab W t0", "F p", "G (lab -> F p)", "F p & G !lab")


def random_mission(seed: int) -> Mission:
    """Return a mission that is the same for the same seed: its starts and stops are free."""
    rng = random.Random(seed)
    while True:
        mission = _draw(rng)
        if _free(mission):
            return mission


def missions() -> st.SearchStrategy[Mission]:
    """Return random missions."""
    return st.integers(0, 2**32 - 1).map(random_mission)


def _draw(rng: random.Random) -> Mission:
    spots = [_spot(rng) for _ in range(rng.randint(1, 9))]

    def anywhere() -> Point:
        # Few spots: robots and stops then share points more often than chance would have it.
        return rng.choice(spots)

    robots = [_robot(rng, f"r{i}", anywhere()) for i in range(rng.randint(1, 4))]
    tasks = [_task(rng, f"t{i}", anywhere(), anywhere()) for i in range(rng.randint(0, 8))]
    obstacles = [_obstacle(rng, f"o{i}") for i in range(rng.randint(0, 5))]
    walls = [(_spot(rng), _spot(rng)) for _ in range(rng.randint(0, 3))]
    zoned = rng.random() < 0.4
    rules = rng.sample(RULES, rng.randint(1, 2)) if zoned and tasks else []
    return yard(
        robots,
        tasks,
        walls=tuple(walls),
        obstacles=tuple(obstacles),
        places={"p": anywhere()},
        zones={"lab": _block(rng, 2.0)} if zoned else {},
        rules=tuple(rules),
    )


def _spot(rng: random.Random) -> Point:
    # Half of them on a raster, where points, walls and corners fall onto each other.
    if rng.random() < 0.5:
        return (float(rng.randint(1, 9)), float(rng.randint(1, 9)))
    return (round(rng.uniform(0.4, 9.6), 3), round(rng.uniform(0.4, 9.6), 3))


def _block(rng: random.Random, size: float) -> Polygon:
    x, y = _spot(rng)
    return box(x, y, x + rng.uniform(0.1, size), y + rng.uniform(0.1, size))


def _robot(rng: random.Random, id: str, start: Point) -> Robot:
    return robot(
        id,
        start,
        motion=rng.choice(list(MOTIONS)),
        can=rng.choice([{"carry": 1.0}, {"carry": 1.0, "inspect": 0.3}, {"inspect": 1.0}]),
        capacity=rng.randint(1, 3),
        speed=rng.choice([0.5, 1.0, 2.0]),
        radius=rng.choice([0.1, 0.2, 0.35]),
        sensing=rng.choice([0.3, 1.5, 4.0]),
    )


def _task(rng: random.Random, id: str, one: Point, other: Point) -> Task:
    priorities: list[Priority] = ["low", "normal", "high"]
    values = {
        "type": rng.choice(TYPES),
        "priority": rng.choices(priorities, [1, 3, 1])[0],
        "service_time": rng.choice([0.0, 0.0, 2.5]),
    }
    if rng.random() < 0.6:
        return delivery(id, one, other, **values)
    return visit(id, one, **values)


def _obstacle(rng: random.Random, id: str) -> Obstacle:
    make = rng.choice([gate, bush])
    if rng.random() < 0.4:  # long and thin: it may close a door
        x, y = _spot(rng)
        length = rng.uniform(1.0, 5.0)
        size = (length, 0.2) if rng.random() < 0.5 else (0.2, length)
        polygon = box(x, y, x + size[0], y + size[1])
        return make(id, polygon, known=rng.random() < 0.3)
    return make(id, _block(rng, 1.5), known=rng.random() < 0.3)


def _free(mission: Mission) -> bool:
    """Whether starts are clear of all that blocks, and one robot fits at each task's stops."""
    return all(
        _clear(mission, robot, [robot.start], unknown=True) for robot in mission.robots
    ) and all(
        any(
            task.type in robot.can
            and _clear(mission, robot, [stop.at for stop in task.stops], unknown=False)
            for robot in mission.robots
        )
        for task in mission.tasks
    )


def _clear(mission: Mission, robot: Robot, points: Sequence[Point], *, unknown: bool) -> bool:
    motion = mission.motions[robot.motion]
    solid = [
        shapely.Polygon(obstacle.polygon)
        for obstacle in mission.map.obstacles
        if motion.blocked_by(obstacle.kind) and (unknown or obstacle.known)
    ]
    half = mission.map.wall_thickness / 2
    walls = [shapely.LineString(wall) for wall in mission.map.walls]
    return all(
        all(shape.distance(shapely.Point(at)) > robot.radius for shape in solid)
        and all(wall.distance(shapely.Point(at)) > robot.radius + half for wall in walls)
        for at in points
    )
