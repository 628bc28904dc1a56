"""The paper's maze, tasks and published figures: facts, for comparison.

Source: Li, Ren, Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task Assignment and Planning
for Heterogeneous Robot Teaming", 2025. Lengths are metres, times seconds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from oath.model import Map, Mission, Motion, Point, Robot, Stop, Task
from oath.world.workspace import Workspace

WALLS: tuple[tuple[Point, ...], ...] = (
    ((0, 3), (2, 3), (2, 4)),
    ((0, 5), (2, 5)),
    ((0, 7), (2, 7), (2, 6)),
    ((4, 9), (6, 9), (6, 10)),
    ((6, 7), (4, 7), (4, 5)),
    ((5, 5), (7, 5), (7, 7)),
    ((8, 5), (8, 7), (10, 7)),
    ((4, 2), (4, 4), (5, 4)),
    ((6, 4), (7, 4), (7, 2), (5, 2)),
    ((10, 3), (12, 3), (12, 4)),
    ((10, 5), (12, 5)),
    ((10, 7), (12, 7), (12, 6)),
    ((14, 9), (16, 9), (16, 10)),
    ((16, 7), (14, 7), (14, 5)),
    ((15, 5), (17, 5), (17, 7)),
    ((18, 5), (18, 7), (20, 7)),
    ((14, 2), (14, 4), (15, 4)),
    ((16, 4), (17, 4), (17, 2), (15, 2)),
    ((0, 13), (2, 13), (2, 14)),
    ((0, 15), (2, 15)),
    ((0, 17), (2, 17), (2, 16)),
    ((4, 19), (6, 19), (6, 20)),
    ((6, 17), (4, 17), (4, 15)),
    ((5, 15), (7, 15), (7, 17)),
    ((8, 15), (8, 17), (10, 17)),
    ((4, 12), (4, 14), (5, 14)),
    ((6, 14), (7, 14), (7, 12), (5, 12)),
    ((10, 13), (12, 13), (12, 14)),
    ((10, 15), (12, 15)),
    ((10, 17), (12, 17), (12, 16)),
    ((14, 19), (16, 19), (16, 20)),
    ((16, 17), (14, 17), (14, 15)),
    ((15, 15), (17, 15), (17, 17)),
    ((18, 15), (18, 17), (20, 17)),
    ((14, 12), (14, 14), (15, 14)),
    ((16, 14), (17, 14), (17, 12), (15, 12)),
    ((0, 10), (6, 10)),
    ((10, 0), (10, 7)),
    ((14, 10), (20, 10)),
    ((10, 13), (10, 20)),
)

DELIVERIES: dict[str, Point] = {"b": (6, 3), "c": (5, 16), "d": (16, 13), "e": (16, 5.5)}
PICKUPS: dict[str, Point] = {
    "bb": (1.0, 4.0),
    "cb": (6.0, 6.0),
    "db": (1.0, 6.5),
    "eb": (5.5, 9.5),
    "fb": (9.0, 6.5),
    "gb": (1.0, 1.5),
    "bc": (1.0, 13.5),
    "cc": (9.0, 16.5),
    "dc": (1.0, 16.0),
    "ec": (6.0, 13.0),
    "fc": (5.0, 19.5),
    "gc": (9.0, 19.5),
    "bd": (11.0, 13.5),
    "cd": (11.0, 16.5),
    "dd": (19.0, 16.5),
    "ed": (19.0, 19.0),
    "fd": (15.0, 19.5),
    "gd": (19.0, 11.0),
    "be": (11.0, 4.0),
    "ce": (19.0, 6.5),
    "de": (16.0, 3.0),
    "ee": (19.0, 1.0),
    "fe": (11.0, 1.5),
    "ge": (19.0, 9.5),
    "he": (11.0, 6.5),
}
"""By task; the last letter of a task names its delivery point."""

STARTS: dict[str, Point] = {
    "robot1": (1, 19),
    "robot2": (11, 19),
    "robot3": (9, 11),
    "robot4": (11, 9),
}
SPECIAL = ("bb", "cd", "db", "eb", "fd")
"""Tasks that need one of `GENERALISTS`."""

GENERALISTS = ("robot2", "robot3")

TASK_SETS: dict[int, tuple[str, ...]] = {
    9: ("bb", "cb", "bc", "cc", "bd", "cd", "be", "ce", "de"),
    10: ("bb", "cb", "bc", "cc", "bd", "cd", "dd", "be", "ce", "de"),
    12: ("bb", "cb", "db", "bc", "cc", "dc", "bd", "cd", "dd", "be", "ce", "de"),
    15: ("bb", "cb", "db", "bc", "cc", "dc", "ec", "bd", "cd", "dd", "ed", "be", "ce", "de", "ee"),
    18: (
        "bb",
        "cb",
        "db",
        "eb",
        "fb",
        "bc",
        "cc",
        "dc",
        "ec",
        "bd",
        "cd",
        "dd",
        "ed",
        "fd",
        "be",
        "ce",
        "de",
        "ee",
    ),
    20: (
        "bb",
        "cb",
        "db",
        "eb",
        "fb",
        "bc",
        "cc",
        "dc",
        "ec",
        "fc",
        "bd",
        "cd",
        "dd",
        "ed",
        "fd",
        "be",
        "ce",
        "de",
        "ee",
        "fe",
    ),
    25: (
        "bb",
        "cb",
        "db",
        "eb",
        "fb",
        "gb",
        "bc",
        "cc",
        "dc",
        "ec",
        "fc",
        "gc",
        "bd",
        "cd",
        "dd",
        "ed",
        "fd",
        "gd",
        "be",
        "ce",
        "de",
        "ee",
        "fe",
        "ge",
        "he",
    ),
}

FIVE_TYPES: dict[str, tuple[str, ...]] = {
    "type1": ("bb", "fb", "gb", "he", "ec"),
    "type2": ("db", "bc", "dc", "fc", "gc"),
    "type3": ("cc", "eb", "gd", "ce"),
    "type4": ("cd", "dd", "ed", "fd", "de"),
    "type5": ("bd", "be", "ee", "fe", "ge", "cb"),
}

FIVE_CAPABILITIES: dict[str, tuple[int, ...]] = {
    "robot1": (1, 0, 1, 1, 0),
    "robot2": (1, 0, 0, 1, 1),
    "robot3": (1, 0, 1, 0, 1),
    "robot4": (1, 1, 1, 1, 0),
}

VERSUS_MILP = {
    "tasks": (9, 12, 15, 18, 21),
    "oath_distance": (88.108, 102.446, 125.051, 146.529, 208.357),
    "milp_distance": (67.043, 85.381, 108.226, 133.006, 155.572),
    "oath_seconds": (0.0716, 0.0837, 0.2011, 0.3237, 0.3663),
    "milp_seconds": (3.96, 32.94, 600, 600, 600),
}
"""Distances and seconds by number of tasks; straight lines from a start to its first stop."""

TOTAL_STEPS = {
    "tasks": (10, 15, 20, 25, 30),
    "CBBA": (314, 667, 773, 954, 1031),
    "KAN": (332, 451, 555, 654, 820),
    "KAM": (330, 456, 510, 608, 802),
    "OATH": (222, 351, 463, 562, 768),
}

TOTAL_SECONDS = {
    "tasks": (10, 15, 20, 25, 30),
    "CBBA": (68.53, 94.2, 106.02, 111.96, 124.94),
    "KAN": (54.79, 84.13, 90.66, 95.02, 113.14),
    "KAM": (54.6, 83.3, 85.96, 95.35, 129.95),
    "OATH": (40.36, 60.11, 76.98, 94.76, 103.63),
}

SCALABILITY = {"tasks": (25, 100), "steps": (917, 2543), "seconds": (109, 255)}

SENSITIVITY = {"P": 0.015, "R": 0.010, "Q": 0.13}
"""Growth of the paper's allocation time per task, robot and unit of capacity [s]."""


