"""The gate: what is impossible or unsafe is refused with what, where and why; nothing changes."""

from __future__ import annotations

import random
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missions import box, cell, delivery, missions, robot, visit, yard
from oath.allocate import Budget
from oath.allocate import allocator as named
from oath.commands import (
    AddTask,
    CancelTask,
    ChangeTaskPriority,
    Command,
    Live,
    ObstacleUpdate,
    PauseRobot,
    RemoveObstacle,
    ResumeRobot,
    RobotFailure,
    Undo,
    admit,
)
from oath.dispatch import advance
from oath.errors import BadInput
from oath.events import AnyEvent, MissionFinished, RobotFailed, RobotPaused, StopServed
from oath.fleet.sim import SimFleet
from oath.model import Mission, Point
from oath.runtime import Runtime
from oath.scene import prepare, unreachable
from oath.state import State
from oath.world.roadmap import Params
from operators import Operator


def live(mission: Mission, *events: AnyEvent, poses: dict[str, Point] | None = None) -> Live:
    state = State.of(mission)
    for event in events:
        state, _ = advance(state, event)
    return Live(prepare(mission, Params(points=150)), state, poses or {})


WALLS = (((7.0, 0.0), (7.0, 4.0)), ((7.0, 6.0), (7.0, 10.0)))


def hall(**changes: Any) -> Mission:
    """Return a cell with r1 and the drone outside, and a room behind the door."""
    robots = [
        robot("r1", (2, 5), can={"carry": 1.0}),
        robot("drone", (2, 8), motion="drone", can={"inspect": 1.0}),
    ]
    tasks = [delivery("a", (3, 2), (9, 5)), visit("i", (9, 8), type="inspect")]
    tasks = changes.pop("tasks", tasks)
    return yard(robots, tasks, **{"walls": WALLS, "places": {"dock": (1.0, 1.0)}} | changes)


def add(at: Point, to: Any = "dock", **more: Any) -> AddTask:
    return AddTask(location=at, delivery_point=to, task_type=more.pop("type", "carry"), **more)


def wall(*points: Point, kind: str | None = None) -> ObstacleUpdate:
    return ObstacleUpdate(obstacle_location=list(points), obstacle_type=kind)


DOOR = box(6.9, 3.9, 7.1, 6.1)
PICKED = StopServed(t=1.0, robot="r1", task="a", stop="pickup", at=(3, 2))
FAILED = RobotFailed(t=1.0, robot="r1")
PAUSED = RobotPaused(t=1.0, robot="r1")
SERVED = StopServed(t=1.0, robot="drone", task="i", stop="visit", at=(9, 8))

