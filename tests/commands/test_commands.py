"""Each command: how it is read, what is filled in, what it says, and what comes of it."""

from __future__ import annotations

import json
import math
import string
from collections.abc import Callable, Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missions import box, delivery, gate, robot, visit, yard
from oath.commands import (
    COMMANDS,
    AddTask,
    CancelTask,
    ChangeTaskPriority,
    Command,
    Live,
    ObstacleUpdate,
    PauseRobot,
    QueryStatus,
    RemoveObstacle,
    ResumeRobot,
    RobotFailure,
    Undo,
    admit,
    parse,
    schema,
    to_plain,
)
from oath.dispatch import advance
from oath.errors import BadInput
from oath.events import (
    AnyEvent,
    Commanded,
    ObstacleAdded,
    ObstacleRemoved,
    PriorityChanged,
    RobotFailed,
    RobotPaused,
    RobotResumed,
    StopServed,
    TaskAdded,
    TaskCancelled,
)
from oath.model import Mission, Stop
from oath.scene import prepare
from oath.state import State
from oath.world.roadmap import Params


def mission() -> Mission:
    return yard(
        [robot("r1", (1, 1), capacity=2), robot("r2", (9, 9), motion="drone")],
        [delivery("a", (2, 2), (8, 2)), delivery("b", (2, 5), (8, 5)), visit("c", (5, 8))],
        places={"Dock": (5.0, 1.0), "depot": (1.0, 9.0)},
        zones={"lab": box(8.5, 0, 9.5, 0.5)},
        obstacles=(gate("crate", box(4.5, 4.5, 5.5, 5.5), known=True),),
    )


def live(*events: AnyEvent) -> Live:
    made = mission()
    state, scene = State.of(made), prepare(made, Params(points=100))
    for event in events:
        state, _ = advance(state, event)
        if isinstance(event, ObstacleAdded):
            scene.world.roadmap.add_obstacle(state.obstacles[event.obstacle])
        elif isinstance(event, ObstacleRemoved):
            scene.world.roadmap.remove_obstacle(event.obstacle)
    return Live(scene, state)


PICKED = StopServed(t=1.0, robot="r1", task="a", stop="pickup", at=(2, 2))


def said(command: Command, *before: AnyEvent) -> str:
    (words,) = admit(live(*before), [command]).says
    return words


def effect(command: Command, *before: AnyEvent) -> list[AnyEvent]:
    first, *rest = admit(live(*before), [command]).events
    assert isinstance(first, Commanded)
    assert to_plain(parse(first.command)) == first.command
    return rest


# --- Adding a task


def test_an_added_task_has_a_made_up_label_the_usual_type_and_the_places_own_name() -> None:
    usual = yard([robot("r", (1, 1), can={"normal": 1.0})], [], task_types=("special", "normal"))
    world = Live(prepare(usual, Params(points=50)), State.of(usual))
    filled = AddTask(location=(2, 3), delivery_point=(4, 4)).filled(world)
    assert (filled.task_label, filled.task_type, filled.priority) == ("t1", "normal", "normal")
    here = AddTask(location=(2, 3), delivery_point="dOCK", task_type="CARRY")
    (event,) = effect(here)
    assert isinstance(event, TaskAdded)
    assert event.task.id == "t1"
    assert event.task.stops == (
        Stop(name="pickup", at=(2, 3)),
        Stop(name="delivery", at=(5, 1), place="Dock"),
    )
    assert said(here) == "adds task t1 at (2.0, 3.0), delivery Dock, carry"
    high = AddTask(location=(2.5, 3.25), delivery_point=(8, 8), task_type="carry", priority="high")
    assert said(high) == "adds task t1 at (2.5, 3.25), delivery (8.0, 8.0), carry, high priority"


def test_a_label_is_never_used_again() -> None:
    task = AddTask(location=(2, 3), delivery_point="depot", task_type="carry")
    added = effect(task)
    assert isinstance(added[0], TaskAdded)
    gone = TaskCancelled(t=0.0, task="t1")
    (event,) = effect(task, added[0], gone)
    assert isinstance(event, TaskAdded) and event.task.id == "t2"


