"""The one gate to the live world: whether what a command would do is possible and safe."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from oath.commands.command import Command, Live, show_point
from oath.dispatch import advance
from oath.errors import BadInput, did_you_mean
from oath.events import (
    AnyEvent,
    Commanded,
    ObstacleAdded,
    ObstacleRemoved,
    PriorityChanged,
    RobotFailed,
    RobotPaused,
    RobotResumed,
    TaskAdded,
    TaskCancelled,
)
from oath.model import Obstacle, Point, Robot, Stop, Task

LABEL = 64
"""Longest name of anything [characters]."""


@dataclass(frozen=True, slots=True)
class Admitted:
    """What commands come to in the live world.

    Attributes
    ----------
    commands
        As they were filled.
    says
        Each in plain words.
    events
        What carries all of them out, each after its `Commanded`.
    """

    commands: tuple[Command, ...]
    says: tuple[str, ...]
    events: tuple[AnyEvent, ...]


def admit(live: Live, commands: Sequence[Command], source: str = "operator") -> Admitted:
    """Let commands through to the live world, each to the world of those before it.

    Raises
    ------
    BadInput
        If one of them is not possible in the live world: what, why and what to do.
    """
    with Trial(live) as trial:
        return trial.admit(commands, source)


class Trial:
    """The live world and what commands make of it; all is as it was when the trial ends."""

    def __init__(self, live: Live) -> None:
        self.live = live
        self._roadmap = live.scene.world.roadmap
        self._kept = self._roadmap.trial()

    def __enter__(self) -> Trial:
        self._kept.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._kept.__exit__(None, None, None)

    def admit(self, commands: Sequence[Command], source: str = "operator") -> Admitted:
        """Let commands happen in the trial, see `admit`."""
        filled: list[Command] = []
        says: list[str] = []
        done: list[AnyEvent] = []
        for command in commands:
            filled.append(command.filled(self.live))
            events = filled[-1].events(self.live)
            says.append(filled[-1].says(self.live))
            if events:
                if self.live.state.finished:
                    raise BadInput("the mission has ended", remedy="start it again")
                plain = {
                    "intent": command.intent,
                    "parameters": filled[-1].model_dump(mode="json", exclude_none=True),
                }
                told = Commanded(t=self.live.state.t, command=plain, source=source)
                self.happen(told)
                for event in events:
                    self.check(event)
                    self.happen(event)
                done += [told, *events]
        return Admitted(tuple(filled), tuple(says), tuple(done))

    def happen(self, event: AnyEvent) -> None:
        """Let an event have happened."""
        state, _ = advance(self.live.state, event)
        self.live = replace(self.live, state=state)

    def check(self, event: AnyEvent) -> None:
        """Refuse what is not possible."""
        state = self.live.state
        match event:
            case TaskAdded(task=task):
                self._check_task(task)
            case TaskCancelled(task=id) | PriorityChanged(task=id):
                self._check_open(id, cancelling=isinstance(event, TaskCancelled))
            case ObstacleAdded():
                self._check_obstacle(event)
            case ObstacleRemoved(obstacle=id):
                if id not in state.obstacles:
                    raise BadInput(
                        f"there is no obstacle {id!r} any more",
                        field="obstacle",
                        remedy=did_you_mean(id, list(state.obstacles)),
                    )
                self._roadmap.remove_obstacle(id)
            case RobotPaused(robot=robot) | RobotResumed(robot=robot) | RobotFailed(robot=robot):
                self._check_robot(event, robot)
            case _:
                pass

    # -- tasks

    def _check_task(self, task: Task) -> None:
        self._check_label(task.id)
        mission = self.live.scene.mission
        able = [robot for robot in self._working() if robot.can.get(task.type, 0.0) > 0]
        if not able:
            known = sorted({type for robot in self._working() for type in robot.can})
            raise BadInput(
                f"no robot that works can do the type {task.type!r}",
                field="task_type",
                remedy=f"give it one of: {', '.join(known) or '(none)'}",
            )
        fields = {"pickup": "location", "visit": "location", "delivery": "delivery_point"}
        for stop in task.stops:
            field = fields[stop.name]
            _inside(stop.at, mission.map.bounds, field)
            fits = [robot for robot in able if self._clearance(stop.at, robot) >= robot.radius]
            if not fits:
                widest = max(self._clearance(stop.at, robot) for robot in able)
                need = min(robot.radius for robot in able)
                raise BadInput(
                    f"{stop.name} {show_point(stop.at)} is {widest:.2f} m from what blocks the "
                    f"way, a robot that can do it needs {need:g} m",
                    field=field,
                    remedy="give a point in the open",
                )
            able = fits
        reach = Reach(self.live)
        points = [stop.at for stop in task.stops]
        if not any(reach.all(robot, points) for robot in able):
            names = ", ".join(robot.id for robot in able)
            raise BadInput(
                f"{' or '.join(map(show_point, points))} is out of reach of {names}",
                field="location",
                remedy="give a point that the robot can drive to",
            )

    def _check_label(self, label: str) -> None:
        live, mission = self.live, self.live.scene.mission
        plain = label and len(label) <= LABEL and all(c.isalnum() or c in "_-." for c in label)
        if not plain:
            raise BadInput(
                f"{label[:40]!r} cannot be a label",
                field="task_label",
                remedy=f"use letters, digits, '_', '-' and '.', at most {LABEL} of them",
            )
        carrier = live.state.carrier(label)
        taken = (
            f"task {label} exists already"
            if label in live.state.tasks
            else f"{carrier} has a task {label} aboard, which was cancelled"
            if carrier
            else f"{label} is the name of something else"
            if label in mission.places or label in mission.zones
            else None
        )
        if taken:
            raise BadInput(
                taken, field="task_label", remedy="choose another label, or leave it out"
            )

    def _check_open(self, id: str, *, cancelling: bool) -> None:
        state = self.live.state
        if id not in state.tasks:
            raise BadInput(
                f"there is no task {id!r} any more",
                field="task_label",
                remedy=did_you_mean(id, list(state.tasks)),
            )
        if id in state.completed:
            raise BadInput(f"task {id} is done already", field="task_label", remedy="name another")
        carrier = state.carrier(id)
        if carrier and not cancelling:
            raise BadInput(
                f"{carrier} carries task {id} already, so its turn has come",
                field="task_label",
                remedy="name a task that nobody has picked up",
            )

    # -- obstacles

    def _check_obstacle(self, event: ObstacleAdded) -> None:
        live, mission = self.live, self.live.scene.mission
        if event.obstacle in live.state.obstacles:
            raise BadInput(
                f"there is an obstacle {event.obstacle!r} already", remedy="remove it first"
            )
        for corner in event.polygon:
            if not all(map(math.isfinite, corner)):
                raise BadInput("a corner is no number", field="obstacle_location", remedy="fix it")
        polygon = shapely.Polygon(event.polygon)
        if not polygon.is_valid or polygon.area < 1e-6:
            raise BadInput(
                "the corners make no simple polygon: sides cross, or it has no area",
                field="obstacle_location",
                remedy="give the corners in order around it",
            )
        bounds = shapely.box(*mission.map.bounds)
        if not bounds.buffer(1e-9).covers(polygon):
            raise BadInput(
                f"the obstacle reaches out of the map {list(mission.map.bounds)}",
                field="obstacle_location",
                remedy="keep it inside",
            )
        self._check_covered(event.kind, polygon)
        obstacle = Obstacle(id=event.obstacle, kind=event.kind, polygon=event.polygon)
        self._roadmap.add_obstacle(obstacle)
        if shut_in := self._shut_in():
            self._roadmap.remove_obstacle(obstacle.id)
            shut_in -= self._shut_in()  # what was so before is not its fault
            self._roadmap.add_obstacle(obstacle)
        for what in sorted(shut_in):
            raise BadInput(
                f"the obstacle would shut in {what}",
                field="obstacle_location",
                remedy="check the coordinates, or cancel the task or count out the robot first",
            )

    def _check_covered(self, kind: str, polygon: shapely.Polygon) -> None:
        """Refuse what covers a robot, or a stop for all who could serve it."""
        occupied = list(self._occupied())
        gaps = shapely.distance(polygon, shapely.points([at for _, at, _ in occupied]))
        motions = self.live.scene.mission.motions
        for (what, at, robots), gap in zip(occupied, gaps.tolist(), strict=True):
            blocked = [motions[robot.motion].blocked_by(kind) for robot in robots]
            if all(b and gap < r.radius for b, r in zip(blocked, robots, strict=True)):
                raise BadInput(
                    f"the obstacle would cover {what} at {show_point(at)}",
                    field="obstacle_location",
                    remedy="check the coordinates, or cancel the task first",
                )

    def _occupied(self) -> Iterator[tuple[str, Point, list[Robot]]]:
        """Robots and open stops: what, where, and for whom it must stay free."""
        for robot in self.live.scene.mission.robots:
            yield robot.id, self.live.pose(robot.id), [robot]
        for task, stops, able in self._open():
            for stop in stops if able else ():
                yield f"the {stop.name} of task {task.id}", stop.at, able

    def _open(self) -> Iterator[tuple[Task, tuple[Stop, ...], list[Robot]]]:
        """Tasks that are not done, which of their stops are left, and who can serve those."""
        state = self.live.state
        for id, task in state.tasks.items():
            if id in state.completed or id in state.stranded:
                continue
            carrier = state.carrier(id)
            able = [r for r in self._working() if r.can.get(task.type, 0.0) > 0]
            if carrier:
                yield task, task.stops[-1:], [self.live.scene.mission.robot(carrier)]
            else:
                yield task, task.stops, able

    def _shut_in(self) -> set[str]:
        """Open tasks that nobody can do any more, and robots that can go nowhere."""
        reach = Reach(self.live)
        found, places = set(), list(self.live.scene.mission.places.values())
        for task, stops, able in self._open():
            points = [stop.at for stop in stops]
            places += points
            if able and not any(reach.all(robot, points) for robot in able):
                found.add(f"task {task.id}")
        for robot in self._working():
            if places and not any(reach.all(robot, [at]) for at in places):
                found.add(robot.id)
        return found

    # -- robots

    def _check_robot(self, event: AnyEvent, robot: str) -> None:
        state = self.live.state
        if robot in state.failed:
            problem = f"{robot} has failed"
        elif isinstance(event, RobotPaused) and robot in state.paused:
            problem = f"{robot} is paused already"
        elif isinstance(event, RobotResumed) and robot not in state.paused:
            problem = f"{robot} is not paused"
        else:
            return
        raise BadInput(problem, field="robot", remedy="nothing is to be done")

    # -- the world

    def _working(self) -> list[Robot]:
        failed = self.live.state.failed
        return [robot for robot in self.live.scene.mission.robots if robot.id not in failed]

    def _clearance(self, at: Point, robot: Robot) -> float:
        mission, world = self.live.scene.mission, self.live.scene.world
        motion = mission.motions[robot.motion]
        limit = 10 * robot.radius
        points = np.array([at], dtype=float)
        return float(world.roadmap.workspace.clearance(points, motion, limit)[0])


class Reach:
    """Who can drive where in a live world, as long as it stays as it is."""

    def __init__(self, live: Live) -> None:
        self._live = live
        self._parts: dict[int, list[int]] = {}
        """Part of the roadmap by node, for every mode."""
        self._around: dict[tuple[Point, int], set[int]] = {}

    def all(self, robot: Robot, points: Sequence[Point]) -> bool:
        """Whether a robot can drive from where it is to all of these points [m]."""
        mode = self._live.scene.world.mode_of[robot.id]
        here = self._at(self._live.pose(robot.id), mode)
        return bool(here.intersection(*(self._at(at, mode) for at in points)))

    def _at(self, at: Point, mode: int) -> set[int]:
        """The parts of the roadmap that a robot at a point [m] can drive to."""
        if (at, mode) not in self._around:
            roadmap, avoid = self._live.scene.world.roadmap, self._live.scene.rules.avoid
            nodes = roadmap.near(at, mode, avoid)
            if mode not in self._parts:
                self._parts[mode] = roadmap.components(mode, avoid).tolist()
            self._around[at, mode] = {self._parts[mode][node] for node in nodes}
        return self._around[at, mode]


def _inside(at: Point, bounds: tuple[float, float, float, float], field: str) -> None:
    x0, y0, x1, y1 = bounds
    if not (x0 <= at[0] <= x1 and y0 <= at[1] <= y1):
        raise BadInput(
            f"{show_point(at)} lies outside the map [{x0:g}, {y0:g}, {x1:g}, {y1:g}]",
            field=field,
            remedy="give a point inside",
        )
