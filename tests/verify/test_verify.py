"""A good log passes, and for every rule of the judge there are logs that break just that rule."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import hypot, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oath import events as ev
from oath.errors import BadInput
from oath.model import (
    Map,
    Mission,
    Motion,
    Obstacle,
    OccupancyGrid,
    Point,
    Robot,
    RouteStop,
    Stop,
    Task,
)
from oath.verify import Verdict, verify

Log = list[ev.AnyEvent]

CRATE = ((7.0, 1.0), (8.0, 1.0), (8.0, 2.0), (7.0, 2.0))
BUSH = ((7.0, 6.0), (8.0, 6.0), (8.0, 7.0), (7.0, 7.0))
LAB = ((8.5, 8.0), (9.5, 8.0), (9.5, 9.0), (8.5, 9.0))


def delivery(id: str, pickup: Point, to: Point, type: str = "normal", time: float = 0.0) -> Task:
    stops = (Stop(name="pickup", at=pickup), Stop(name="delivery", at=to))
    return Task(id=id, type=type, stops=stops, service_time=time)


def visit(id: str, at: Point, type: str = "normal", time: float = 0.0) -> Task:
    return Task(id=id, type=type, stops=(Stop(name="visit", at=at),), service_time=time)


def robot(id: str, start: Point, **changes: Any) -> Robot:
    values = {"motion": "ground", "can": {"normal": 1.0}, "capacity": 1, "speed": 1.0}
    return Robot(id=id, start=start, **{**values, "radius": 0.2, "sensing": 1.5, **changes})


def yard() -> Mission:
    occupied = np.zeros((20, 20), dtype=bool)
    occupied[16, 4] = True  # x 2.0 to 2.5, y 8.0 to 8.5
    return Mission(
        name="yard",
        map=Map(
            bounds=(0, 0, 10, 10),
            walls=(((5.0, 0.0), (5.0, 4.0)),),
            wall_thickness=0.2,
            grid=OccupancyGrid(occupied=occupied, resolution=0.5, origin=(0, 0)),
            obstacles=(
                Obstacle(id="crate", kind="crate", polygon=CRATE),
                Obstacle(id="bush", kind="bush", polygon=BUSH, known=False),
            ),
        ),
        motions={
            "ground": Motion(name="ground"),
            "drone": Motion(name="drone", ignores=frozenset({"bush"})),
        },
        places={"dock": (1, 2)},
        task_types=("normal", "special"),
        robots=(
            robot("g", (1, 1)),
            robot(
                "d",
                (1, 7),
                motion="drone",
                can={"special": 0.5, "normal": 1.0},
                capacity=2,
                speed=2.0,
            ),
        ),
        tasks=(
            delivery("t1", (1, 3), (3, 5), time=1.0),
            visit("t2", (9, 5), type="special"),
            delivery("t3", (3, 1), (3, 3)),
        ),
        zones={"lab": LAB},
        rules=("G !lab",),
    )


def started(mission: str = "yard") -> ev.MissionStarted:
    return ev.MissionStarted(t=0.0, mission=mission, allocator="hand", seed=0)


def moved(who: str, a: Point, b: Point, start: float, end: float) -> ev.Moved:
    return ev.Moved(t=end, robot=who, from_=a, to=b, start=start, end=end)


def served(who: str, task: str, stop: Any, at: Point, t: float) -> ev.StopServed:
    return ev.StopServed(t=t, robot=who, task=task, stop=stop, at=at)


def body() -> Log:
    return [
        started(),
        moved("g", (1, 1), (1, 3), 0, 2),
        moved("d", (1, 7), (6, 7), 0, 2.5),
        ev.ObstacleFound(t=2.5, robot="d", obstacle="bush", polygon=BUSH),
        served("g", "t1", "pickup", (1, 3), 3),
        moved("d", (6, 7), (9, 5), 2.5, 4.5),
        served("d", "t2", "visit", (9, 5), 4.5),
        moved("g", (1, 3), (3, 5), 3, 6),
        served("g", "t1", "delivery", (3, 5), 7),
        moved("g", (3, 5), (3, 1), 7, 11),
        served("g", "t3", "pickup", (3, 1), 11),
        moved("g", (3, 1), (3, 3), 11, 13),
        served("g", "t3", "delivery", (3, 3), 13),
    ]


def finish(log: Log, tasks: tuple[Task, ...], **changes: Any) -> Log:
    """Close a log with a summary that agrees with it, but for `changes`."""
    tasks += tuple(e.task for e in log if isinstance(e, ev.TaskAdded))
    stops = {(e.task, e.stop) for e in log if isinstance(e, ev.StopServed)}
    moves = [e for e in log if isinstance(e, ev.Moved)]
    done = [t.id for t in tasks if all((t.id, s.name) in stops for s in t.stops)]
    summary = {
        "completed": len(done),
        "unserved": {},
        "total_steps": len(moves),
        "total_distance": sum(hypot(e.to[0] - e.from_[0], e.to[1] - e.from_[1]) for e in moves),
        "makespan": max((e.t for e in log if isinstance(e, ev.StopServed)), default=0.0),
        **changes,
    }
    end = max((e.t for e in log), default=0.0)
    return [*log, ev.MissionFinished(t=end, summary=summary)]


def judge(log: Log, mission: Mission | None = None, **changes: Any) -> Verdict:
    mission = mission or yard()
    return verify(mission, finish(log, mission.tasks, **changes))


def rules(verdict: Verdict) -> set[str]:
    return {violation.rule for violation in verdict.violations}


def test_good_log_passes() -> None:
    verdict = judge(body())
    assert verdict.ok, verdict.violations
    assert verdict.checked == {
        "events": 14,
        "moves": 6,
        "stops": 5,
        "tasks": 3,
        "obstacles": 2,
        "found": 1,
        "rules": 2,
    }


def alter(i: int, **changes: Any) -> Callable[[Log], Log]:
    return lambda log: [*log[:i], replace(log[i], **changes), *log[i + 1 :]]


def drop(*places: int) -> Callable[[Log], Log]:
    return lambda log: [event for i, event in enumerate(log) if i not in places]


def insert(at: int, *new: ev.AnyEvent) -> Callable[[Log], Log]:
    return lambda log: [*log[:at], *new, *log[at:]]


def append(*new: ev.AnyEvent) -> Callable[[Log], Log]:
    return lambda log: [*log, *new]


def added(task: Task, t: float = 0.0) -> ev.TaskAdded:
    return ev.TaskAdded(t=t, task=task)


def grown(id: str, x: float, y: float, size: float, t: float, kind: str = "box") -> Any:
    polygon = ((x, y), (x + size, y), (x + size, y + size), (x, y + size))
    return ev.ObstacleAdded(t=t, obstacle=id, kind=kind, polygon=polygon)


def asked(intent: str, **parameters: Any) -> ev.Commanded:
    command = {"intent": intent, "parameters": parameters}
    return ev.Commanded(t=0.0, command=command, source="test")


def answered(*stops: str) -> ev.Allocated:
    """Return a round that gives g a route: ``+a`` picks a up, ``-a`` delivers it."""
    names: dict[str, Any] = {"+": "pickup", "-": "delivery"}
    route = tuple(RouteStop(task=stop[1:], stop=names[stop[0]]) for stop in stops)
    return ev.Allocated(t=0.0, round=1, seconds=0.0, routes={"g": route, "d": ()}, unassigned={})


HIGH = ev.PriorityChanged(t=0.0, task="t3", priority="high")
HERE = delivery("t4", (3, 3), (3, 3))
SLOW = delivery("t4", (3, 3), (3, 3), time=2.0)

BROKEN: list[tuple[str, str, Callable[[Log], Log]]] = [
    ("order", "no start", drop(0)),
    ("order", "starts twice", insert(1, started())),
    ("order", "another mission", alter(0, mission="farm")),
    ("order", "time goes back", insert(5, ev.PriorityChanged(t=1.0, task="t1", priority="high"))),
    ("order", "move logged at another time than its end", alter(1, t=1.0)),
    ("order", "move ends before it starts", append(moved("g", (3, 3), (3, 3), 14, 13))),
    ("order", "not a number", insert(1, ev.PriorityChanged(t=nan, task="t1", priority="high"))),
    ("names", "unknown robot", append(ev.RobotPaused(t=13.0, robot="x"))),
    ("names", "unknown task", append(served("g", "t9", "visit", (3, 3), 13))),
    ("names", "unknown stop", append(served("g", "t3", "visit", (3, 3), 13))),
    ("names", "unknown task cancelled", append(ev.TaskCancelled(t=13.0, task="t9"))),
    ("names", "known task added", append(added(HERE, 13.0), added(HERE, 13.0))),
    ("names", "unknown obstacle", append(ev.ObstacleRemoved(t=13.0, obstacle="rock"))),
    ("names", "known obstacle added", append(grown("crate", 0, 0, 1, 13))),
    (
        "names",
        "unknown robot in the routes",
        insert(1, ev.Allocated(t=0.0, round=1, seconds=0.0, routes={"x": ()}, unassigned={})),
    ),
    ("unserved", "a task without its stop", drop(6)),
    ("unserved", "a task without its last stop", drop(12)),
    ("unserved", "an added task", insert(1, added(HERE))),
    ("served_twice", "a stop again", append(served("g", "t3", "delivery", (3, 3), 13))),
    (
        "stop_order",
        "delivery before pickup",
        append(
            added(HERE, 13),
            served("g", "t4", "delivery", (3, 3), 13),
            served("g", "t4", "pickup", (3, 3), 13),
        ),
    ),
    (
        "one_robot",
        "another robot delivers",
        append(
            added(delivery("t4", (3, 3), (3, 3)), 13),
            served("g", "t4", "pickup", (3, 3), 13),
            moved("d", (9, 5), (5, 6), 13, 16),
            moved("d", (5, 6), (3, 3), 16, 18),
            served("d", "t4", "delivery", (3, 3), 18),
        ),
    ),
    (
        "capability",
        "a robot that cannot",
        append(added(visit("t4", (3, 3), "special"), 13), served("g", "t4", "visit", (3, 3), 13)),
    ),
    ("cancelled", "served after it was cancelled", insert(1, ev.TaskCancelled(t=0.0, task="t2"))),
    ("position", "the logged point is not the stop's", alter(6, at=(9, 5.001))),
    ("position", "the robot is elsewhere", alter(5, to=(9, 5.001))),
    ("service_time", "too short", alter(4, t=2.9)),
    (
        "service_overlap",
        "two at once",
        append(
            added(SLOW, 13),
            served("g", "t4", "pickup", (3, 3), 15),
            served("g", "t4", "delivery", (3, 3), 16),
        ),
    ),
    (
        "service_overlap",
        "while driving",
        insert(
            1, added(visit("t4", (4, 7), "special"), 1.5), served("d", "t4", "visit", (4, 7), 1.5)
        ),
    ),
    (
        "capacity",
        "two carried",
        append(
            added(HERE, 13),
            added(replace(HERE, id="t5"), 13),
            served("g", "t4", "pickup", (3, 3), 13),
            served("g", "t5", "pickup", (3, 3), 13),
            served("g", "t4", "delivery", (3, 3), 13),
            served("g", "t5", "delivery", (3, 3), 13),
        ),
    ),
    ("contiguity", "not from the start", alter(1, from_=(1, 1.1))),
    ("contiguity", "a jump", alter(5, from_=(6, 6.9))),
    ("contiguity", "two moves at once", alter(5, start=2.4)),
    ("bounds", "outside", append(moved("g", (3, 3), (-0.1, 3), 13, 17))),
    ("speed", "too fast", alter(2, start=0.01)),
    (
        "halted",
        "moves while paused",
        lambda log: [
            *log[:7],
            ev.RobotPaused(t=4.5, robot="g"),
            ev.RobotResumed(t=5.0, robot="g"),
            *log[7:],
        ],
    ),
    (
        "halted",
        "serves while paused",
        append(
            ev.RobotPaused(t=13.0, robot="g"),
            added(visit("t4", (3, 3)), 13.0),
            served("g", "t4", "visit", (3, 3), 13.5),
            ev.RobotResumed(t=14.0, robot="g"),
        ),
    ),
    ("command", "without effect", insert(1, asked("cancel_task", task_label="t1"))),
    (
        "command",
        "with another effect",
        insert(1, asked("change_task_priority", task_label="t1"), HIGH),
    ),
    (
        "command",
        "with another wall",
        insert(
            1,
            asked("obstacle_update", obstacle_location=[[8, 9], [9, 9]]),
            grown("box", 8, 9, 0.5, 0.0),
        ),
    ),
    ("priority", "urgent work waits", insert(1, HIGH, answered("+t1", "-t1", "+t3", "-t3"))),
    ("halted", "moves after it failed", insert(2, ev.RobotFailed(t=2.0, robot="d"))),
    (
        "halted",
        "serves after it failed",
        append(
            ev.RobotFailed(t=13.0, robot="g"),
            added(visit("t4", (3, 3)), 13.0),
            served("g", "t4", "visit", (3, 3), 13.5),
        ),
    ),
    ("wall", "through it", append(moved("g", (3, 3), (6, 3), 13, 16))),
    ("wall", "along it, too near", append(moved("g", (3, 3), (4.7 + 2e-6, 3), 13, 16))),
    ("wall", "around its end, too near", append(moved("d", (9, 5), (4, 4.05), 13, 17))),
    ("cell", "through it", append(moved("g", (3, 3), (2.2, 9), 13, 20))),
    ("cell", "too near", append(moved("g", (3, 3), (2.7 - 2e-6, 8.2), 13, 20))),
    ("obstacle", "known", append(moved("d", (9, 5), (7.5, 1.5), 13, 16))),
    ("obstacle", "known, too near", append(moved("d", (9, 5), (8.19, 1.5), 13, 16))),
    (
        "obstacle",
        "unknown",
        append(moved("g", (3, 3), (3, 6), 13, 16), moved("g", (3, 6), (8, 6.5), 16, 22)),
    ),
    (
        "obstacle",
        "added",
        append(grown("box", 3.5, 3.5, 1, 13), moved("g", (3, 3), (5, 5), 13, 16)),
    ),
    (
        "obstacle",
        "added in the middle of a move",
        append(grown("box", 3, 7, 1, 14), moved("g", (3, 3), (3, 7), 13, 17)),
    ),
    (
        "obstacle",
        "already too near and comes nearer",
        append(grown("box", 3.1, 2.5, 1, 13), moved("g", (3, 3), (3.05, 3), 13, 14)),
    ),
    (
        "obstacle",
        "was too near, has left and comes back",
        append(
            grown("box", 3.1, 2.5, 1, 13),
            moved("g", (3, 3), (2.5, 3), 13, 14),
            moved("g", (2.5, 3), (3, 3), 14, 15),
        ),
    ),
    (
        "obstacle",
        "a wall by its kind",
        append(grown("w", 3, 4, 1, 13, "wall"), moved("g", (3, 3), (3, 4), 13, 14)),
    ),
    ("sensing", "too far", alter(3, robot="g")),
    ("sensing", "known", alter(3, obstacle="crate", polygon=CRATE)),
    ("sensing", "another polygon", alter(3, polygon=CRATE)),
    (
        "sensing",
        "found twice",
        insert(4, ev.ObstacleFound(t=2.5, robot="d", obstacle="bush", polygon=BUSH)),
    ),
    ("mission_rule", "a forbidden zone", append(moved("d", (9, 5), (9, 8.5), 13, 16))),
    (
        "mission_rule",
        "through its corner",
        append(moved("d", (9, 5), (9.9, 8.5), 13, 16), moved("d", (9.9, 8.5), (9.0, 9.4), 16, 18)),
    ),
]


@pytest.mark.parametrize(("rule", "how", "mutate"), BROKEN, ids=[f"{r}: {h}" for r, h, _ in BROKEN])
def test_each_fault_is_caught_alone(rule: str, how: str, mutate: Callable[[Log], Log]) -> None:
    unserved = {"t4": "added too late"} if how == "known task added" else {}
    verdict = judge(mutate(body()), unserved=unserved)
    assert rules(verdict) == {rule}, verdict.violations
    assert all(violation.message and str(violation) for violation in verdict.violations)


def test_log_that_is_cut_off() -> None:
    verdict = verify(yard(), body())
    assert rules(verdict) == {"cut_off"}
    assert rules(verify(yard(), [])) == {"cut_off", "order"}


def test_events_after_the_end() -> None:
    log = finish(body(), yard().tasks)
    verdict = verify(yard(), [*log, log[-1]])
    assert [(v.rule, v.seq) for v in verdict.violations] == [("order", 13)]


@pytest.mark.parametrize(
    "changes",
    [
        {"completed": 2},
        {"completed": None},
        {"completed": ["t1", "t2"]},
        {"total_steps": 7},
        {"total_distance": 1.0},
        {"makespan": 12.0},
        {"unserved": {"t1": "forgotten"}},
        {"unserved": {"t9": "unheard of"}},
        {"unserved": 3},
        {"per_robot": {"g": {"steps": 3, "distance": 1.0}}},
        {"per_robot": {"x": {"steps": 3, "distance": 1.0}}},
    ],
    ids=str,
)
def test_summary_that_disagrees(changes: dict[str, Any]) -> None:
    assert rules(judge(body(), **changes)) == {"summary"}


def test_summary_may_list_names_and_sums_per_robot() -> None:
    own = {"d": {"steps": 2, "distance": 5 + hypot(3, 2)}}
    assert judge(body(), completed=["t3", "t1", "t2"], per_robot=own).ok


def test_unserved_tasks_need_a_reason() -> None:
    log = drop(6)(body())
    assert judge(log, unserved={"t2": "no robot left"}).ok
    assert rules(judge(log, unserved={"t2": ""})) == {"unserved"}


def test_a_cancelled_task_need_not_be_served_and_may_come_back() -> None:
    log = insert(1, ev.TaskCancelled(t=0.0, task="t2"))(drop(6)(body()))
    assert judge(log).ok
    again = yard().task("t2")
    log = insert(1, ev.TaskCancelled(t=0.0, task="t2"), added(again))(body())
    assert judge(log, completed=3).ok


@pytest.mark.parametrize(
    "mutate",
    [
        append(moved("g", (3, 3), (4.7, 3), 13, 16)),
        append(moved("g", (3, 3), (2.7, 8.2), 13, 20)),
        append(moved("d", (9, 5), (8.2, 1.5), 13, 16)),
        append(moved("g", (3, 3), (5, 5), 13, 16), grown("box", 3.5, 3.5, 1, 16)),
        append(grown("box", 3.5, 2.5, 1, 13.5), moved("g", (3, 3), (3, 7), 13, 17)),
        append(grown("box", 3.1, 2.5, 1, 13), moved("g", (3, 3), (2.5, 3), 13, 14)),
        append(grown("box", 2.5, 2.5, 1, 13), moved("g", (3, 3), (1, 3), 13, 15)),
        append(
            grown("box", 3, 4, 1, 13),
            ev.ObstacleRemoved(t=13.0, obstacle="box"),
            moved("g", (3, 3), (3, 6), 13, 16),
        ),
        append(grown("leaf", 9, 5.5, 1, 13, "bush"), moved("d", (9, 5), (9, 7), 13, 16)),
        append(moved("d", (9, 5), (9, 8), 13, 16)),
        append(ev.RobotPaused(t=13.0, robot="g"), ev.RobotResumed(t=14.0, robot="g")),
        append(ev.RobotFailed(t=13.0, robot="g")),
        insert(1, asked("change_task_priority", task_label="t3", priority="high"), HIGH),
        insert(1, HIGH, answered("+t3", "+t1", "-t1", "-t3")),
        insert(1, HIGH, answered("-t1", "+t3", "-t3")),
    ],
    ids=[
        "touches the wall's clearance",
        "touches a cell's clearance",
        "touches an obstacle's clearance",
        "passed before the obstacle came",
        "passes beside an obstacle that comes meanwhile",
        "drives away from an obstacle that came too near",
        "drives out of an obstacle that came over it",
        "passes after the obstacle went",
        "ignores the kind",
        "touches a forbidden zone's border",
        "pauses between moves",
        "fails after its work",
        "does what it is asked to",
        "begins with what is urgent",
        "delivers before what is urgent",
    ],
)
def test_what_is_allowed(mutate: Callable[[Log], Log]) -> None:
    verdict = judge(mutate(body()))
    assert verdict.ok, verdict.violations


@pytest.mark.parametrize(
    ("walls", "occupied", "seen"),
    [
        ((), None, True),
        ((((6.5, 0.0), (6.5, 10.0)),), None, False),
        ((((6.5, 6.7), (6.5, 10.0)),), None, True),
        ((((7.0, 5.0), (7.0, 8.0)),), None, True),
        ((), (69, 64), True),
        ((), (slice(50, 100), 64), False),
    ],
    ids=["open", "wall", "wall with an end", "wall along it", "one cell", "cells"],
)
def test_line_of_sight(walls: Any, occupied: Any, seen: bool) -> None:
    cells = np.zeros((100, 100), dtype=bool)
    if occupied is not None:
        cells[occupied] = True
    grid = OccupancyGrid(occupied=cells, resolution=0.1, origin=(0, 0))
    mission = yard()
    mission = replace(mission, map=replace(mission.map, walls=walls, grid=grid))
    log = drop(*range(5, 13))(body())
    log = drop(4)(log)
    unserved = dict.fromkeys(["t1", "t2", "t3"], "out of time")
    assert rules(judge(log, mission, unserved=unserved)) == (set() if seen else {"sensing"})


@pytest.mark.parametrize(
    ("to", "rule"), [((6, 3), "wall"), ((7.5, 1.5), "obstacle"), ((2.2, 8.2), "cell"), ((4, 4), "")]
)
def test_a_robot_without_size_still_crosses_nothing(to: Point, rule: str) -> None:
    dot = robot("g", (3, 3) if rule != "obstacle" else (9, 3), radius=0.0)
    mission = replace(yard(), robots=(dot,), tasks=())
    mission = replace(mission, map=replace(mission.map, wall_thickness=0.0))
    log = [started(), moved("g", dot.start, to, 0, 9)]
    assert rules(judge(log, mission)) == ({rule} if rule else set())


def test_long_moves_over_a_big_grid() -> None:
    cells = np.zeros((2000, 3000), dtype=bool)
    cells[1000, 1500] = True  # x 75.00 to 75.05, y 50.00 to 50.05
    grid = OccupancyGrid(occupied=cells, resolution=0.05, origin=(0, 0))
    map = Map(bounds=(0, 0, 150, 100), grid=grid)
    mission = replace(yard(), map=map, robots=(robot("g", (1, 1), speed=9.0),), tasks=())
    for y, expected in ((50.24, {"cell"}), (50.26, set())):
        points = [(1, 1), (1, y), (149, y), (149, 1)]
        log: Log = [started()]
        log += [moved("g", a, b, 50 * i, 50 * i + 50) for i, (a, b) in enumerate(pairwise(points))]
        assert rules(judge(log, mission)) == expected


def test_least_separation_is_exact() -> None:
    # g drives along y = 0 and d against it along y = 3; they pass each other at t = 5.
    robots = (robot("g", (0, 0)), robot("d", (10, 3)), robot("far", (0, 9)))
    mission = replace(yard(), map=Map(bounds=(0, 0, 10, 10)), robots=robots, tasks=(), rules=())
    log = [started(), moved("g", (0, 0), (10, 0), 0, 10), moved("d", (10, 3), (0, 3), 0, 10)]
    found = judge(log, mission).separation
    assert found is not None
    assert (found.distance, found.robots, found.t) == (
        pytest.approx(3),
        ("g", "d"),
        pytest.approx(5),
    )
    assert judge(log[:1], replace(mission, robots=robots[:1])).least_separation is None
    assert judge(log[:1], mission).least_separation == 9.0


@pytest.mark.parametrize("rule", ["G (!lab", "G !labb", "lab U", "G $"])
def test_a_rule_that_cannot_be_read_is_bad_input(rule: str) -> None:
    with pytest.raises(BadInput, match=r"rules\[0\]"):
        judge(body(), replace(yard(), rules=(rule,)))


def test_rules_name_the_first_bad_event() -> None:
    log = append(
        moved("d", (9, 5), (9, 7), 13, 15),
        moved("d", (9, 7), (9, 8.5), 15, 17),
        moved("d", (9, 8.5), (9, 7), 17, 19),
    )(body())
    (violation,) = judge(log).violations
    assert (violation.seq, violation.robot) == (14, "d")


@pytest.mark.parametrize(
    ("rule", "broken_by"),
    [
        ("F dock", {"d"}),
        ("G (t1 -> F t3)", set()),
        ("!t3 U t1", {"d"}),
        ("t2 | !t2 U false | G !t2", {"d"}),
        ("F G !dock", set()),
        ("G F dock", {"g", "d"}),
    ],
)
def test_rules_hold_for_every_robot(rule: str, broken_by: set[str]) -> None:
    verdict = judge(body(), replace(yard(), rules=(rule,)))
    # Only g drives past the dock, only d does t2.
    assert {v.robot for v in verdict.violations} == broken_by


def test_what_a_failed_robot_would_still_have_done_is_not_judged() -> None:
    mission = replace(yard(), rules=("F lab", "G !lab"))
    log = append(ev.RobotFailed(t=13.0, robot="g"), ev.RobotFailed(t=13.0, robot="d"))(body())
    assert judge(log, mission).ok


points = st.tuples(st.floats(0.5, 9.5).map(lambda x: round(x, 3)), st.floats(0.5, 9.5))


@st.composite
def runs(draw: Any) -> tuple[Mission, Log]:
    """Robots in the open that serve their tasks one after another, with waits in between."""
    team = [
        robot(f"r{i}", draw(points), speed=draw(st.floats(0.2, 3)))
        for i in range(draw(st.integers(1, 3)))
    ]
    tasks, log = [], []
    for one in team:
        here, now = one.start, 0.0
        for k in range(draw(st.integers(1, 3))):
            time = draw(st.sampled_from([0.0, 0.5]))
            make = draw(st.sampled_from([0, 1]))
            id = f"{one.id}-{k}"
            ends = draw(points), draw(points)
            task = delivery(id, *ends, time=time) if make else visit(id, ends[0], time=time)
            tasks.append(task)
            for stop in task.stops:
                start = now + draw(st.sampled_from([0.0, 0.3]))
                end = start + hypot(stop.at[0] - here[0], stop.at[1] - here[1]) / one.speed
                log.append(moved(one.id, here, stop.at, start, end))
                here, now = stop.at, end + time
                log.append(served(one.id, id, stop.name, here, now))
    mission = replace(
        yard(), map=Map(bounds=(0, 0, 10, 10)), robots=tuple(team), tasks=tuple(tasks), rules=()
    )
    return mission, [started(), *sorted(log, key=lambda event: event.t)]


@settings(max_examples=40, deadline=None)
@given(runs())
def test_random_runs_in_the_open_pass(run: tuple[Mission, Log]) -> None:
    mission, log = run
    verdict = judge(log, mission)
    assert verdict.ok, verdict.violations
    assert verdict.checked["stops"] == sum(len(task.stops) for task in mission.tasks)


@settings(max_examples=60, deadline=None)
@given(runs(), st.data())
def test_shifting_anything_breaks_a_run(run: tuple[Mission, Log], data: st.DataObject) -> None:
    mission, log = run
    at = data.draw(st.integers(1, len(log) - 1))
    event = log[at]
    if isinstance(event, ev.Moved):
        end = data.draw(st.sampled_from(["from_", "to"]))
        x, y = getattr(event, end)
        changed: ev.AnyEvent = replace(event, **{end: (x + 0.01, y)})
    else:
        assert isinstance(event, ev.StopServed)
        changed = replace(event, at=(event.at[0], event.at[1] - 0.01))
    assert not judge([*log[:at], changed, *log[at + 1 :]], mission).ok


@pytest.mark.parametrize(("motion", "ok"), [("ground", True), ("drone", False)])
def test_what_touches_a_robot_is_found_whether_it_sees_so_far_or_not(motion: str, ok: bool) -> None:
    blind = robot("g", (6.685, 6.5), motion=motion, radius=0.3, sensing=0.1)
    mission = replace(yard(), robots=(blind,), tasks=(), rules=())
    found = ev.ObstacleFound(t=0.0, robot="g", obstacle="bush", polygon=BUSH)
    assert rules(judge([started(), found], mission)) == (set() if ok else {"sensing"})