def test_a_type_is_asked_for_where_none_is_usual() -> None:
    with pytest.raises(BadInput, match="the task's type is missing") as caught:
        admit(live(), [AddTask(location=(2, 3), delivery_point="depot")])
    assert caught.value.field == "task_type" and "carry, inspect" in caught.value.remedy


# --- Obstacles


def test_a_segment_becomes_a_rectangle_as_thick_as_the_walls() -> None:
    wall = ObstacleUpdate(obstacle_location=[(2, 7), (4, 7)])
    (event,) = effect(wall)
    assert isinstance(event, ObstacleAdded)
    assert (event.obstacle, event.kind) == ("wall-1", "wall")
    assert sorted(event.polygon) == [(2, 6.9), (2, 7.1), (4, 6.9), (4, 7.1)]
    assert said(wall) == "adds wall-1 (wall) from (2.0, 7.0) to (4.0, 7.0)"


def test_a_polygon_stays_as_it_is_and_need_not_be_closed() -> None:
    corners: list[tuple[float, float]] = [(2, 7), (3, 7), (3, 8)]
    for told in (corners, [*corners, corners[0]]):
        bush = ObstacleUpdate(obstacle_location=told, obstacle_type="bush")
        (event,) = effect(bush)
        assert isinstance(event, ObstacleAdded)
        assert (event.obstacle, event.polygon) == ("bush-1", tuple(corners))


def test_an_obstacle_is_removed_by_its_name() -> None:
    (event,) = effect(RemoveObstacle(obstacle="Crate"))
    assert event == ObstacleRemoved(t=0.0, obstacle="crate")
    assert said(RemoveObstacle(obstacle="crate")) == "removes crate (gate)"


# --- Tasks and robots


@pytest.mark.parametrize(
    ("command", "event", "words"),
    [
        (
            ChangeTaskPriority(task_label="B"),
            PriorityChanged(t=0.0, task="b", priority="high"),
            "changes the priority of task b from normal to high",
        ),
        (CancelTask(task_label="b"), TaskCancelled(t=0.0, task="b"), "cancels task b"),
        (PauseRobot(robot="R1"), RobotPaused(t=0.0, robot="r1"), "pauses r1"),
        (
            RobotFailure(robot="r2"),
            RobotFailed(t=0.0, robot="r2"),
            "counts r2 out as failed",
        ),
    ],
    ids=lambda value: getattr(value, "intent", ""),
)
def test_what_comes_of_it(command: Command, event: AnyEvent, words: str) -> None:
    assert effect(command) == [event]
    assert said(command) == words


def test_one_robot_or_all() -> None:
    paused = RobotPaused(t=0.0, robot="r1")
    assert effect(PauseRobot(robot="all"), paused) == [RobotPaused(t=0.0, robot="r2")]
    assert effect(ResumeRobot(robot="ALL"), paused) == [RobotResumed(t=0.0, robot="r1")]
    assert effect(ResumeRobot(robot="r1"), paused) == [RobotResumed(t=0.0, robot="r1")]
    assert said(PauseRobot(robot="all")) == "pauses all robots"
    assert said(ResumeRobot(robot="r1"), paused) == "lets r1 go on"


def test_what_a_failed_robot_carries_comes_back_where_it_stands() -> None:
    command = RobotFailure(robot="r1")
    failed, cancelled, added = effect(command, PICKED)
    assert failed == RobotFailed(t=1.0, robot="r1")
    assert cancelled == TaskCancelled(t=1.0, task="a")
    assert isinstance(added, TaskAdded)
    assert [stop.at for stop in added.task.stops] == [(2, 2), (8, 2)]
    assert said(command, PICKED) == "counts r1 out as failed; a waits where it stands"


