"""Dispatch is pure, loses no task whatever happens, and answers each event as it should."""

from __future__ import annotations

import random
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oath
from missions import cell, delivery, gate, missions, random_mission, robot, visit, yard
from oath import dispatch
from oath import events as ev
from oath.dispatch import (
    Action,
    Allocate,
    Drive,
    Plan,
    Repair,
    UpdateMap,
    advance,
    failure,
)
from oath.errors import BadInput
from oath.model import Mission, Route, RouteStop
from oath.runtime import summarise
from oath.state import RobotState, State

DOOR = ((6.9, 3.9), (7.1, 3.9), (7.1, 6.1), (6.9, 6.1))


def route(*stops: str) -> Route:
    """Return a route: ``+a`` picks a up, ``-a`` delivers it, ``a`` visits."""
    names = {"+": "pickup", "-": "delivery"}
    return tuple(
        RouteStop(task=stop.lstrip("+-"), stop=names.get(stop[0], "visit"))  # type: ignore[arg-type]
        for stop in stops
    )


def pair() -> Mission:
    return yard(
        [robot("r1", (1, 1)), robot("r2", (9, 9))],
        [delivery("a", (2, 2), (3, 3)), delivery("b", (4, 4), (5, 5)), visit("c", (6, 6))],
    )


def state(**changes: Any) -> State:
    return replace(State.of(pair()), **changes)


def allocated(
    routes: dict[str, Route], t: float = 0.0, round: int = 1, **unassigned: str
) -> ev.Allocated:
    return ev.Allocated(t=t, round=round, seconds=0.1, routes=routes, unassigned=unassigned)


def planned(
    robot: str,
    length: float | None = 1.0,
    unreachable: str | None = None,
    reason: Any = "allocated",
) -> ev.Planned:
    return ev.Planned(
        t=1.0, robot=robot, seconds=0.1, length=length, reason=reason, unreachable=unreachable
    )


def served(robot: str, stop: RouteStop, t: float = 2.0, at: Any = (0, 0)) -> ev.StopServed:
    return ev.StopServed(t=t, robot=robot, task=stop.task, stop=stop.stop, at=at)


def routed(state: State) -> list[str]:
    """Tasks that are in a route but not begun, once for every robot that has them."""
    return [
        task
        for robot in state.robots.values()
        for task in dict.fromkeys(stop.task for stop in robot.route)
        if task in state.open_tasks()
    ]


def check_partition(state: State) -> None:
    parts = [
        *state.completed,
        *state.carried(),
        *state.stranded,
        *routed(state),
        *state.waiting(),
    ]
    assert sorted(parts) == sorted(state.tasks)
    for id, one in state.robots.items():
        for task in one.carrying:
            due = RouteStop(task=task, stop="delivery") in one.route
            assert due == (task in state.deliverable(id)), (id, task)
        for stop in one.route:
            if stop.stop == "delivery":
                to_pick_up = RouteStop(task=stop.task, stop="pickup") in one.route
                assert to_pick_up == (stop.task not in one.carrying), (id, stop)
        assert len(set(one.route)) == len(one.route)


def pure(state: State, event: ev.AnyEvent) -> tuple[State, tuple[Action, ...]]:
    """Advance, and see that nothing was changed on the way and that the answer is no accident."""
    state_before, event_before = deepcopy(state), deepcopy(event)
    answer = advance(state, event)
    assert state == state_before
    assert event == event_before
    assert advance(deepcopy(state), deepcopy(event)) == answer
    return answer


# --- Each event -----------------------------------------------------------------------------


def started(t: float = 0.0) -> ev.MissionStarted:
    return ev.MissionStarted(t=t, mission="yard", allocator="oath", seed=0)


def test_a_mission_begins_with_a_round() -> None:
    after, actions = pure(state(), started())
    assert actions == (Allocate(),)
    assert after == state(allocating=True, rounds=1)