REFUSED: list[tuple[str, Command, str, str, tuple[AnyEvent, ...]]] = [
    ("outside", add((11, 5)), "location", "outside the map", ()),
    ("delivery outside", add((3, 3), (5, -1)), "delivery_point", "outside the map", ()),
    ("in a wall", add((7, 2)), "location", "0.00 m from what blocks the way", ()),
    ("too near a wall", add((7.25, 2)), "location", "a robot that can do it needs 0.2 m", ()),
    ("unknown place", add((3, 3), "dokc"), "delivery_point", "did you mean 'dock'", ()),
    ("unknown type", add((3, 3), type="cary"), "task_type", "did you mean 'carry'", ()),
    ("label exists", add((3, 3), task_label="a"), "task_label", "task a exists already", ()),
    ("label of a place", add((3, 3), task_label="dock"), "task_label", "something else", ()),
    ("odd label", add((3, 3), task_label="a b"), "task_label", "cannot be a label", ()),
    ("injected label", add((3, 3), task_label='x"; DROP'), "task_label", "cannot be a label", ()),
    ("nobody can", add((3, 3)), "task_type", "no robot that works can do", (FAILED,)),
    (
        "unknown task",
        ChangeTaskPriority(task_label="aa"),
        "task_label",
        "there is no task 'aa'; did you mean 'a'",
        (),
    ),
    ("unknown", CancelTask(task_label="zz"), "task_label", "there is no task 'zz'", ()),
    ("done", CancelTask(task_label="i"), "task_label", "task i is done already", (SERVED,)),
    ("done", ChangeTaskPriority(task_label="i"), "task_label", "is done already", (SERVED,)),
    (
        "picked up",
        ChangeTaskPriority(task_label="a"),
        "task_label",
        "r1 carries task a already",
        (PICKED,),
    ),
    ("point-like", wall((3, 3), (3, 3)), "obstacle_location", "both ends", ()),
    (
        "sides cross",
        wall((3, 6), (5, 8), (5, 6), (3, 8)),
        "obstacle_location",
        "no simple polygon",
        (),
    ),
    ("flat", wall((3, 6), (4, 6), (5, 6)), "obstacle_location", "no simple polygon", ()),
    ("twice", wall((3, 6), (4, 6), (4, 6), (3, 6)), "obstacle_location", "no simple polygon", ()),
    ("out of the map", wall((9, 9), (11, 9)), "obstacle_location", "out of the map", ()),
    ("over a robot", wall((1, 5), (2.3, 5)), "obstacle_location", "would cover r1", ()),
    ("beside a robot", wall((2, 4), (2, 4.85)), "obstacle_location", "would cover r1", ()),
    (
        "over a stop",
        wall((8, 5), (9.5, 5)),
        "obstacle_location",
        "would cover the delivery of task a",
        (),
    ),
    ("in the door", wall(*DOOR), "obstacle_location", "would shut in task a", ()),
    ("unknown", RemoveObstacle(obstacle="wall-1"), "obstacle", "no obstacle 'wall-1'", ()),
    ("unknown", PauseRobot(robot="r11"), "robot", "did you mean 'r1'", ()),
    ("paused", PauseRobot(robot="r1"), "robot", "is paused already", (PAUSED,)),
    ("not paused", ResumeRobot(robot="r1"), "robot", "is not paused", ()),
    ("nobody is", ResumeRobot(robot="all"), "robot", "no robot is paused", ()),
    ("failed", PauseRobot(robot="r1"), "robot", "r1 has failed", (FAILED,)),
    ("failed", ResumeRobot(robot="r1"), "robot", "r1 has failed", (FAILED,)),
    ("failed", RobotFailure(robot="r1"), "robot", "r1 has failed", (FAILED,)),
    ("all", RobotFailure(robot="all"), "robot", "no robot 'all'", ()),
    ("nothing", Undo(), "", "nothing to undo", ()),
    ("ended", add((3, 3)), "", "has ended", (MissionFinished(t=9.0, summary={}),)),
]


@pytest.mark.parametrize(
    ("command", "field", "problem", "events"),
    [row[1:] for row in REFUSED],
    ids=[f"{row[1].intent}: {row[0]}" for row in REFUSED],
)
def test_what_is_refused(
    command: Command, field: str, problem: str, events: tuple[AnyEvent, ...]
) -> None:
    world = live(hall(), *events)
    state = world.state
    with pytest.raises(BadInput, match=problem) as caught:
        admit(world, [command])
    assert (caught.value.field or "") == field
    assert caught.value.remedy
    assert world.state is state


@pytest.mark.parametrize(
    "command",
    [
        add((6.5, 5), (7.5, 5)),
        wall((2, 4), (2, 4.69)),
        wall(*DOOR, kind="bush"),
        wall((8, 7.9), (9.5, 7.9), kind="bush"),
        RobotFailure(robot="drone"),
        PauseRobot(robot="all"),
        CancelTask(task_label="A"),
    ],
    ids=lambda command: command.intent,
)
def test_what_is_admitted(command: Command) -> None:
    # The drone ignores bushes, and what only r1 can do is not cut off from it.
    tasks = [visit("i", (9, 8), type="inspect"), delivery("a", (3, 2), (4, 2))]
    assert admit(live(hall(tasks=tuple(tasks))), [command]).events


def test_an_unreachable_point_is_refused() -> None:
    mission = hall(walls=(((7.0, 0.0), (7.0, 10.0)),), tasks=())
    with pytest.raises(BadInput, match="out of reach of r1") as caught:
        admit(live(mission), [add((9, 9))])
    assert caught.value.field == "location"