def test_a_carried_task_stays_aboard_when_it_is_cancelled() -> None:
    words = said(CancelTask(task_label="a"), PICKED)
    assert words == "cancels task a; r1 carries it already and keeps it aboard"


def test_the_status_tells_of_tasks_and_robots_and_changes_nothing() -> None:
    events = [PICKED, RobotPaused(t=2.0, robot="r2")]
    admitted = admit(live(*events), [QueryStatus()])
    assert admitted.events == ()
    lines = admitted.says[0].splitlines()
    assert lines == [
        "0 of 3 tasks are done at 2.0 s; 2 wait for a robot",
        "r1 at (2.0, 2.0): idle, carries a",
        "r2 at (9.0, 9.0): idle, paused",
    ]


# --- Undo

COME = [
    TaskAdded(t=0.0, task=visit("n", (3, 3))),
    TaskCancelled(t=0.0, task="b"),
    PriorityChanged(t=0.0, task="b", priority="low"),
    ObstacleAdded(t=0.0, obstacle="o", kind="wall", polygon=box(2, 7, 3, 8)),
    ObstacleRemoved(t=0.0, obstacle="crate"),
    RobotPaused(t=0.0, robot="r1"),
]


def told(intent: str = "some") -> Commanded:
    return Commanded(t=0.0, command={"intent": intent}, source="test")


@pytest.mark.parametrize("event", COME, ids=lambda event: event.type)
def test_undo_takes_each_change_back(event: AnyEvent) -> None:
    before, after = live(), live(told(), event)
    taken = admit(after, [Undo()])
    state = after.state
    for back in taken.events:
        state, _ = advance(state, back)
    for what in ("tasks", "obstacles", "paused", "completed"):
        got, wanted = getattr(state, what), getattr(before.state, what)
        assert got == wanted, what
    assert taken.says[0].startswith("undoes the last change: ")
    with pytest.raises(BadInput, match="nothing to undo"):
        admit(Live(after.scene, state), [Undo()])


def test_undo_twice_takes_back_two_commands_the_last_one_first() -> None:
    world = live(told(), COME[5], told(), COME[2])
    admitted = admit(world, [Undo(), Undo()])
    assert [event.type for event in admitted.events] == [
        "commanded",
        "priority_changed",
        "commanded",
        "robot_resumed",
    ]


def test_a_failure_cannot_be_undone() -> None:
    with pytest.raises(BadInput, match="a robot that failed stays out"):
        admit(live(told(), RobotFailed(t=0.0, robot="r1")), [Undo()])


def test_undoing_a_task_that_was_picked_up_meanwhile_cancels_it_aboard() -> None:
    task = delivery("n", (2, 2), (3, 3))
    picked = StopServed(t=1.0, robot="r1", task="n", stop="pickup", at=(2, 2))
    assert effect(Undo(), told(), TaskAdded(t=0.0, task=task), picked) == [
        TaskCancelled(t=1.0, task="n")
    ]


def test_undoing_what_was_done_meanwhile_is_refused() -> None:
    served = StopServed(t=1.0, robot="r1", task="n", stop="visit", at=(3, 3))
    with pytest.raises(BadInput, match="task n is done already"):
        admit(live(told(), COME[0], served), [Undo()])


def test_a_cancelled_task_that_is_still_aboard_does_not_come_back() -> None:
    with pytest.raises(BadInput, match="r1 has a task a aboard, which was cancelled"):
        admit(live(PICKED, told(), TaskCancelled(t=1.0, task="a")), [Undo()])


# --- Reading


