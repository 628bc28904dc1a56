"""Missions from beginning to end, each run judged by the independent judge."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import dist, inf
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oath
from missions import (
    CELL_DOOR,
    box,
    bush,
    cell,
    delivery,
    gate,
    missions,
    random_mission,
    robot,
    visit,
    yard,
)
from oath.allocate import Budget
from oath.allocate import allocator as named
from oath.commands import parse
from oath.errors import BadInput
from oath.events import (
    Allocated,
    AnyEvent,
    Event,
    MissionFinished,
    Moved,
    ObstacleFound,
    Planned,
    RobotFailed,
    StopServed,
    TaskAdded,
)
from oath.fleet import Order, Pose
from oath.fleet.sim import SimFleet
from oath.formats.event_log import to_line
from oath.model import Mission, Motion, Point
from oath.runtime import Result, Runtime
from oath.scene import prepare
from oath.verify import verify
from oath.world.roadmap import Params

SHIPPED = sorted(Path("missions").glob("*.yaml"))
SHIPPED = [path for path in SHIPPED if "schema: oath/mission/1" in path.read_text()]


def run(mission: Mission, *, points: int = 200, **options: Any) -> Result:
    """Run a mission and have the run judged."""
    result = oath.run(mission, points=points, **options)
    verdict = verify(mission, result.events)
    assert verdict.ok, "\n".join(map(str, verdict.violations))
    finished = [event for event in result.events if isinstance(event, MissionFinished)]
    assert finished == [result.events[-1]]
    assert all(result.summary["unserved"].values()), "a task is left without a reason"
    done = result.summary["completed"]
    assert done + len(result.summary["unserved"]) == result.summary["tasks"] == len(mission.tasks)
    return result


def all_done(mission: Mission, **options: Any) -> Result:
    result = run(mission, **options)
    assert result.summary["unserved"] == {}
    return result


def of(kind: type[Event], result: Result, robot: str | None = None) -> list[Any]:
    events = [event for event in result.events if isinstance(event, kind)]
    return [event for event in events if robot is None or getattr(event, "robot", None) == robot]


def order(result: Result) -> list[str]:
    """Return the tasks in the order of their last stops."""
    return [event.task for event in of(StopServed, result) if event.stop != "pickup"]


# --- Shipped missions -----------------------------------------------------------------------


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_missions_are_done(path: Path) -> None:
    for seed in (0, 1):
        all_done(oath.load(path), points=1000, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_missions_are_done_with_any_seed(path: Path) -> None:
    mission = oath.load(path)
    for seed in range(2, 12):
        all_done(mission, points=1000, seed=seed)


# --- Random missions ------------------------------------------------------------------------


def check_random(mission: Mission, seed: int) -> None:
    try:
        result = oath.run(mission, points=100, seed=seed)
    except BadInput as error:
        assert "out of reach" in str(error)
        return
    summary = result.summary
    assert summary["completed"] + len(summary["unserved"]) == len(mission.tasks)
    assert all(summary["unserved"].values())
    assert "not finished" not in summary["unserved"].values()
    busy = {event.robot for event in of(StopServed, result)}
    for violation in verify(mission, result.events).violations:
        # Nobody is sent anywhere only because a rule obliges him.
        assert violation.rule == "mission_rule", violation
        assert violation.robot not in busy or summary["unserved"], violation
        assert "still not fulfilled" in violation.message, violation


@settings(max_examples=100, deadline=None)
@given(missions(), st.integers(0, 3))
def test_random_missions(mission: Mission, seed: int) -> None:
    check_random(mission, seed)


@pytest.mark.slow
def test_many_random_missions() -> None:
    for seed in range(500):
        check_random(random_mission(seed), seed)


@pytest.mark.parametrize(
    "seed",
    [
        4,  # two robots without a plan in one round: each revived the other's refused task
        44,  # a robot took up a task though what it could not deliver filled its hands
        93,  # the bumper finds what is beyond the sensing range
        124,  # four finds at once: a plan was driven that the next find had undone
        2039,  # a find cuts a busy robot's route off from its end
    ],
)
def test_missions_that_went_wrong_once(seed: int) -> None:
    check_random(random_mission(seed), seed)


# --- The same seed, the same run ------------------------------------------------------------

LOG = """
import sys
sys.path.insert(0, "tests")
import oath
from dataclasses import replace
from oath.formats.event_log import to_line
from missions import random_mission
for mission in (oath.load("missions/maze-12.yaml"), random_mission(44)):
    for i, event in enumerate(oath.run(mission, seed=5, points=300).events):
        print(to_line(i, event))