def test_what_a_rule_forbids_is_out_of_reach() -> None:
    mission = hall(zones={"door": box(6.5, 3.5, 7.5, 6.5)}, rules=("G !door",), tasks=())
    with pytest.raises(BadInput, match="out of reach"):
        admit(live(mission), [add((9, 9))])
    assert admit(live(mission), [add((4, 4))]).events


def test_a_robot_is_not_shut_in() -> None:
    mission = cell(
        [robot("in", (9, 9)), robot("out", (2, 5))], [visit("a", (2, 8)), visit("b", (1, 1))]
    )
    with pytest.raises(BadInput, match="would shut in in"):
        admit(live(mission), [wall(*DOOR)])
    both = cell(
        [robot("in", (9, 9)), robot("out", (2, 5))], [visit("a", (2, 8)), visit("b", (8, 1))]
    )
    assert admit(live(both), [wall(*DOOR)]).events


def test_robots_are_where_they_are_now_not_where_they_were_last_seen() -> None:
    wall_there = wall((4, 4), (4, 6))
    assert admit(live(hall()), [wall_there]).events
    with pytest.raises(BadInput, match="would cover r1"):
        admit(live(hall(), poses={"r1": (4.0, 5.0)}), [wall_there])


def test_what_the_carrier_must_still_reach_is_not_shut_in() -> None:
    mission = hall()
    with pytest.raises(BadInput, match="would shut in task a"):
        admit(live(mission, PICKED), [wall(*DOOR)])
    # The stop where it was picked up may be covered.
    world = live(mission, PICKED, poses={"r1": (5.0, 5.0)})
    assert admit(world, [wall((2.5, 2), (3.5, 2))]).events


def test_an_obstacle_between_which_only_its_corners_lead_is_admitted() -> None:
    """Beside it is room for a robot, though no sampled point lies there."""
    mission = cell([robot("r", (2, 5))], [visit("a", (9, 5))])
    world = Live(prepare(mission, Params(points=1)), State.of(mission))
    assert admit(world, [wall((6.8, 4), (6.8, 5.4), (7.2, 5.4), (7.2, 4))]).events


def test_commands_are_admitted_in_the_world_of_those_before() -> None:
    world = live(hall())
    label = add((4, 4), task_label="n")
    events = admit(world, [label, ChangeTaskPriority(task_label="n"), CancelTask(task_label="n")])
    assert [e.type for e in events.events if e.type != "commanded"] == [
        "task_added",
        "priority_changed",
        "task_cancelled",
    ]
    for commands in (
        [label, label],
        [CancelTask(task_label="a")] * 2,
        [PauseRobot(robot="r1")] * 2,
    ):
        with pytest.raises(BadInput):
            admit(world, commands)
    assert admit(world, [CancelTask(task_label="a"), CancelTask(task_label="i"), wall(*DOOR)])


def costs(live: Live) -> list[np.ndarray[Any, Any]]:
    roadmap = live.scene.world.roadmap
    nodes = sorted(live.scene.world.stops.values())
    return [roadmap.travel(mode, nodes, nodes) for mode in range(len(roadmap.modes))]


@settings(max_examples=60, deadline=None)
@given(missions(), st.integers(0, 2**32 - 1))
def test_a_trial_leaves_no_trace_whether_it_refuses_or_not(mission: Mission, seed: int) -> None:
    scene = prepare(mission, Params(points=80))
    if unreachable(scene):
        return
    runtime = Runtime(
        scene,
        SimFleet(mission),
        name="greedy",
        allocator=named("greedy"),
        budget=Budget(),
        seed=0,
    )
    runtime.start()
    operator, rng = Operator(seed, 0), random.Random(seed)
    for _ in range(5):
        runtime.advance(runtime.now + rng.uniform(0, 4))
        world = runtime.live()
        before, obstacles = costs(world), dict(scene.world.roadmap.workspace.obstacles)
        for count in (1, 1, 3):
            with suppress(BadInput):
                admit(world, [operator.command(runtime) for _ in range(count)])
            for one, other in zip(costs(world), before, strict=True):
                np.testing.assert_array_equal(one, other)
            assert scene.world.roadmap.workspace.obstacles == obstacles
            assert runtime.live() == world
        operator.act(runtime)
