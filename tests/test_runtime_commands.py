"""Commands to running missions: small yards where the right answer is obvious, and random ones."""

from __future__ import annotations

import random
from collections.abc import Sequence
from concurrent.futures import Executor, Future
from math import dist
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missions import box, cell, delivery, missions, random_mission, robot, visit, yard
from oath.allocate import Budget
from oath.allocate import allocator as named
from oath.commands import (
    AddTask,
    CancelTask,
    ChangeTaskPriority,
    Command,
    ObstacleUpdate,
    PauseRobot,
    RemoveObstacle,
    ResumeRobot,
    RobotFailure,
    Undo,
)
from oath.errors import BadInput
from oath.events import (
    Allocated,
    AnyEvent,
    Moved,
    ObstacleAdded,
    Planned,
    RobotPaused,
    StopServed,
    TaskAdded,
)
from oath.fleet.sim import SimFleet
from oath.model import Mission, Point
from oath.runtime import Result, Runtime
from oath.scene import prepare, unreachable
from oath.verify import verify
from oath.world.roadmap import Params
from operators import Operator

BOTH = pytest.mark.parametrize("allocator", ["lns", "oath"])
"""One that reconsiders routes under way, one that does not."""


class Late(Future[Any]):
    """An answer that is there only when it was asked for some times."""

    def __init__(self, answer: Any, asked: int) -> None:
        super().__init__()
        self.set_result(answer)
        self.left = asked

    def done(self) -> bool:
        self.left -= 1
        return self.left < 0