"""


def without_wall_clock(line: str) -> str:
    event = json.loads(line)
    event.pop("seconds", None)
    for key in ("allocation_seconds", "planning_seconds", "total_running_time"):
        event.get("summary", {}).pop(key, None)
    return json.dumps(event)


def test_the_same_seed_gives_the_same_log_in_every_process() -> None:
    logs = []
    for hash_seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
        done = subprocess.run(
            [sys.executable, "-c", LOG], env=environment, capture_output=True, text=True, check=True
        )
        logs.append([without_wall_clock(line) for line in done.stdout.splitlines()])
    assert len(logs[0]) > 50
    assert logs[0] == logs[1]


def test_a_mission_is_not_changed_by_its_run() -> None:
    for seed in (44, 124):
        mission = random_mission(seed)
        first = oath.run(mission, seed=1, points=100)
        again = oath.run(mission, seed=1, points=100)
        one, other = (
            [without_wall_clock(to_line(i, event)) for i, event in enumerate(result.events)]
            for result in (first, again)
        )
        assert one == other
        assert mission == random_mission(seed)


# --- Few words, known answers ---------------------------------------------------------------


def test_a_mission_without_tasks_ends_at_once() -> None:
    result = all_done(yard([robot("r", (5, 5))], []))
    assert [event.type for event in result.events] == [
        "mission_started",
        "allocated",
        "mission_finished",
    ]
    assert result.summary["makespan"] == 0.0
    assert result.summary["per_robot"] == {"r": {"steps": 0, "distance": 0.0, "tasks": 0}}


def test_one_robot_drives_straight() -> None:
    result = all_done(yard([robot("r", (1, 1), speed=2.0)], [delivery("a", (4, 5), (9, 5))]))
    assert result.summary["total_distance"] == pytest.approx(10.0, rel=1e-6)
    assert result.summary["makespan"] == pytest.approx(5.0, rel=1e-6)
    stops = [(stop.task, stop.stop, stop.at) for stop in of(StopServed, result)]
    assert stops == [("a", "pickup", (4, 5)), ("a", "delivery", (9, 5))]


def test_each_stop_takes_its_service_time() -> None:
    tasks = [delivery("a", (4, 1), (8, 1), service_time=3.0), visit("b", (8, 5), service_time=7.0)]
    result = all_done(yard([robot("r", (1, 1))], tasks))
    assert [stop.t for stop in of(StopServed, result)] == pytest.approx([6.0, 13.0, 24.0])


def test_a_robot_with_more_room_than_there_are_tasks() -> None:
    tasks = [delivery(f"t{i}", (1 + i % 4, 5), (9, 5)) for i in range(8)]
    result = all_done(yard([robot("r", (1, 5), capacity=1000)], tasks))
    # The paper's allocator makes four clusters of what is left, and takes one of them at a time.
    assert result.summary["total_distance"] < 8 * (8 + 8)


def test_a_robot_with_room_for_one_carries_one_by_one() -> None:
    tasks = [delivery(f"t{i}", (2 + i, 5), (9, 5)) for i in range(3)]
    result = all_done(yard([robot("r", (1, 5), capacity=1)], tasks))
    assert [stop.stop for stop in of(StopServed, result)] == ["pickup", "delivery"] * 3


def test_the_faster_robot_is_not_held_up() -> None:
    robots = [robot("hare", (1, 1), speed=4.0), robot("snail", (1, 9), speed=0.5)]
    result = all_done(yard(robots, [visit("a", (9, 1)), visit("b", (9, 9))]), allocator="oath")
    ends = {stop.robot: stop.t for stop in of(StopServed, result)}
    assert ends == pytest.approx({"hare": 2.0, "snail": 16.0})


def test_high_priority_is_served_first_and_low_last() -> None:
    tasks = [
        visit("low", (1.5, 5), priority="low"),
        visit("near", (2, 5)),
        visit("far", (8, 5)),
        visit("high", (9, 5), priority="high"),
    ]
    result = all_done(yard([robot("r", (1, 5))], tasks))
    assert order(result)[0] == "high"
    assert order(result)[-1] == "low"


def test_high_priority_goes_to_who_can_do_it_soonest() -> None:
    robots = [robot("near", (4, 5), speed=0.2), robot("far", (1, 5), speed=2.0)]
    result = all_done(yard(robots, [visit("a", (5, 5), priority="high")]))
    assert [stop.robot for stop in of(StopServed, result)] == ["far"]


def test_only_who_can_does_it() -> None:
    robots = [robot("near", (5, 5), can={"carry": 1.0}), robot("far", (1, 1), can={"inspect": 0.1})]
    result = all_done(yard(robots, [visit("a", (6, 5), type="inspect")]))
    assert [stop.robot for stop in of(StopServed, result)] == ["far"]


# --- Obstacles ------------------------------------------------------------------------------

THICK_DOOR = box(6.9, 3.9, 7.1, 6.1)


def test_a_gate_that_closes_the_only_door_leaves_tasks_with_a_reason() -> None:
    mission = cell(
        [robot("r", (2, 5))],
        [visit("in", (9, 5)), visit("out", (1, 1)), delivery("into", (3, 3), (9, 9))],
        obstacles=(gate("gate-1", THICK_DOOR),),
    )
    result = run(mission)
    assert order(result) == ["out"]
    assert result.summary["unserved"].keys() == {"in", "into"}
    assert len(of(ObstacleFound, result)) == 1


def test_a_known_gate_is_no_news() -> None:
    mission = cell(
        [robot("r", (2, 5))],
        [visit("in", (9, 5))],
        obstacles=(gate("gate-1", THICK_DOOR, known=True),),
    )
    with pytest.raises(BadInput, match="out of reach"):
        oath.run(mission, points=200)


def test_what_is_carried_to_an_unreachable_stop_is_stranded_and_takes_room() -> None:
    mission = cell(
        [robot("r", (5, 5), sensing=0.4)],
        [delivery("into", (5.5, 5), (9, 5)), delivery("later", (1, 1), (3, 1)), visit("v", (1, 5))],
        obstacles=(gate("gate-1", THICK_DOOR),),
    )
    result = run(mission)
    assert result.summary["unserved"] == {
        "into": "carried by r, which has no way to its delivery",
        "later": "no room: the robots that could take it are full",
    }
    assert order(result) == ["v"]


def test_a_robot_that_has_room_left_goes_on_with_what_it_can() -> None:
    mission = cell(
        [robot("r", (5, 5), sensing=0.4, capacity=2)],
        [delivery("into", (5.5, 5), (9, 5)), delivery("later", (1, 1), (3, 1))],
        obstacles=(gate("gate-1", THICK_DOOR),),
    )
    assert order(run(mission)) == ["later"]


def test_another_robot_takes_over_what_one_cannot_reach() -> None:
    mission = cell(
        [robot("cart", (5, 5)), robot("drone", (1, 9), motion="drone", speed=0.3)],
        [visit("in", (9, 5))],
        obstacles=(bush("bush-1", THICK_DOOR),),
    )
    assert [stop.robot for stop in of(StopServed, all_done(mission))] == ["drone"]


def test_a_robot_stops_where_it_learns_that_its_way_is_blocked_and_turns() -> None:
    walls = (((5.0, 3.0), (5.0, 7.0)),)
    mission = yard(
        [robot("r", (1, 2))],
        [visit("a", (9, 2))],
        walls=walls,
        obstacles=(gate("gate-1", box(4.9, 0.0, 5.1, 3.0)),),
    )
    result = all_done(mission)
    (found,) = of(ObstacleFound, result)
    moves = of(Moved, result)
    here = next(move for move in moves if move.t == found.t)
    assert dist(here.to, (4.9, here.to[1])) == pytest.approx(1.5, abs=0.06)
    replanned = [plan for plan in of(Planned, result) if plan.reason == "obstacle"]
    assert len(replanned) == result.summary["replans"] == 1
    assert max(move.to[1] for move in moves) > 7.0


def test_an_obstacle_out_of_the_way_changes_no_plan() -> None:
    mission = yard(
        [robot("r", (1, 2))], [visit("a", (9, 2))], obstacles=(gate("g", box(4, 3, 5, 4)),)
    )
    result = all_done(mission)
    assert len(of(ObstacleFound, result)) == 1
    assert result.summary["replans"] == 0


def test_a_find_of_one_robot_turns_another() -> None:
    mission = cell(
        [robot("scout", (6, 5), speed=0.1), robot("cart", (1, 5), speed=1.0, can={"inspect": 1.0})],
        [visit("near", (6, 6)), visit("in", (9, 5), type="inspect")],
        obstacles=(gate("gate-1", THICK_DOOR),),
    )
    result = run(mission)
    assert of(ObstacleFound, result)[0].robot == "scout"
    assert result.summary["unserved"].keys() == {"in"}
    assert not of(Moved, result, "cart")


def test_a_robot_that_was_given_more_on_its_way_still_minds_the_way() -> None:
    """Its new plan begins where its move ends, but what blocks that move stops it all the same."""
    mission = yard(
        [robot("cart", (1, 2)), robot("drone", (1, 9), motion="drone", can={"inspect": 1.0})],
        [
            visit("second", (3.5, 2), type="inspect"),
            visit("far", (9, 9), type="inspect"),
        ],
        obstacles=(
            bush("bush-1", box(3, 1.5, 4, 2.5)),  # turns the second task over to the drone
            gate("gate-1", box(5, 8, 5.5, 9.8)),  # in the middle of the drone's first move
        ),
    )
    result = all_done(mission, points=5)
    assert [(stop.robot, stop.task) for stop in of(StopServed, result)] == [
        ("drone", "far"),
        ("drone", "second"),
    ]
    assert result.summary["replans"] >= 2


@pytest.mark.parametrize(("factor", "through"), [(1.5, True), (5.0, False)])
def test_a_costly_obstacle_is_crossed_only_if_the_way_round_costs_more(
    factor: float, through: bool
) -> None:
    hedge = box(4, 2.5, 6, 7.5)
    mission = yard(
        [robot("r", (1, 5), motion="wader")],
        [visit("a", (9, 5))],
        obstacles=(bush("hedge", hedge, known=True),),
        motions={"wader": Motion(name="wader", cost={"bush": factor})},
    )
    result = all_done(mission, points=500)
    length = result.summary["total_distance"]
    straight, round_ = 8.0, 2 * dist((1, 5), (4, 7.5)) + 2
    assert length == pytest.approx(straight if through else round_, rel=0.03)


def test_robots_of_two_sizes_each_take_a_way_that_they_fit() -> None:
    # A gap of 0.8 m, and a way round at the top.
    walls = (((5.0, 0.0), (5.0, 4.5)), ((5.0, 5.5), (5.0, 8.0)))
    robots = [
        robot("small", (1, 5), radius=0.2, can={"carry": 1.0}),
        robot("large", (1, 4), radius=0.5, can={"inspect": 1.0}),
    ]
    tasks = [visit("a", (9, 5)), visit("b", (9, 4), type="inspect")]
    result = all_done(yard(robots, tasks, walls=walls))
    lengths = {id: own["distance"] for id, own in result.summary["per_robot"].items()}
    assert lengths["small"] == pytest.approx(8.0, abs=0.05)
    assert lengths["large"] > 10.0


# --- Rules ----------------------------------------------------------------------------------

LAB = box(4, 3, 6, 7)


def inside(point: Point) -> bool:
    return 4 <= point[0] <= 6 and 3 <= point[1] <= 7


def test_a_forbidden_zone_is_driven_round() -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (9, 5))], zones={"lab": LAB})
    free = all_done(mission)
    assert free.summary["total_distance"] == pytest.approx(8.0)
    round_ = all_done(replace(mission, rules=("G !lab",)))
    assert 8.9 < round_.summary["total_distance"] < 9.5
    assert not any(inside(move.to) for move in of(Moved, round_))


def test_a_stop_in_a_forbidden_zone_is_refused_before_anybody_drives() -> None:
    mission = yard(
        [robot("r", (1, 5))], [visit("a", (5, 5))], zones={"lab": LAB}, rules=("G !lab",)
    )
    with pytest.raises(BadInput, match="out of reach"):
        oath.run(mission, points=200)


@pytest.mark.parametrize("first", ["key", "look"])
def test_a_zone_is_entered_only_after_a_task(first: str) -> None:
    """Whichever task is nearer: what is refused now may be done when the key is fetched."""
    key = visit("key", (1, 9) if first == "look" else (1.5, 5))
    mission = yard(
        [robot("r", (1, 5))],
        [visit("look", (5, 5)), key],
        zones={"lab": LAB},
        rules=("!lab W key",),
    )
    assert order(all_done(mission)) == ["key", "look"]


def test_only_the_robot_that_did_the_first_task_enters() -> None:
    robots = [
        robot("doer", (1, 9), can={"carry": 1.0}),
        robot("looker", (3, 5), can={"inspect": 1.0}),
    ]
    mission = yard(
        robots,
        [visit("key", (1, 8)), visit("look", (5, 5), type="inspect")],
        zones={"lab": LAB},
        rules=("!lab W key",),
    )
    result = run(mission)
    assert result.summary["unserved"] == {
        "look": "every robot that could take it would break a rule"
    }


def test_a_place_is_visited_on_the_way() -> None:
    mission = yard([robot("r", (1, 1))], [visit("a", (9, 1))], places={"p": (5, 5)}, rules=("F p",))
    result = all_done(mission)
    assert min(dist(move.to, (5, 5)) for move in of(Moved, result)) < 1e-5
    assert result.summary["total_distance"] == pytest.approx(2 * dist((1, 1), (5, 5)), rel=0.03)


def test_contradicting_rules_are_bad_input() -> None:
    mission = yard(
        [robot("r", (1, 1))], [visit("a", (9, 1))], places={"p": (5, 5)}, rules=("F p", "G !p")
    )
    with pytest.raises(BadInput, match="contradict"):
        oath.run(mission, points=100)


# --- Odd missions ---------------------------------------------------------------------------

HERE = (5.0, 5.0)


def test_robots_may_share_a_start_and_tasks_a_point() -> None:
    robots = [robot(f"r{i}", HERE) for i in range(4)]
    result = all_done(yard(robots, [delivery(f"t{i}", HERE, HERE) for i in range(4)]))
    assert result.summary["total_steps"] == 0


def test_a_pickup_may_be_the_delivery_and_the_start() -> None:
    result = all_done(yard([robot("r", HERE)], [delivery("a", HERE, HERE, service_time=3.0)]))
    assert result.summary["makespan"] == 6.0


def test_many_tasks_at_one_point() -> None:
    tasks = [delivery(f"t{i}", (2, 2), (8, 8)) for i in range(20)]
    result = all_done(yard([robot("r", HERE, capacity=5)], tasks))
    one_by_one = dist(HERE, (2, 2)) + 39 * dist((2, 2), (8, 8))
    assert result.summary["total_distance"] < one_by_one / 2


@pytest.mark.parametrize("speed", [1e-3, 100.0])
def test_speeds(speed: float) -> None:
    mission = yard(
        [robot("r", (1, 1), speed=speed)],
        [delivery("a", (2, 2), (8, 8))],
        obstacles=(gate("crate", box(4, 4, 6, 6)),),
    )
    result = all_done(mission)
    length = result.summary["total_distance"]
    assert result.summary["makespan"] == pytest.approx(length / speed)


def moved_and_scaled(scale: float, offset: float) -> Mission:
    def at(point: Point) -> Point:
        return (point[0] * scale + offset, point[1] * scale + offset)

    def size(length: float) -> float:
        return length * scale

    robots = [
        robot("r", at((2, 2)), radius=size(0.2), sensing=size(1.5), speed=size(1)),
        robot("d", at((2, 8)), radius=size(0.1), sensing=size(3), speed=size(2), motion="drone"),
    ]
    tasks = [delivery("a", at((1, 5)), at((9, 5))), visit("b", at((9, 9))), visit("c", at((1, 1)))]
    return yard(
        robots,
        tasks,
        bounds=(offset, offset, offset + size(10), offset + size(10)),
        wall_thickness=size(0.2),
        walls=tuple((at((7, low)), at((7, high))) for low, high in ((0.0, 4.0), (6.0, 10.0))),
        obstacles=tuple(
            make(id, tuple(map(at, box(*corners))))  # type: ignore[arg-type]
            for make, id, corners in (
                (gate, "gate-1", (4.0, 3.0, 5.0, 6.0)),
                (bush, "bush-1", (2.0, 3.0, 3.0, 4.0)),
            )
        ),
    )


@pytest.mark.parametrize(
    ("scale", "offset"), [(0.1, 0), (100.0, 0), (1000.0, 0), (1.0, 1e6), (1.0, -1e5)]
)
def test_maps_of_any_size_anywhere(scale: float, offset: float) -> None:
    all_done(moved_and_scaled(scale, offset))


@pytest.mark.parametrize("gap", [1e-9, 1e-3, 0.02])
def test_an_unknown_obstacle_may_touch_a_start(gap: float) -> None:
    x = 5 + 0.2 + gap
    mission = yard(
        [robot("r", HERE)], [visit("a", (9, 9))], obstacles=(gate("g", box(x, 4, 6, 6)),)
    )
    all_done(mission)


def test_a_robot_that_finds_itself_boxed_in_says_so() -> None:
    sides = [(5.3, 4, 6, 6), (4, 5.3, 6, 6), (4, 4, 4.7, 6), (4, 4, 6, 4.7)]
    obstacles = tuple(gate(f"side-{i}", box(*side)) for i, side in enumerate(sides))
    result = run(yard([robot("r", HERE)], [visit("a", (9, 9))], obstacles=obstacles))
    assert result.summary["unserved"].keys() == {"a"}
    assert result.summary["total_distance"] < 0.2


def test_unknown_obstacles_on_stops() -> None:
    mission = yard(
        [robot("r", (1, 1)), robot("d", (1, 9), motion="drone")],
        [visit("under", HERE), delivery("b", (2, 2), HERE), visit("c", (9, 9))],
        obstacles=(gate("crate", box(4.5, 4.5, 5.5, 5.5)), gate("same", box(4.5, 4.5, 5.5, 5.5))),
    )
    result = run(mission)
    assert "under" in result.summary["unserved"]
    assert "c" in order(result)


@pytest.mark.parametrize("bounds", [(0.0, 0.0, 0.3, 0.3), (0.0, 0.0, 10.0, 1e-6)])
def test_tiny_bounds(bounds: tuple[float, float, float, float]) -> None:
    mission = yard([robot("r", (0.0, 0.0))], [visit("a", (0.2, 0.0))], bounds=bounds)
    assert all_done(mission).summary["total_distance"] == pytest.approx(0.2)


def test_stops_and_starts_on_the_corners_of_the_bounds() -> None:
    tasks = [visit("a", (10, 10)), visit("b", (0, 10)), visit("c", (10, 0))]
    all_done(yard([robot("r", (0, 0))], tasks))


def test_a_roadmap_of_one_point_still_finds_the_door() -> None:
    all_done(cell([robot("r", (2, 5))], [visit("a", (9, 9))]), points=1)


def test_a_door_closed_by_a_known_obstacle_that_only_some_pass() -> None:
    mission = cell(
        [robot("cart", (2, 5)), robot("drone", (2, 2), motion="drone")],
        [visit("a", (9, 9)), delivery("b", (9, 1), (1, 1)), visit("c", (3, 3))],
        obstacles=(bush("hedge", CELL_DOOR, known=True), bush("more", box(6.5, 3, 7.5, 7))),
    )
    result = all_done(mission)
    assert {stop.robot for stop in of(StopServed, result) if stop.task in "ab"} == {"drone"}


# --- What a run tells -----------------------------------------------------------------------


def test_the_summary_adds_up() -> None:
    result = all_done(oath.load("missions/maze-12.yaml"), points=500, seed=3)
    summary, moves = result.summary, of(Moved, result)
    assert summary["seed"] == 3
    assert summary["allocator"] == oath.DEFAULT_ALLOCATOR
    assert summary["total_steps"] == len(moves)
    assert summary["total_distance"] == pytest.approx(sum(dist(m.from_, m.to) for m in moves))
    assert summary["makespan"] == max(stop.t for stop in of(StopServed, result))
    assert summary["rounds"] == len(of(Allocated, result))
    assert summary["allocation_seconds"] == sum(e.seconds for e in of(Allocated, result))
    assert summary["planning_seconds"] == sum(e.seconds for e in of(Planned, result))
    parts = ("allocation_seconds", "planning_seconds", "makespan")
    assert summary["total_running_time"] == pytest.approx(sum(summary[key] for key in parts))
    for key in ("steps", "distance", "tasks"):
        whole = {"steps": "total_steps", "distance": "total_distance", "tasks": "completed"}[key]
        own = sum(each[key] for each in summary["per_robot"].values())
        assert own == pytest.approx(summary[whole])


def test_events_are_told_as_they_happen_in_order_of_time() -> None:
    seen: list[Event] = []
    result = run(random_mission(44), on_event=seen.append)
    assert tuple(seen) == result.events
    last = -inf
    for event in seen:
        assert event.t >= last
        last = event.t


def test_an_allocation_covers_every_task_once() -> None:
    mission = oath.load("missions/maze-12.yaml")
    oath.run(mission, points=100)  # imports the room of the same name
    assignment = oath.allocate(mission, points=500)
    stops = [stop for route in assignment.routes.values() for stop in route]
    assert sorted({stop.task for stop in stops}) == sorted(task.id for task in mission.tasks)
    assert len(stops) == sum(len(task.stops) for task in mission.tasks)
    assert assignment.routes.keys() == {one.id for one in mission.robots}


# --- What changes while the mission runs


class Eventful:
    """A simulated fleet that also reports other things at given times."""

    def __init__(self, mission: Mission, extra: list[AnyEvent]) -> None:
        self.sim, self.extra = SimFleet(mission), extra

    def send(self, robot: str, order: Order) -> None:
        self.sim.send(robot, order)

    def cancel(self, robot: str, *, at_once: bool) -> tuple[float, float]:
        return self.sim.cancel(robot, at_once=at_once)

    def poses(self) -> Mapping[str, Pose]:
        return self.sim.poses()

    def events(self, until: float = inf) -> Sequence[AnyEvent]:
        due = list(self.sim.events(until))
        while self.extra and (not due or due[-1].t >= self.extra[0].t):
            # The simulator's clock has moved on already: it happens now.
            now = due[-1].t if due else self.extra[0].t
            due.append(replace(self.extra.pop(0), t=now))
        return due


def run_with(mission: Mission, allocator: str, *extra: AnyEvent) -> Result:
    result = Runtime(
        prepare(mission, Params(points=200)),
        Eventful(mission, list(extra)),
        name=allocator,
        allocator=named(allocator),
        budget=Budget(iterations=300),
        seed=0,
    ).run()
    verdict = verify(mission, result.events)
    assert verdict.ok, verdict.violations
    return result


@pytest.mark.parametrize("allocator", ["lns", "oath"])
def test_a_task_that_arrives_is_done(allocator: str) -> None:
    robots = [robot("west", (1, 1)), robot("east", (9, 1))]
    mission = yard(robots, [visit("a", (1, 9)), visit("b", (9, 3)), visit("d", (9, 9))])
    result = run_with(mission, allocator, TaskAdded(t=1.0, task=visit("c", (9, 6))))
    assert result.summary["completed"] == result.summary["tasks"] == 4
    if allocator == "lns":  # its routes are reconsidered: c lies on the way from b to d
        assert [stop.task for stop in of(StopServed, result, "east")] == ["b", "c", "d"]


@pytest.mark.parametrize("allocator", ["lns", "oath"])
def test_others_take_over_from_a_robot_that_fails(allocator: str) -> None:
    robots = [robot("r1", (1, 1)), robot("r2", (9, 1))]
    tasks = [delivery("a", (1, 3), (1, 9)), visit("b", (2, 9)), visit("c", (9, 9))]
    result = run_with(yard(robots, tasks), allocator, RobotFailed(t=2.5, robot="r1"))
    assert result.summary["unserved"] == {}
    served = {stop.task: stop.robot for stop in of(StopServed, result)}
    assert served == {"a": "r2", "b": "r2", "c": "r2"}
    # What it carried is fetched where it stopped.
    (first, again) = (stop for stop in of(StopServed, result) if stop.stop == "pickup")
    assert (first.robot, first.at) == ("r1", (1, 3))
    assert (again.robot, again.at) == ("r2", of(Moved, result, "r1")[-1].to)


def test_when_every_robot_fails_the_mission_ends() -> None:
    mission = yard([robot("r1", (1, 1))], [visit("a", (9, 9)), visit("b", (9, 1))])
    result = run_with(mission, "lns", RobotFailed(t=0.5, robot="r1"))
    assert set(result.summary["unserved"]) == {"a", "b"}


@pytest.mark.parametrize("allocator", ["lns", "oath"])
def test_a_robot_at_work_unloads_just_that_for_what_is_urgent(allocator: str) -> None:
    tasks = [delivery("a", HERE, (9, 5), service_time=2.0), delivery("b", (1, 5), (1, 9))]
    mission = yard([robot("r", HERE)], tasks)
    runtime = oath.prepare(mission, points=200, allocator=allocator)
    wanted = {"task_label": "b", "priority": "high"}
    urgent = parse({"intent": "change_task_priority", "parameters": wanted})
    result = runtime.run([(1.0, lambda: runtime.command([urgent], "test"))])
    assert verify(mission, result.events).ok
    stops = of(StopServed, result)
    assert [stop.task for stop in stops] == ["a", "a", "b", "b"]
    assert stops[0].t == 2.0