def test_new_routes_are_planned_and_kept_ones_are_not() -> None:
    kept = state(
        rounds=1,
        allocating=True,
        robots={"r1": RobotState(position=(1, 1), route=route("c")), "r2": idle()},
    )
    answer = allocated({"r1": route("c"), "r2": route("+a", "-a")}, b="waits for a robot")
    after, actions = pure(kept, answer)
    assert actions == (Plan("r2", "allocated"),)
    assert after.robots["r2"].route == route("+a", "-a")
    assert (after.rounds, after.allocating, after.unassigned) == (
        1,
        False,
        {"b": "waits for a robot"},
    )
    assert after.unserved()["b"] == "waits for a robot"


def idle() -> RobotState:
    return RobotState(position=(9, 9))


def test_a_round_that_gives_nothing_to_idle_robots_ends_the_mission() -> None:
    after, actions = pure(state(allocating=True), allocated({"r1": (), "r2": ()}, a="why"))
    assert actions == ()
    assert not after.finished
    assert pure(after, ev.MissionFinished(t=3.0, summary={}))[0].finished


def test_a_robot_whose_route_is_taken_away_is_planned_too() -> None:
    busy = state(
        allocating=True, robots={"r1": RobotState(position=(1, 1), route=route("c")), "r2": idle()}
    )
    after, actions = pure(busy, allocated({"r1": (), "r2": route("c")}))
    assert actions == (Plan("r1", "allocated"), Plan("r2", "allocated"))
    assert pure(after, planned("r1", length=0.0)) == (replace(after, t=1.0), ())


def test_a_plan_is_driven() -> None:
    ready = state(robots={"r1": RobotState(position=(1, 1), route=route("c")), "r2": idle()})
    after, actions = pure(ready, planned("r1"))
    assert actions == (Drive("r1"),)
    left = {**ready.robots, "r1": replace(ready.robots["r1"], left=after.robots["r1"].left)}
    assert after == replace(ready, t=1.0, robots=left)


def test_a_task_without_a_plan_is_refused_and_the_rest_goes_back() -> None:
    ready = state(
        robots={
            "r1": RobotState(position=(1, 1), route=route("+a", "+b", "-a", "-b")),
            "r2": idle(),
        }
    )
    after, actions = pure(ready, planned("r1", None, "b"))
    assert after.refused == {("r1", "b")}
    assert after.robots["r1"].route == ()
    assert after.waiting() == ("a", "b", "c")
    assert actions == (Allocate(),)
    assert after.allocating


def test_what_is_carried_stays_when_another_task_has_no_plan() -> None:
    loaded = RobotState(position=(1, 1), route=route("+b", "-a", "-b"), carrying=("a",))
    after, actions = pure(state(robots={"r1": loaded, "r2": idle()}), planned("r1", None, "b"))
    assert after.robots["r1"].route == route("-a")
    assert after.carried() == {"a"}
    assert actions == (Plan("r1", "allocated"), Allocate())


def test_a_carried_task_without_a_plan_is_stranded_in_its_robots_hands() -> None:
    loaded = RobotState(position=(1, 1), route=route("-a", "c"), carrying=("a",))
    before = state(robots={"r1": loaded, "r2": idle()})
    after, actions = pure(before, planned("r1", None, "a", "obstacle"))
    assert after.stranded.keys() == {"a"}
    assert "r1" in after.unserved()["a"]
    assert after.carried() == frozenset()
    assert after.refused == frozenset()
    # It still takes room there.
    assert after.robots["r1"] == replace(loaded, route=())
    assert actions == (Allocate(),)
    check_partition(after)


def test_two_carried_tasks_strand_one_by_one() -> None:
    loaded = RobotState(position=(1, 1), route=route("-a", "-b"), carrying=("a", "b"))
    first, actions = pure(
        state(robots={"r1": loaded, "r2": idle()}), planned("r1", None, "a", "obstacle")
    )
    assert first.robots["r1"].route == route("-b")
    assert actions == (Plan("r1", "obstacle"), Allocate())
    second, actions = pure(first, planned("r1", None, "b", "obstacle"))
    assert second.stranded.keys() == {"a", "b"}
    assert second.robots["r1"].route == ()
    assert (first.rounds, second.rounds) == (1, 2)
    assert actions == ()