def maze(
    tasks: Sequence[str] = TASK_SETS[25], *, capacity: int = 3, five_types: bool = False
) -> Mission:
    """The paper's maze with some of its tasks, two types of task or five."""
    kinds = {task: kind for kind, members in FIVE_TYPES.items() for task in members}
    can = {
        robot: {f"type{i + 1}": 1.0 for i, able in enumerate(row) if able}
        for robot, row in FIVE_CAPABILITIES.items()
    }
    if not five_types:
        kinds = {task: "special" if task in SPECIAL else "normal" for task in PICKUPS}
        can = {
            robot: {"normal": 1.0} | ({"special": 1.0} if robot in GENERALISTS else {})
            for robot in STARTS
        }
    return _mission(
        f"maze-{len(tasks):02}",
        [(task, PICKUPS[task], task[-1], kinds[task]) for task in tasks],
        [(robot, at, can[robot]) for robot, at in STARTS.items()],
        capacity,
    )


def random_maze(
    tasks: int, robots: int = 4, *, types: int = 2, capacity: int = 3, seed: int = 0
) -> Mission:
    """The paper's maze with random pickups and, beyond its four robots, random starts.

    Every pickup keeps 0.3 m from the walls and goes to one of the four delivery points. With two
    types, one task in five is special and every other robot can do both; with more, each robot can
    do about three fifths of them, and each type is done by at least two robots.
    """
    rng = np.random.default_rng([seed, tasks, robots, types])
    at = _free_points(tasks + robots, rng)
    names = ["normal", "special"] if types == 2 else [f"type{i + 1}" for i in range(types)]
    if types == 2:
        drawn = (rng.random(tasks) < 0.2).astype(np.int64)
        able = np.array([[True, r % 4 in (1, 2)] for r in range(robots)])
    else:
        drawn = rng.integers(0, types, tasks)
        able = rng.random((robots, types)) < 0.6
        for t in range(types):
            able[[t % robots, (t + 1) % robots], t] = True
    starts = [*STARTS.values(), *at[tasks:]][:robots]
    places = list(DELIVERIES)
    goals = rng.integers(0, len(places), tasks)
    return _mission(
        f"maze-{tasks}-{robots}-{seed}",
        [(f"t{i}", at[i], places[goals[i]], names[int(drawn[i])]) for i in range(tasks)],
        [
            (f"robot{r + 1}", starts[r], {names[t]: 1.0 for t in range(types) if able[r, t]})
            for r in range(robots)
        ],
        capacity,
        names=tuple(names),
    )