class Slow(Executor):
    """Works everything out at once but answers late, the same for the same seed."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)

    def submit(self, work: Any, /, *args: Any, **kwargs: Any) -> Late:
        return Late(work(*args, **kwargs), self.rng.randrange(9))


def ready(
    mission: Mission,
    allocator: str = "lns",
    *,
    points: int = 200,
    seed: int = 0,
    solver: Executor | None = None,
) -> Runtime:
    return Runtime(
        prepare(mission, Params(points=points), seed),
        SimFleet(mission),
        name=allocator,
        allocator=named(allocator),
        budget=Budget(iterations=200),
        seed=seed,
        solver=solver,
    )


Script = Sequence[tuple[float, Command]]


def play(mission: Mission, script: Script, allocator: str = "lns", **options: Any) -> Result:
    """Run a mission, ask for things meanwhile, and have the run judged."""
    runtime = ready(mission, allocator, **options)

    def ask(command: Command) -> None:
        runtime.command([command], "operator")

    result = runtime.run([(t, lambda c=command: ask(c)) for t, command in script])  # type: ignore[misc]
    verdict = verify(mission, result.events)
    assert verdict.ok, "\n".join(map(str, verdict.violations))
    assert all(result.summary["unserved"].values())
    return result


def of(kind: type[Any], events: Sequence[AnyEvent], robot: str | None = None) -> list[Any]:
    found = [event for event in events if isinstance(event, kind)]
    return [event for event in found if robot is None or event.robot == robot]


def stops(result: Result, robot: str | None = None) -> list[str]:
    """Return what was served in order: ``+a`` picked a up, ``-a`` delivered it, ``a`` visited."""
    signs = {"pickup": "+", "delivery": "-", "visit": ""}
    return [signs[e.stop] + e.task for e in of(StopServed, result.events, robot)]


def add(label: str, at: Point, to: Point, **more: Any) -> AddTask:
    return AddTask(location=at, delivery_point=to, task_label=label, task_type="carry", **more)


def urgent(label: str) -> ChangeTaskPriority:
    return ChangeTaskPriority(task_label=label, priority="high")


# --- What is urgent -------------------------------------------------------------------------


@BOTH
def test_what_becomes_urgent_is_next_though_the_robot_is_on_its_way_elsewhere(
    allocator: str,
) -> None:
    mission = yard([robot("r", (5, 5))], [visit("a", (8, 5)), visit("b", (1, 5))])
    assert stops(play(mission, [], allocator)) == ["a", "b"]
    assert stops(play(mission, [(1.0, urgent("b"))], allocator)) == ["b", "a"]


@BOTH
def test_a_robot_turns_at_the_end_of_its_move(allocator: str) -> None:
    walls = (((5.0, 0.0), (5.0, 6.0)),)  # the way to a leads round it, over a corner node
    mission = yard([robot("r", (4, 5))], [visit("a", (6, 5)), visit("b", (1, 1))], walls=walls)
    result = play(mission, [(1.0, urgent("b"))], allocator)
    moves = of(Moved, result.events)
    under_way = next(move for move in moves if move.start < 1.0 <= move.end)
    assert under_way.to[1] < 6.5
    assert stops(result) == ["b", "a"]
    # No other move of the old plan is driven.
    onwards = moves[moves.index(under_way) + 1 :]
    assert dist(onwards[0].to, (1, 1)) < dist(onwards[0].from_, (1, 1))


@BOTH
def test_the_capable_robot_that_can_do_it_first_goes_though_it_must_leave_other_work(
    allocator: str,
) -> None:
    inspects = {"inspect": 1.0}
    robots = [robot("near", (4, 5)), robot("far", (9, 1)), robot("unable", (5, 9), can=inspects)]
    tasks = [visit("a", (4, 3)), visit("b", (9, 2)), visit("u", (4, 9)), visit("c", (9, 3))]
    result = play(yard(robots, tasks), [(0.5, urgent("u"))], allocator)
    assert stops(result, "near")[0] == "u"
    assert result.summary["unserved"] == {}


@BOTH
def test_a_new_urgent_task_is_next(allocator: str) -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (9, 5)), visit("b", (9, 9))])
    command = add("u", (1, 9), (3, 9), priority="high")
    assert stops(play(mission, [(1.0, command)], allocator))[:2] == ["+u", "-u"]


@BOTH
def test_who_is_at_work_finishes_that_first(allocator: str) -> None:
    tasks = [visit("a", (3, 5), service_time=10.0), visit("b", (9, 5)), visit("u", (3, 9))]
    mission = yard([robot("r", (1, 5))], tasks)
    result = play(mission, [(5.0, urgent("u"))], allocator)
    assert stops(result) == ["a", "u", "b"]
    first = of(StopServed, result.events)[0]
    assert first.t == pytest.approx(2.0 + 10.0, abs=0.1), "the work was begun anew"


@BOTH
def test_an_obstacle_elsewhere_and_its_removal_leave_who_is_at_work_alone(allocator: str) -> None:
    tasks = [visit("a", (3, 5), service_time=10.0), visit("b", (9, 5))]
    mission = yard([robot("r", (1, 5))], tasks)
    script = [
        (4.0, ObstacleUpdate(obstacle_location=[(6, 3), (6, 7)])),  # on the way to b
        (8.0, RemoveObstacle(obstacle="wall-1")),
    ]
    result = play(mission, script, allocator)
    assert [e.t for e in of(StopServed, result.events)] == pytest.approx([12.0, 18.0], abs=0.1)


@BOTH
def test_a_full_robot_unloads_first_and_then_goes_to_what_is_urgent(allocator: str) -> None:
    tasks = [delivery("a", (1, 5), (5, 5)), visit("x", (5.5, 5)), delivery("u", (5, 9), (1, 9))]
    mission = yard([robot("r", (1, 5), capacity=1)], tasks)
    result = play(mission, [(1.0, urgent("u"))], allocator)
    assert stops(result) == ["+a", "-a", "+u", "-u", "x"]


@BOTH
def test_of_a_full_and_a_free_robot_the_sooner_one_goes(allocator: str) -> None:
    robots = [robot("full", (1, 5), capacity=1), robot("free", (9, 5), speed=0.2)]
    tasks = [delivery("a", (1, 5), (3, 5)), visit("x", (9, 1)), delivery("u", (3, 9), (1, 9))]
    result = play(yard(robots, tasks), [(1.0, urgent("u"))], allocator)
    assert stops(result, "full")[:4] == ["+a", "-a", "+u", "-u"]


@BOTH
def test_several_urgent_tasks_come_before_everything_else(allocator: str) -> None:
    robots = [robot("west", (1, 5)), robot("east", (9, 5))]
    tasks = [visit(f"t{i}", (2 + i, 9)) for i in range(6)]
    tasks += [visit("u", (1, 1)), visit("v", (9, 1)), visit("w", (8, 1))]
    script = [(0.5, urgent("u")), (0.5, urgent("v")), (0.5, urgent("w"))]
    result = play(yard(robots, tasks), script, allocator)
    for one in ("west", "east"):
        mine = [task[0] for task in stops(result, one)]
        assert "t" not in mine[: len(set(mine) - {"t"})]
    assert result.summary["unserved"] == {}


@BOTH
def test_of_equally_soon_robots_the_one_that_has_the_task_keeps_it(allocator: str) -> None:
    robots = [robot("one", (1, 4)), robot("other", (9, 4))]
    mission = yard(robots, [visit("u", (5, 4)), visit("x", (5, 8))])
    runtime = ready(mission, allocator, points=5)
    runtime.start()
    holder = next(id for id, r in runtime.state.robots.items() if r.route[0].task == "u")
    runtime.advance(0.5)
    runtime.command([urgent("u")], "operator")
    assert runtime.state.robots[holder].route[0].task == "u"
    assert [plan.robot for plan in of(Planned, runtime.events) if plan.t > 0] == []


@BOTH
def test_a_paused_robot_loses_what_is_urgent_and_nothing_else(allocator: str) -> None:
    robots = [robot("r1", (1, 5)), robot("r2", (9, 9))]
    tasks = [visit("u", (3, 5), priority="high"), visit("a", (4, 5)), visit("b", (9, 8))]
    result = play(yard(robots, tasks), [(1.0, PauseRobot(robot="r1"))], allocator)
    assert "u" in stops(result, "r2")
    assert stops(result, "r1") == []
    assert result.summary["unserved"].keys() <= {"a"}


def test_what_only_a_paused_robot_can_do_waits_for_it() -> None:
    robots = [robot("r1", (1, 5)), robot("r2", (9, 9), can={"inspect": 1.0})]
    mission = yard(robots, [visit("u", (3, 5), priority="high")])
    result = play(mission, [(1.0, PauseRobot(robot="r1"))])
    assert result.summary["unserved"] == {"u": "given to r1, which is paused"}
    script = [(1.0, PauseRobot(robot="r1")), (5.0, ResumeRobot(robot="r1"))]
    assert stops(play(mission, script)) == ["u"]


@BOTH
def test_a_task_that_came_while_all_were_paused_is_taken_up_when_one_goes_on(
    allocator: str,
) -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (9, 5))])
    script: Script = [
        (1.0, PauseRobot(robot="all")),
        (2.0, add("u", (1, 9), (3, 9), priority="high")),
        (3.0, ResumeRobot(robot="r")),
    ]
    assert stops(play(mission, script, allocator)) == ["+u", "-u", "a"]
    left = play(mission, script[:2], allocator).summary["unserved"]
    assert left["a"] == "given to r, which is paused"
    assert left["u"].endswith("(paused: r)")


@BOTH
def test_what_is_low_comes_last(allocator: str) -> None:
    mission = yard(
        [robot("r", (1, 5))], [visit("a", (2, 5)), visit("b", (5, 5)), visit("c", (9, 5))]
    )
    low = ChangeTaskPriority(task_label="b", priority="low")
    assert stops(play(mission, [(0.5, low)], allocator))[-1] == "b"


# --- Holding, failing -----------------------------------------------------------------------


@BOTH
def test_a_paused_robot_stands_at_once_and_goes_on_from_there(allocator: str) -> None:
    mission = yard([robot("r", (1, 5), speed=2.0)], [visit("a", (9, 5))])
    script = [(1.25, PauseRobot(robot="r")), (6.0, ResumeRobot(robot="r"))]
    result = play(mission, script, allocator, points=5)
    kinds = [event.type for event in result.events]
    # Where it came to rest stands in the log before why.
    assert kinds[kinds.index("commanded") - 1] == "moved"
    held = of(RobotPaused, result.events)[0]
    last = [move for move in of(Moved, result.events) if move.end <= held.t][-1]
    assert last.to == pytest.approx((3.5, 5.0), abs=1e-6)
    assert of(StopServed, result.events)[0].t == pytest.approx(6.0 + 5.5 / 2, abs=1e-3)
    assert result.summary["total_distance"] == pytest.approx(8.0, abs=1e-3)


def test_work_that_a_pause_interrupts_is_done_anew() -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (3, 5), service_time=4.0)])
    script = [(4.0, PauseRobot(robot="r")), (10.0, ResumeRobot(robot="r"))]
    assert of(StopServed, play(mission, script).events)[0].t == pytest.approx(14.0)


@BOTH
def test_what_a_failed_robot_carried_is_fetched_where_it_stopped(allocator: str) -> None:
    robots = [robot("r1", (1, 5)), robot("r2", (9, 1))]
    mission = yard(robots, [delivery("a", (1, 5), (9, 5)), visit("b", (9, 2))])
    result = play(mission, [(3.0, RobotFailure(robot="r1"))], allocator, points=5)
    first, again = (e for e in of(StopServed, result.events) if e.stop == "pickup")
    assert (first.robot, again.robot) == ("r1", "r2")
    assert again.at == pytest.approx((4.0, 5.0), abs=1e-6)
    assert result.summary["unserved"] == {}


def test_a_failure_takes_one_round() -> None:
    robots = [robot("r1", (1, 5), capacity=2), robot("r2", (9, 1))]
    tasks = [delivery("a", (1, 5), (9, 5)), delivery("b", (1, 5), (9, 9)), visit("c", (9, 2))]
    runtime = ready(yard(robots, tasks))
    runtime.start()
    runtime.advance(2.0)
    before = len(of(Allocated, runtime.events))
    runtime.command([RobotFailure(robot="r1")], "operator")
    assert len(of(Allocated, runtime.events)) == before + 1


def test_who_carries_what_was_cancelled_keeps_it_aboard_and_has_less_room() -> None:
    mission = yard(
        [robot("r", (1, 5), capacity=1)],
        [delivery("a", (1, 5), (9, 5)), delivery("b", (5, 5), (1, 1)), visit("c", (5, 1))],
    )
    result = play(mission, [(1.0, CancelTask(task_label="a"))])
    assert stops(result) == ["+a", "c"]
    assert result.summary["tasks"] == 2
    assert result.summary["unserved"] == {"b": "no room: the robots that could take it are full"}


@BOTH
def test_a_cancelled_task_is_left_at_once(allocator: str) -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (9, 5)), visit("b", (1, 9))])
    script = [(2.0, CancelTask(task_label="a"))]
    result = play(mission, script, allocator, points=5)
    assert "a" not in stops(result)
    assert result.summary["tasks"] == 1


# --- Obstacles ------------------------------------------------------------------------------


@BOTH
def test_a_wall_across_the_way_stops_the_robot_mid_edge_and_it_turns(allocator: str) -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (9, 5))])
    wall = ObstacleUpdate(obstacle_location=[(4, 3), (4, 7)])
    result = play(mission, [(1.5, wall)], allocator, points=5)
    told = of(ObstacleAdded, result.events)[0]
    here = [move for move in of(Moved, result.events) if move.end <= told.t][-1]
    assert here.to == pytest.approx((2.5, 5.0), abs=1e-6)
    (repaired,) = [plan for plan in of(Planned, result.events) if plan.reason == "obstacle"]
    length = dist((2.5, 5), (4, 7.2)) + dist((4, 7.2), (9, 5))
    assert repaired.length == pytest.approx(length, rel=0.05)


def count_rounds(mission: Mission, wall: ObstacleUpdate) -> int:
    runtime = ready(mission)
    runtime.start()
    runtime.advance(1.0)
    before = len(of(Allocated, runtime.events))
    runtime.command([wall], "operator")
    assert [e for e in runtime.events if isinstance(e, Planned) and e.reason == "obstacle"]
    return len(of(Allocated, runtime.events)) - before


def test_an_assignment_is_reconsidered_only_if_a_way_grows_by_more_than_a_twentieth() -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (9, 5))])
    assert count_rounds(mission, ObstacleUpdate(obstacle_location=[(5, 4.9), (5, 5.1)])) == 0
    assert count_rounds(mission, ObstacleUpdate(obstacle_location=[(5, 2), (5, 8)])) == 1


@BOTH
def test_when_an_obstacle_goes_the_way_is_short_again(allocator: str) -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (9, 5))])
    wall = ObstacleUpdate(obstacle_location=[(7, 1), (7, 9)])
    script: Script = [(1.0, wall), (1.1, RemoveObstacle(obstacle="wall-1"))]
    result = play(mission, script, allocator, points=300)
    assert result.summary["total_distance"] < 8.5
    assert play(mission, script[:1], allocator).summary["total_distance"] > 10


def test_what_was_out_of_reach_is_done_when_the_door_opens() -> None:
    mission = cell(
        [robot("r", (2, 5))], [visit("in", (9, 5)), visit("out", (2, 8), service_time=60)]
    )
    runtime = ready(mission)
    runtime.start()
    door = ObstacleUpdate(obstacle_location=list(box(6.9, 3.9, 7.1, 6.1)))
    with pytest.raises(BadInput, match="shut in task in"):
        runtime.command([door], "operator")
    runtime.command([CancelTask(task_label="in"), door], "operator")
    with pytest.raises(BadInput, match="out of reach"):
        runtime.command([add("in", (9, 5), (9, 6))], "operator")
    runtime.command([RemoveObstacle(obstacle="wall-1"), add("in", (9, 5), (9, 6))], "operator")
    runtime.advance()
    assert runtime.finish().summary["unserved"] == {}


# --- All or none, and taking back -----------------------------------------------------------


def test_of_several_commands_all_happen_or_none() -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (9, 5))])
    runtime = ready(mission)
    runtime.start()
    runtime.advance(1.5)
    before = (runtime.state, len(runtime.events))
    with pytest.raises(BadInput, match="no task 'zz'"):
        runtime.command([PauseRobot(robot="r"), CancelTask(task_label="zz")], "operator")
    assert (runtime.state, len(runtime.events)) == before
    runtime.advance()
    assert stops(runtime.finish()) == ["a"], "the robot stands though nothing happened"


def test_what_comes_and_goes_in_one_breath_leaves_no_trace() -> None:
    mission = yard([robot("r", (1, 5))], [visit("a", (9, 5))])
    runtime = ready(mission)
    runtime.start()
    wall = ObstacleUpdate(obstacle_location=[(4, 3), (4, 7)])
    runtime.command([wall, Undo()], "operator")
    assert not runtime.state.obstacles and not runtime.scene.world.roadmap.workspace.obstacles
    runtime.advance()
    assert runtime.finish().summary["total_distance"] == pytest.approx(8.0, abs=1e-3)


def test_undo_takes_back_one_command_after_the_other() -> None:
    mission = yard([robot("r", (5, 5))], [visit("a", (8, 5)), visit("b", (1, 5))])
    script: Script = [
        (1.0, add("n", (2, 2), (3, 3))),
        (1.5, urgent("b")),
        (2.0, Undo()),
        (2.5, Undo()),
    ]
    result = play(mission, script)
    assert set(stops(result)) == {"a", "b"}
    assert result.summary["tasks"] == 2


# --- Laws -----------------------------------------------------------------------------------


def check_operated(
    mission: Mission, seed: int, allocator: str, count: int, solver: Executor | None = None
) -> None:
    """Whatever is asked of a mission, its run is judged good and every task has an end."""
    runtime = ready(mission, allocator, points=80, seed=seed, solver=solver)
    if unreachable(runtime.scene):
        return
    operator = Operator(seed, count)
    result = runtime.run([(t, lambda: operator.act(runtime)) for t in operator.times])
    for violation in verify(mission, result.events).violations:
        assert violation.rule == "mission_rule", violation
        assert "still not fulfilled" in violation.message, violation
    summary = result.summary
    assert summary["completed"] + len(summary["unserved"]) == summary["tasks"]
    reasons = summary["unserved"].values()
    assert all(why and why not in ("not finished", "waits for a robot") for why in reasons), reasons


@settings(max_examples=60, deadline=None)
@given(missions(), st.integers(0, 2**32 - 1), st.sampled_from(["lns", "oath"]), st.integers(1, 9))
def test_random_commands_to_random_missions(
    mission: Mission, seed: int, allocator: str, count: int
) -> None:
    check_operated(mission, seed, allocator, count)


@settings(max_examples=25, deadline=None)
@given(missions(), st.integers(0, 2**32 - 1), st.sampled_from(["greedy", "kam", "kan", "cbba"]))
def test_random_commands_whoever_allocates(mission: Mission, seed: int, allocator: str) -> None:
    check_operated(mission, seed, allocator, 4)


@pytest.mark.slow
@pytest.mark.parametrize("allocator", ["lns", "oath"])
def test_many_random_commands(allocator: str) -> None:
    for seed in range(200):
        check_operated(random_mission(seed), seed, allocator, 1 + seed % 12)


@pytest.mark.parametrize(
    ("seed", "allocator"),
    [
        (6, "oath"),  # a robot took up what it had found to be impossible
        (107, "lns"),  # an obstacle that came and went in one breath
    ],
)
def test_commands_that_went_wrong_once(seed: int, allocator: str) -> None:
    check_operated(random_mission(seed), seed, allocator, seed % 9 + 1)


@settings(max_examples=25, deadline=None)
@given(missions(), st.integers(0, 2**32 - 1), st.floats(0, 20))
def test_a_mission_goes_on_from_its_events(mission: Mission, seed: int, until: float) -> None:
    first = ready(mission, points=80)
    if unreachable(first.scene):
        return
    operator = Operator(seed, 5, until)
    first.start()
    for t in operator.times:
        first.advance(t)
        operator.act(first)
    first.advance(until)
    again = ready(mission, points=80)
    positions = {id: robot.position for id, robot in first.state.robots.items()}
    found = [e.obstacle for e in first.events if e.type == "obstacle_found"]
    again._fleet = SimFleet(mission, now=first.now, positions=positions, found=found)
    again.resume(list(first.events))
    again.advance()
    result = again.finish()
    for violation in verify(mission, result.events).violations:
        assert violation.rule == "mission_rule", violation
    assert all(result.summary["unserved"].values())
    assert len(of(TaskAdded, result.events)) == len(of(TaskAdded, first.events))