def test_a_move_says_where_the_robot_is() -> None:
    event = ev.Moved(t=4.0, robot="r1", from_=(1, 1), to=(1, 5), start=0.0, end=4.0)
    after, actions = pure(state(), event)
    assert actions == ()
    assert after.t == 4.0
    assert after.robots["r1"].position == (1, 5)
    assert after.robots["r2"] == idle()


def test_a_pickup_is_carried_and_the_robot_drives_on() -> None:
    ready = state(robots={"r1": RobotState(position=(1, 1), route=route("+a", "-a")), "r2": idle()})
    after, actions = pure(ready, served("r1", route("+a")[0], at=(2, 2)))
    assert after.robots["r1"] == RobotState(position=(2, 2), route=route("-a"), carrying=("a",))
    assert actions == (Drive("r1"),)
    assert after.completed == frozenset()


@pytest.mark.parametrize("last", ["-a", "c"])
def test_the_last_stop_completes_a_task_and_asks_for_more(last: str) -> None:
    task = last.lstrip("-")
    carrying = ("a",) if task == "a" else ()
    ready = state(
        refused=frozenset({("r1", "b"), ("r2", "b")}),
        robots={
            "r1": RobotState(position=(1, 1), route=route(last), carrying=carrying),
            "r2": idle(),
        },
    )
    after, actions = pure(ready, served("r1", route(last)[0]))
    assert after.completed == {task}
    assert after.robots["r1"].carrying == ()
    assert actions == (Allocate(),)
    # What a rule forbade r1 may be allowed now; r2 did nothing new.
    assert after.refused == {("r2", "b")}


def test_the_last_task_of_all_ends_the_mission() -> None:
    ready = state(
        completed=frozenset("ab"),
        robots={"r1": RobotState(position=(1, 1), route=route("c")), "r2": idle()},
    )
    assert pure(ready, served("r1", route("c")[0]))[1] == ()


def test_the_mission_does_not_end_while_somebody_drives_or_a_round_is_on() -> None:
    busy = RobotState(position=(1, 1), route=route("-a"), carrying=("a",))
    here = RobotState(position=(1, 1), route=route("c"))
    ready = state(completed=frozenset("b"), robots={"r1": here, "r2": busy})
    assert pure(ready, served("r1", route("c")[0]))[1] == ()
    alone = state(completed=frozenset("ab"), robots={"r1": here, "r2": idle()}, allocating=True)
    assert pure(alone, served("r1", route("c")[0]))[1] == ()


def test_a_find_goes_on_the_map_before_anybody_repairs() -> None:
    ready = state(robots={"r1": RobotState(position=(1, 1), route=route("c")), "r2": idle()})
    event = ev.ObstacleFound(t=1.0, robot="r2", obstacle="bush-1", polygon=DOOR)
    assert pure(ready, event)[1] == (
        UpdateMap("bush-1"),
        Repair("r1", "bush-1"),
        Repair("r2", "bush-1"),
    )


def test_a_command_itself_only_moves_the_clock() -> None:
    event = ev.Commanded(t=5.0, command={"intent": "undo"}, source="operator")
    assert pure(state(), event) == (state(t=5.0), ())


def busy(robot: str = "r1", *stops: str, **changes: Any) -> State:
    one = RobotState(position=(1, 1), route=route(*stops), **changes)
    return state(robots={"r1": idle(), "r2": idle()} | {robot: one})


def test_a_new_task_and_a_new_priority_ask_for_a_round() -> None:
    task = visit("n", (3, 3))
    after, actions = pure(state(), ev.TaskAdded(t=1.0, task=task))
    assert actions == (Allocate(),)
    assert after.tasks["n"] == task and "n" in after.labels and after.changes == 1
    event = ev.PriorityChanged(t=2.0, task="a", priority="high")
    after, actions = pure(state(), event)
    assert actions == (Allocate(),)
    assert after.urgent() == ("a",)