@pytest.mark.parametrize(
    ("value", "field", "what"),
    [
        (None, "intent", "must be a mapping"),
        ({}, "intent", "must be a mapping"),
        ({"intent": 3}, "intent", "must be a mapping"),
        ({"intent": "ad_task"}, "intent", "did you mean 'add_task'"),
        ({"intent": "undo", "more": 1}, "more", "unknown key"),
        ({"intent": "undo", "parameters": 3}, "parameters", "must be a mapping"),
        ({"intent": "undo", "parameters": {"x": 1}}, "x", "unknown parameter"),
        ({"intent": "cancel_task"}, "task_label", "is missing"),
        ({"intent": "cancel_task", "parameters": {"task_lable": "a"}}, "task_label", "missing"),
        ({"intent": "cancel_task", "parameters": {"task_label": ""}}, "task_label", "1 character"),
        ({"intent": "cancel_task", "parameters": {"task_label": "x" * 65}}, "task_label", "64"),
        (
            {"intent": "change_task_priority", "parameters": {"task_label": "a", "priority": "!"}},
            "priority",
            "'low', 'normal' or 'high'",
        ),
    ],
    ids=str,
)
def test_what_cannot_be_read_is_refused(value: object, field: str, what: str) -> None:
    with pytest.raises(BadInput, match=what) as caught:
        parse(value)
    assert caught.value.field == field
    assert caught.value.remedy


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e7, "x", None, [1]])
def test_coordinates_are_finite_numbers(number: object) -> None:
    for parameters in (
        {"location": [number, 1], "delivery_point": "Dock"},
        {"location": [1, 1], "delivery_point": [1, number]},
        {"location": [1], "delivery_point": "Dock"},
    ):
        with pytest.raises(BadInput):
            parse({"intent": "add_task", "parameters": parameters})
    with pytest.raises(BadInput):
        value = {"obstacle_location": [[0, number], [1, 1]]}
        parse({"intent": "obstacle_update", "parameters": value})


NAMES = st.text(string.ascii_letters + "_-.", min_size=1, max_size=64)
NUMBERS = st.floats(-1e6, 1e6, allow_nan=False) | st.integers(-1000, 1000)
POINTS = st.lists(NUMBERS, min_size=2, max_size=2)


def values(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> st.SearchStrategy[Any]:
    """Return what a part of our schema allows; only what the commands' schema uses is known."""
    makers: dict[str, Callable[[], st.SearchStrategy[Any]]] = {
        "string": lambda: NAMES,
        "number": lambda: st.floats(schema["minimum"], schema["maximum"]),
        "null": st.none,
        "array": lambda: (
            st.tuples(*(values(item, definitions) for item in schema["prefixItems"])).map(list)
            if "prefixItems" in schema
            else st.lists(
                values(schema["items"], definitions), min_size=schema["minItems"], max_size=5
            )
        ),
        "object": lambda: st.fixed_dictionaries(
            {k: values(schema["properties"][k], definitions) for k in schema.get("required", [])},
            optional={
                k: values(v, definitions)
                for k, v in schema["properties"].items()
                if k not in schema.get("required", [])
            },
        ),
    }
    if "const" in schema:
        return st.just(schema["const"])
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    if "anyOf" in schema:
        return st.one_of([values(part, definitions) for part in schema["anyOf"]])
    return makers[schema["type"]]()


ANY = st.sampled_from(schema()["oneOf"]).flatmap(lambda choice: values(choice, {}))


@settings(max_examples=300, deadline=None)
@given(ANY)
def test_everything_that_the_schema_allows_is_read_and_written_back(value: dict[str, Any]) -> None:
    command = parse(value)
    plain = to_plain(command)
    assert parse(json.loads(json.dumps(plain))) == command
    assert plain["intent"] == value["intent"]


def test_the_schema_names_every_command_and_says_what_its_parameters_are() -> None:
    choices = schema()["oneOf"]
    assert [choice["title"] for choice in choices] == list(COMMANDS)
    for choice in choices:
        assert choice["description"]
        parameters = choice["properties"]["parameters"]
        assert parameters["additionalProperties"] is False
        assert all(one.get("description") for one in parameters["properties"].values()), choice


def test_only_what_makes_things_safer_or_changes_nothing_needs_no_confirmation() -> None:
    at_once = {intent for intent, command in COMMANDS.items() if command.immediate}
    assert at_once == {"pause_robot", "query_status"}