def _free_points(count: int, rng: np.random.Generator) -> list[Point]:
    workspace = Workspace(MAP)
    points: list[Point] = []
    while len(points) < count:
        batch = np.round(rng.random((count, 2)) * 19 + 0.5, 2)
        clear = workspace.clearance(batch, None) >= 0.3
        points += [(float(x), float(y)) for x, y in batch[clear]]
    return points[:count]


MAP = Map(bounds=(0.0, 0.0, 20.0, 20.0), walls=WALLS, wall_thickness=0.2)


def _mission(
    name: str,
    tasks: Sequence[tuple[str, Point, str, str]],
    robots: Sequence[tuple[str, Point, dict[str, float]]],
    capacity: int,
    names: tuple[str, ...] | None = None,
) -> Mission:
    found = dict.fromkeys(kind for *_, can in robots for kind in can)
    return Mission(
        name=name,
        map=MAP,
        motions={"ground": Motion(name="ground")},
        places=DELIVERIES,
        task_types=names or tuple(found),
        robots=tuple(
            Robot(
                id=id,
                start=at,
                motion="ground",
                can=can,
                capacity=capacity,
                speed=1.0,
                radius=0.2,
                sensing=1.5,
            )
            for id, at, can in robots
        ),
        tasks=tuple(
            Task(
                id=id,
                type=kind,
                stops=(
                    Stop(name="pickup", at=at),
                    Stop(name="delivery", at=DELIVERIES[goal], place=goal),
                ),
            )
            for id, at, goal, kind in tasks
        ),
        zones={},
        rules=(),
    )