def test_a_cancelled_task_leaves_every_route_and_its_robot_turns_only_if_it_was_next() -> None:
    next_one, actions = pure(busy("r1", "c", "+a", "-a"), ev.TaskCancelled(t=1.0, task="c"))
    assert next_one.robots["r1"].route == route("+a", "-a")
    assert actions == (Plan("r1", "command"), Allocate())
    later, actions = pure(busy("r1", "c", "+a", "-a"), ev.TaskCancelled(t=1.0, task="a"))
    assert later.robots["r1"].route == route("c") and later.robots["r1"].stale
    assert actions == (Allocate(),)
    assert "a" not in later.tasks


def test_what_is_cancelled_aboard_stays_and_pickups_that_counted_on_its_room_go_back() -> None:
    before = busy("r1", "-a", "+b", "-b", carrying=("a",))
    after, actions = pure(before, ev.TaskCancelled(t=1.0, task="a"))
    assert after.robots["r1"].carrying == ("a",) and after.robots["r1"].route == ()
    assert after.carrier("a") == "r1" and after.deliverable("r1") == ()
    assert actions == (Plan("r1", "command"), Allocate())
    check_partition(after)


def test_a_failed_robot_strands_what_it_carries_until_that_comes_back_as_it_does() -> None:
    before = busy("r1", "-a", "c", carrying=("a",))
    events = failure(before, "r1", (4, 4))
    assert [event.type for event in events] == ["robot_failed", "task_cancelled", "task_added"]
    stranded, actions = pure(before, events[0])
    assert stranded.stranded == {"a": "carried by r1, which failed"}
    assert actions == (Plan("r1", "command"), Allocate())
    after = stranded
    for event in events[1:]:
        after, actions = pure(after, event)
        check_partition(after)
        assert actions == ()  # the round that was asked for has yet to answer
    assert after.robots["r1"] == RobotState(position=(1, 1))
    assert after.tasks["a"].stops[0].at == (4, 4)
    assert after.waiting() == ("b", "c", "a")
    # One answer that knows of all this is enough, an older one is not.
    answer = allocated({"r1": (), "r2": ()}, round=after.rounds)
    assert pure(after, answer)[1] == ()
    assert pure(after, replace(answer, round=after.rounds - 1))[1] == (Allocate(),)


def test_a_paused_robot_keeps_its_route_and_only_what_is_urgent_asks_for_a_round() -> None:
    event = ev.RobotPaused(t=1.0, robot="r1")
    after, actions = pure(busy("r1", "c"), event)
    assert actions == () and after.robots["r1"].route == route("c")
    assert after.unserved()["c"] == "given to r1, which is paused"
    assert after.unserved()["a"] == "waits for a robot (paused: r1)"
    high = replace(state().tasks["c"], priority="high")
    before = replace(busy("r1", "c"), tasks={**state().tasks, "c": high})
    assert pure(before, event)[1] == (Allocate(),)
    # It is planned for, but does not drive.
    assert pure(after, planned("r1"))[1] == ()
    resumed, actions = pure(after, ev.RobotResumed(t=2.0, robot="r1"))
    assert actions == (Plan("r1", "command"), Allocate())
    assert resumed.paused == frozenset()


def test_a_late_answer_gives_a_paused_robot_nothing_new_and_nobody_what_was_cancelled() -> None:
    on = replace(busy("r1", "c"), rounds=1, allocating=True)
    held, _ = pure(on, ev.RobotPaused(t=1.0, robot="r1"))
    gone, _ = pure(held, ev.TaskCancelled(t=1.0, task="b"))
    late = allocated({"r1": route("c", "+a", "-a"), "r2": route("+b", "-b")})
    after, _ = pure(gone, late)
    assert after.robots["r1"].route == route("c")
    assert after.robots["r2"].route == ()


def test_an_obstacle_that_goes_asks_for_shorter_ways_and_another_round() -> None:
    wall = ev.ObstacleAdded(t=1.0, obstacle="w", kind="wall", polygon=DOOR)
    there, actions = pure(busy("r1", "c"), wall)
    assert actions == (UpdateMap("w"), Repair("r1", "w"), Repair("r2", "w"))
    there = replace(there, refused=frozenset({("r2", "a")}))
    gone, actions = pure(there, ev.ObstacleRemoved(t=2.0, obstacle="w"))
    assert actions == (UpdateMap("w"), Plan("r1", "command"), Allocate())
    assert gone.obstacles == {} and gone.refused == frozenset() and "w" in gone.obstacle_ids


