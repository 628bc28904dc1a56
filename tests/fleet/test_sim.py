"""Every fleet keeps the contract, broken ones fail it; the simulator's senses are as told."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from math import dist
from typing import Any

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from missions import box, bush, delivery, gate, random_mission, robot, visit, yard
from oath.events import AnyEvent, Moved, ObstacleFound, StopServed
from oath.fleet import Fleet, Order
from oath.fleet.sim import SimFleet
from oath.model import Mission, Obstacle, Point, Robot, StopName

Make = Callable[[Mission], Fleet]


def order(*path: Point, task: str = "a", stop: StopName = "visit", service: float = 0.0) -> Order:
    return Order(path=path, task=task, stop=stop, service_time=service)


def two(**changes: Any) -> Mission:
    """Return a mission with a slow robot at (1, 1) and one twice as fast at (1, 9)."""
    robots = [robot("slow", (1, 1), speed=0.5), robot("fast", (1, 9), speed=1.0)]
    return yard(robots, [visit("a", (5, 1)), visit("b", (5, 9)), delivery("c", (1, 5), (5, 5))])


def drain(fleet: Fleet) -> list[AnyEvent]:
    """Return all that happens until nothing does."""
    events: list[AnyEvent] = []
    while due := fleet.events():
        events += due
        assert len(events) < 10_000, "it never ends"
    return events


def of(kind: type, events: Sequence[AnyEvent], robot: str | None = None) -> list[Any]:
    return [e for e in events if isinstance(e, kind) and robot in (None, e.robot)]


def wait_for(kind: type, fleet: Fleet, robot: str | None = None) -> None:
    """Let time pass until such an event is reported."""
    while due := fleet.events():
        if of(kind, due, robot):
            return
    raise AssertionError(f"{kind.__name__} never happens")


# --- The contract ---------------------------------------------------------------------------


def drives_its_path_and_serves(make: Make) -> None:
    fleet = make(two())
    fleet.send("slow", order((2, 1), (2, 3), (4, 3), service=2.5))
    events = drain(fleet)
    moves = of(Moved, events)
    assert [move.to for move in moves] == [(2, 1), (2, 3), (4, 3)]
    assert [(move.start, move.end) for move in moves] == [(0, 2), (2, 6), (6, 10)]
    assert moves[0].from_ == (1, 1)
    assert all(a.to == b.from_ for a, b in pairwise(moves))
    assert events[-1] == StopServed(t=12.5, robot="slow", task="a", stop="visit", at=(4, 3))
    assert len(events) == 4


def keeps_the_speed(make: Make) -> None:
    fleet = make(two())
    fleet.send("fast", order((4, 5), (9, 9), task="b"))
    for move in of(Moved, drain(fleet)):
        assert move.end - move.start == pytest.approx(dist(move.from_, move.to))
        assert move.t == move.end


def serves_where_it_stands(make: Make) -> None:
    fleet = make(two())
    fleet.send("slow", order(service=1.0))
    assert drain(fleet) == [StopServed(t=1.0, robot="slow", task="a", stop="visit", at=(1, 1))]
    fleet.send("slow", order((1, 1)))
    assert drain(fleet) == [StopServed(t=1.0, robot="slow", task="a", stop="visit", at=(1, 1))]


def does_nothing_without_orders(make: Make) -> None:
    fleet = make(two())
    assert drain(fleet) == []
    fleet.send("slow", order((2, 1)))
    drain(fleet)
    assert drain(fleet) == []


def begins_the_next_order_where_and_when_the_last_ended(make: Make) -> None:
    fleet = make(two())
    fleet.send("slow", order((2, 1)))
    drain(fleet)
    fleet.send("slow", order((2, 2), task="c", stop="pickup"))
    move, served = drain(fleet)
    assert move == Moved(t=4.0, robot="slow", from_=(2, 1), to=(2, 2), start=2.0, end=4.0)
    assert served == StopServed(t=4.0, robot="slow", task="c", stop="pickup", at=(2, 2))


def robots_move_at_the_same_time_in_order(make: Make) -> None:
    fleet = make(two())
    fleet.send("slow", order((1, 2), (1, 3)))
    fleet.send("fast", order((2, 9), (3, 9), (4, 9), task="b", service=0.5))
    events = drain(fleet)
    assert [event.t for event in events] == sorted(event.t for event in events)
    assert [move.end for move in of(Moved, events, "slow")] == [2.0, 4.0]
    assert [move.end for move in of(Moved, events, "fast")] == [1.0, 2.0, 3.0]
    assert [stop.t for stop in of(StopServed, events)] == [3.5, 4.0]


def until_fast_moved(make: Make, *, path: tuple[Point, ...] = ((5, 1), (9, 1))) -> Fleet:
    """Return a fleet at t = 1, its slow robot 0.5 m along its path."""
    fleet = make(two())
    fleet.send("slow", order(*path))
    fleet.send("fast", order((2, 9), task="b"))
    wait_for(Moved, fleet, "fast")
    return fleet


def stops_at_once_in_the_middle(make: Make) -> None:
    fleet = until_fast_moved(make)
    assert fleet.cancel("slow", at_once=True) == pytest.approx((1.5, 1))
    (move,) = of(Moved, drain(fleet), "slow")
    assert (move.from_, move.to) == ((1, 1), pytest.approx((1.5, 1)))
    assert (move.start, move.end, move.t) == (0.0, 1.0, 1.0)


def finishes_its_move_when_told_softly(make: Make) -> None:
    fleet = until_fast_moved(make)
    assert fleet.cancel("slow", at_once=False) == (5, 1)
    events = drain(fleet)
    (move,) = of(Moved, events, "slow")
    assert (move.to, move.end) == ((5, 1), 8.0)
    assert not of(StopServed, events, "slow")


def leaves_what_it_served(make: Make) -> None:
    for at_once in (True, False):
        fleet = make(two())
        fleet.send("slow", order(service=5.0))
        fleet.send("fast", order((2, 9), task="b"))
        wait_for(Moved, fleet, "fast")
        assert fleet.cancel("slow", at_once=at_once) == (1, 1)
        assert not of(StopServed, drain(fleet), "slow")
        # Service begins anew.
        fleet.send("slow", order(service=5.0))
        assert [stop.t for stop in of(StopServed, drain(fleet), "slow")] == [6.0]


def works_on_when_told_to_again(make: Make) -> None:
    fleet = make(two())
    fleet.send("slow", order((1, 2), service=5.0))  # there at 2 s
    fleet.send("fast", order((6, 9), task="b"))
    wait_for(Moved, fleet, "slow")
    fleet.send("slow", order(service=5.0))
    assert [stop.t for stop in of(StopServed, drain(fleet), "slow")] == [7.0]


def turns_after_it_was_stopped(make: Make) -> None:
    fleet = until_fast_moved(make)
    at = fleet.cancel("slow", at_once=True)
    fleet.send("slow", order((1.5, 3.0)))
    first, second = of(Moved, drain(fleet), "slow")
    assert first.to == second.from_ == at
    assert second.to == (1.5, 3.0)
    assert (second.start, second.end) == (1.0, 5.0)


def takes_a_new_path_after_its_current_move(make: Make) -> None:
    fleet = until_fast_moved(make)
    at = fleet.cancel("slow", at_once=False)
    fleet.send("slow", order((5, 3)))
    first, second = of(Moved, drain(fleet), "slow")
    assert first.to == second.from_ == at == (5, 1)
    assert second.to == (5, 3)


def cancel_of_an_idle_robot_changes_nothing(make: Make) -> None:
    fleet = make(two())
    assert fleet.cancel("slow", at_once=True) == (1, 1)
    assert fleet.cancel("slow", at_once=False) == (1, 1)
    assert drain(fleet) == []


def finds_what_is_near(make: Make) -> None:
    crate = gate("crate", box(5, 0.5, 6, 1.5))
    fleet = make(yard([robot("r", (1, 1), sensing=1.5)], [visit("a", (4, 1))], obstacles=(crate,)))
    fleet.send("r", order((4.5, 1)))
    found = of(ObstacleFound, drain(fleet))
    assert [(find.obstacle, find.polygon) for find in found] == [("crate", crate.polygon)]
    # 1.5 m before x = 5, at the latest a look later.
    assert 2.5 <= found[0].t <= 2.5 + 0.06


def tells_how_far_it_came_before_a_find(make: Make) -> None:
    """Else a log that ends there would have it find what it cannot see."""
    crate = gate("crate", box(5, 0.5, 6, 1.5))
    fleet = make(yard([robot("r", (1, 1), sensing=1.5)], [visit("a", (4, 1))], obstacles=(crate,)))
    fleet.send("r", order((4.5, 1)))
    before, find, after, served = drain(fleet)
    assert isinstance(before, Moved) and isinstance(after, Moved)
    assert isinstance(find, ObstacleFound) and isinstance(served, StopServed)
    assert (before.start, before.end, before.from_) == (0.0, find.t, (1, 1))
    assert (after.start, after.end, after.from_) == (find.t, 3.5, before.to)
    assert after.to == (4.5, 1)


CONTRACT = [
    drives_its_path_and_serves,
    keeps_the_speed,
    serves_where_it_stands,
    does_nothing_without_orders,
    begins_the_next_order_where_and_when_the_last_ended,
    robots_move_at_the_same_time_in_order,
    stops_at_once_in_the_middle,
    finishes_its_move_when_told_softly,
    leaves_what_it_served,
    works_on_when_told_to_again,
    turns_after_it_was_stopped,
    takes_a_new_path_after_its_current_move,
    cancel_of_an_idle_robot_changes_nothing,
    finds_what_is_near,
    tells_how_far_it_came_before_a_find,
]


@pytest.mark.parametrize("make", [SimFleet])
@pytest.mark.parametrize("law", CONTRACT, ids=lambda law: law.__name__)
def test_contract(make: Make, law: Callable[[Make], None]) -> None:
    law(make)


class Hasty(SimFleet):
    """Serves without taking the time."""

    def send(self, robot: str, order: Order) -> None:
        super().send(
            robot, Order(path=order.path, task=order.task, stop=order.stop, service_time=0)
        )


class Deaf(SimFleet):
    """Drives on whatever it is told."""

    def cancel(self, robot: str, *, at_once: bool) -> Point:
        return super().cancel("fast" if robot == "slow" else robot, at_once=at_once)


class Abrupt(SimFleet):
    """Cannot finish a move."""

    def cancel(self, robot: str, *, at_once: bool) -> Point:
        return super().cancel(robot, at_once=True)


class Coasting(SimFleet):
    """Cannot stop in a move."""

    def cancel(self, robot: str, *, at_once: bool) -> Point:
        return super().cancel(robot, at_once=False)


class Lazy(SimFleet):
    """Leaves out the last waypoint."""

    def send(self, robot: str, order: Order) -> None:
        super().send(robot, replace(order, path=order.path[:-1]))


class Silent(SimFleet):
    """Does not report finds."""

    def events(self) -> Sequence[AnyEvent]:
        while events := super().events():
            rest = [event for event in events if not isinstance(event, ObstacleFound)]
            if rest:
                return rest
        return []


class Backwards(SimFleet):
    """Reports everything at the end, the last first."""

    def events(self) -> Sequence[AnyEvent]:
        events: list[AnyEvent] = []
        while due := super().events():
            events += due
        return events[::-1]


@pytest.mark.parametrize("make", [Hasty, Deaf, Abrupt, Coasting, Lazy, Silent, Backwards])
def test_broken_fleets_fail_the_contract(make: Make) -> None:
    failed = []
    for law in CONTRACT:
        try:
            law(make)
        except (AssertionError, ValueError):
            failed.append(law.__name__)
    assert failed


# --- What the simulator senses --------------------------------------------------------------


def alone(robot: Robot, *obstacles: Obstacle, **about: Any) -> Mission:
    return yard([robot], [visit("a", (9, 9))], obstacles=obstacles, **about)


def finds(mission: Mission, *path: Point) -> list[ObstacleFound]:
    fleet = SimFleet(mission)
    fleet.send("r", order(*path))
    return of(ObstacleFound, drain(fleet))


def test_what_is_near_at_the_start_is_found_at_once() -> None:
    near, far = gate("near", box(2, 1, 3, 2)), gate("far", box(4, 1, 5, 2))
    fleet = SimFleet(alone(robot("r", (1, 1)), near, far))
    (found,) = drain(fleet)
    assert isinstance(found, ObstacleFound)
    assert (found.t, found.robot, found.obstacle) == (0.0, "r", "near")


def test_what_is_known_is_not_found() -> None:
    assert not finds(alone(robot("r", (1, 1)), gate("g", box(2, 1, 3, 2), known=True)), (1.5, 1))


def test_nothing_is_found_through_a_wall() -> None:
    crate = gate("crate", box(6, 1, 7, 2))
    wall = (((5.0, 0.0), (5.0, 10.0)),)
    eagle = robot("r", (1, 1.5), sensing=9)
    assert not finds(alone(eagle, crate, walls=wall), (4.5, 1.5), (4.5, 8))
    # With a gap in the wall it is seen when the robot looks through.
    gap = (((5.0, 0.0), (5.0, 3.0)), ((5.0, 4.0), (5.0, 10.0)))
    (found,) = finds(alone(eagle, crate, walls=gap), (4.5, 1.5), (4.5, 8))
    assert found.t > 5.0  # it had to drive up to the gap


def test_an_obstacle_hides_another() -> None:
    front, back = gate("front", box(4, 4, 4.2, 6)), gate("back", box(5, 4.5, 5.2, 5.5))
    mission = alone(robot("r", (1, 5), sensing=9), front, back)
    assert [found.obstacle for found in finds(mission, (3, 5))] == ["front"]


def test_a_drone_sees_bushes_that_it_flies_over() -> None:
    hedge = bush("hedge", box(4, 0, 5, 9))
    (found,) = finds(alone(robot("r", (1, 5), motion="drone", sensing=1.0), hedge), (9, 5))
    assert found.t == pytest.approx(2.0, abs=0.06)


@pytest.mark.parametrize("motion", ["ground", "drone"])
def test_the_bumper_finds_what_blocks_before_it_touches(motion: str) -> None:
    hedge = bush("hedge", box(4, 0, 5, 9))
    mission = alone(robot("r", (1, 5), motion=motion, radius=0.5, sensing=0.01), hedge)
    found = finds(mission, (9, 5))
    if motion == "ground":
        assert 2.5 - 0.03 <= found[0].t < 2.5
    else:
        assert found[0].t == pytest.approx(3.0, abs=0.06)


def test_two_robots_find_an_obstacle_once() -> None:
    crate = gate("crate", box(5, 4, 6, 5))
    mission = yard(
        [robot("r1", (1, 4.5)), robot("r2", (9, 4.5), speed=0.9)],
        [visit("a", (4, 4.5))],
        obstacles=(crate,),
    )
    fleet = SimFleet(mission)
    fleet.send("r1", order((4, 4.5)))
    fleet.send("r2", order((7, 4.5)))
    assert [found.robot for found in of(ObstacleFound, drain(fleet))] == ["r2"]


def test_a_robot_told_to_stop_at_a_find_has_not_touched_it() -> None:
    for speed in (1e-3, 1.0, 100.0):
        crate = gate("crate", box(5, 0, 6, 9))
        mission = alone(robot("r", (1, 5), radius=0.3, sensing=0.3, speed=speed), crate)
        fleet = SimFleet(mission)
        fleet.send("r", order((9, 5)))
        wait_for(ObstacleFound, fleet)
        at = fleet.cancel("r", at_once=True)
        assert 4.6 < at[0] < 4.7
        drain(fleet)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_finds_are_within_range_and_never_missed_on_contact(seed: int) -> None:
    mission = random_mission(seed)
    fleet = SimFleet(mission)
    for one in mission.robots:
        x, y = one.start
        fleet.send(one.id, order((9.5, y), (9.5, 0.5), (x, y), (0.5, y), (0.5, 9.5)))
    events = drain(fleet)
    moves, found = of(Moved, events), {f.obstacle: f for f in of(ObstacleFound, events)}
    for obstacle in mission.map.obstacles:
        shape = shapely.Polygon(obstacle.polygon)
        for move in moves:
            one = mission.robot(move.robot)
            if not mission.motions[one.motion].blocked_by(obstacle.kind) or obstacle.known:
                continue
            path = shapely.LineString([move.from_, move.to])
            if shapely.distance(path, shape) < one.radius:
                assert obstacle.id in found
                # Nobody had to touch it first.
                if found[obstacle.id].robot == one.id and found[obstacle.id].t > move.start:
                    driven = (found[obstacle.id].t - move.start) * one.speed
                    at = path.interpolate(min(driven, path.length))
                    assert found[obstacle.id].t > move.end or shape.distance(at) >= one.radius


def test_a_map_of_kilometres_costs_no_more_than_a_yard() -> None:
    crate = gate("crate", box(5000, 0, 6000, 9000))
    one = robot("r", (1000, 5000), sensing=1500, speed=100)
    mission = alone(one, crate, bounds=(0.0, 0.0, 10_000.0, 10_000.0))
    (found,) = finds(mission, (4500, 5000))
    assert 25.0 <= found.t <= 25.0 + 0.16