@pytest.mark.parametrize(("length", "asks"), [(10.4, False), (10.6, True)])
def test_only_a_way_that_grew_enough_is_reconsidered(length: float, asks: bool) -> None:
    before = replace(busy("r1", "c", left=10.0), reconsiders=True)
    actions = pure(before, planned("r1", length, reason="obstacle"))[1]
    assert actions == ((Drive("r1"), Allocate()) if asks else (Drive("r1"),))
    assert pure(replace(before, reconsiders=False), planned("r1", length, reason="obstacle"))[
        1
    ] == (Drive("r1"),)


def test_every_command_is_kept_with_what_takes_it_back_until_it_is_taken_back() -> None:
    told = ev.Commanded(t=0.0, command={"intent": "some"}, source="test")
    undo = ev.Commanded(t=0.0, command={"intent": "undo"}, source="test")
    now = state()
    for event in (told, ev.RobotPaused(t=1.0, robot="r1"), ev.RobotPaused(t=1.0, robot="r2")):
        now, _ = pure(now, event)
    now, _ = pure(now, told)
    now, _ = pure(now, ev.RobotFailed(t=2.0, robot="r1"))
    now, _ = pure(now, ev.TaskCancelled(t=2.0, task="a"))  # what follows is not recorded
    resumed = [ev.RobotResumed(t=1.0, robot=robot) for robot in ("r2", "r1")]
    assert now.undo == (tuple(resumed), ())
    now, _ = pure(now, undo)
    now, _ = pure(now, ev.TaskCancelled(t=2.0, task="b"))
    assert now.undo == (tuple(resumed),)


def test_the_clock_never_goes_back() -> None:
    assert pure(state(t=9.0), started(2.0))[0].t == 9.0


# --- One round at a time --------------------------------------------------------------------


def test_only_one_round_is_in_flight_and_changes_ask_for_another() -> None:
    on = state(
        rounds=1,
        allocating=True,
        robots={"r1": RobotState(position=(1, 1), route=route("c")), "r2": idle()},
    )
    changed, actions = pure(on, served("r1", route("c")[0]))
    assert actions == ()
    assert changed.rounds == on.rounds + 1
    after, actions = pure(changed, allocated({"r1": route("c"), "r2": route("+a", "-a")}))
    assert actions == (Plan("r2", "allocated"), Allocate())
    assert after.allocating
    # c was done while the round was computed.
    assert after.robots["r1"].route == ()
    check_partition(after)


def test_a_late_answer_does_not_revive_a_refused_task() -> None:
    on = state(
        allocating=True, robots={"r1": RobotState(position=(1, 1), route=route("c")), "r2": idle()}
    )
    refused, _ = pure(on, planned("r1", None, "c"))
    after, _ = pure(refused, allocated({"r1": route("c"), "r2": ()}))
    assert after.robots["r1"].route == ()
    assert after.waiting() == ("a", "b", "c")


def test_a_late_answer_does_not_take_what_was_picked_up_meanwhile() -> None:
    on = state(
        allocating=True,
        robots={"r1": RobotState(position=(1, 1), route=route("+a", "-a")), "r2": idle()},
    )
    loaded, _ = pure(on, served("r1", route("+a")[0]))
    after, _ = pure(loaded, allocated({"r1": (), "r2": route("+a", "-a")}))
    assert after.robots["r1"].route == route("-a")
    assert after.robots["r2"].route == ()
    check_partition(after)


# --- Laws -----------------------------------------------------------------------------------


class Chaos:
    """Answers dispatch's actions late, in any order, and as badly as the seams allow."""

    def __init__(self, mission: Mission, seed: int) -> None:
        self.rng = random.Random(seed)
        self.mission = mission
        self.state = State.of(mission)
        self.asked: State | None = None
        """The state that the round in flight was asked for."""
        self.plans: list[tuple[str, Any]] = []
        self.driving: set[str] = set()
        self.changes = 6

    def run(self) -> None:
        self.apply(started())
        for _ in range(600):
            if self.changes and self.rng.random() < 0.15:
                self.changes -= 1
                for event in self.change():
                    self.apply(event)
                continue
            events = self.next_event()
            if not events:
                break
            self.apply(events[0])
        else:
            pytest.fail("the mission does not end")
        # The end: nothing is in flight any more, and nobody has anything left to do.
        assert not self.state.allocating
        assert not any(robot.route for robot in self.state.robots.values())

    def apply(self, event: ev.AnyEvent) -> None:
        self.state, actions = pure(self.state, event)
        check_partition(self.state)
        for action in actions:
            match action:
                case Allocate():
                    assert self.asked is None, "two rounds are in flight"
                    self.asked = self.state
                case Plan(robot, reason) | Repair(robot, reason):
                    self.driving.discard(robot)
                    known = reason if isinstance(action, Plan) else "obstacle"
                    self.plans.append((robot, known))
                case Drive(robot):
                    assert self.state.robots[robot].route, f"{robot} is sent nowhere"
                    assert robot not in self.state.paused | self.state.failed
                    self.driving.add(robot)
        assert self.state.allocating == (self.asked is not None)

    def next_event(self) -> list[ev.AnyEvent]:
        choices: list[ev.AnyEvent] = [*self.stops(), *self.planning()]
        if self.asked is not None:
            choices.append(self.answer(self.asked))
        if not choices:  # nobody does anything any more, unless those who are paused go on
            return [ev.RobotResumed(t=self.state.t, robot=r) for r in sorted(self.state.paused)]
        event = self.rng.choice(choices)
        if isinstance(event, ev.Allocated):
            self.asked = None
        if isinstance(event, ev.Planned):
            self.plans.remove((event.robot, event.reason))
        return [event]

    def change(self) -> Sequence[ev.AnyEvent]:
        """Return something that changes the mission, or nothing if it is not possible."""
        state, t, rng = self.state, self.state.t, self.rng
        robots = [robot for robot in state.robots if robot not in state.failed]
        undone = [task for task in state.tasks if task not in state.completed]
        choices: list[Sequence[ev.AnyEvent]] = []
        new = f"new{self.changes}"
        choices.append([ev.TaskAdded(t=t, task=delivery(new, (1, 1), (2, 2)))])
        choices.append([ev.ObstacleAdded(t=t, obstacle=new, kind="wall", polygon=DOOR)])
        choices += [[ev.ObstacleRemoved(t=t, obstacle=one)] for one in state.obstacles]
        if undone:
            task, priority = rng.choice(undone), rng.choice(["low", "normal", "high"])
            choices.append([ev.TaskCancelled(t=t, task=task)])
            choices.append([ev.PriorityChanged(t=t, task=task, priority=priority)])
        if robots:
            robot = rng.choice(robots)
            choices.append([ev.ObstacleFound(t=t, robot=robot, obstacle="x", polygon=DOOR)])
            choices.append(failure(state, robot, state.robots[robot].position))
            kind = ev.RobotResumed if robot in state.paused else ev.RobotPaused
            choices += [[kind(t=t, robot=robot)]] * 2
        events = rng.choice(choices)
        for event in events:
            if isinstance(event, ev.RobotPaused | ev.RobotFailed):
                self.driving.discard(event.robot)
        return [ev.Commanded(t=t, command={"intent": "some"}, source="test"), *events]

    def stops(self) -> list[ev.AnyEvent]:
        t = self.state.t + self.rng.random()
        return [
            served(robot, self.state.robots[robot].route[0], t)
            for robot in sorted(self.driving)
            if self.state.robots[robot].route
        ]

    def planning(self) -> list[ev.AnyEvent]:
        events: list[ev.AnyEvent] = []
        for id, reason in self.plans:
            left = self.state.robots[id].route
            lost = self.rng.choice(left).task if left and self.rng.random() < 0.3 else None
            events.append(planned(id, None if lost else 1.0, lost, reason))
        return events

    def answer(self, then: State) -> ev.Allocated:
        """Return a sound answer to the state of when it was asked."""
        routes: dict[str, Route] = {id: one.route for id, one in then.robots.items()}
        open_ = list(then.waiting())
        for id in routes:
            if id in then.failed | then.paused or (routes[id] and self.rng.random() < 0.7):
                continue
            can = [task for task in open_ if (id, task) not in then.refused]
            if can and self.rng.random() < 0.8:
                task = then.tasks[self.rng.choice(can)]
                open_.remove(task.id)
                routes[id] += tuple(RouteStop(task=task.id, stop=stop.name) for stop in task.stops)
        # Some tasks that nobody has picked up yet change hands.
        works = [one for one in self.mission.robots if one.id not in then.failed | then.paused]
        for one, other in pairwise(works):
            mine = [s for s in routes[one.id] if s.task in then.open_tasks()]
            if mine and self.rng.random() < 0.2:
                task_id = mine[0].task
                if (other.id, task_id) not in then.refused:
                    moved = tuple(s for s in routes[one.id] if s.task == task_id)
                    routes[one.id] = tuple(s for s in routes[one.id] if s.task != task_id)
                    routes[other.id] += moved
        return allocated(
            routes, self.state.t, then.rounds, **dict.fromkeys(open_, "waits for a robot")
        )


@settings(max_examples=300, deadline=None)
@given(missions(), st.integers(0, 2**32 - 1))
def test_no_task_is_lost_or_doubled_whatever_happens(mission: Mission, seed: int) -> None:
    Chaos(mission, seed).run()


def fold(mission: Mission, events: Sequence[ev.AnyEvent]) -> State:
    state = State.of(mission)
    for event in events:
        state, _ = pure(state, event)
        check_partition(state)
    return state


def check_replay(mission: Mission, **options: Any) -> State:
    result = oath.run(mission, **options)
    *before, last = result.events
    state = fold(mission, before)
    assert summarise(mission, state, before) == result.summary
    assert isinstance(last, ev.MissionFinished)
    assert [event for event in before if isinstance(event, ev.MissionFinished)] == []
    return fold(mission, result.events)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_events_of_a_run_rebuild_its_state(seed: int) -> None:
    try:
        state = check_replay(random_mission(seed), seed=seed, points=100)
    except BadInput:  # a stop is out of reach
        return
    assert state.finished
    assert not state.carried()


def test_the_events_of_a_shipped_mission_rebuild_its_state() -> None:
    mission = oath.load("missions/maze-25-gates.yaml")
    assert check_replay(mission, seed=3).completed == {task.id for task in mission.tasks}


def test_a_run_with_a_stranded_task_rebuilds_its_state() -> None:
    mission = cell(
        [robot("r1", (5.2, 5))],
        [delivery("a", (5, 5), (9, 5)), visit("b", (1, 1)), delivery("c", (1, 1), (3, 3))],
        obstacles=(gate("gate-1", DOOR),),
    )
    # Blind until it touches the gate: it has picked a up by then.
    mission = replace(mission, robots=(replace(mission.robots[0], sensing=0.5),))
    state = check_replay(mission, points=200, allocator="oath")
    assert state.stranded.keys() == {"a"}
    assert state.completed == {"b"}
    assert state.unserved()["c"] == "no room: the robots that could take it are full"


# --- Many events ----------------------------------------------------------------------------


def test_folding_is_advancing_event_by_event() -> None:
    mission = oath.load("missions/maze-25-gates.yaml")
    events = oath.run(mission, allocator="greedy").events
    state, calls = State.of(mission), []
    for event in events:
        state, actions = advance(state, event)
        calls += actions
    told, wanted, last = [], [], State.of(mission)
    for run, after, actions in dispatch.fold(last, events):
        told += run
        wanted += actions
        last = after
    assert (tuple(told), wanted, last) == (events, calls, state)
