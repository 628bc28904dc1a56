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
from oath.model import Obstacle, Point, Robot, Task

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
        self._undo: list[ObstacleAdded | ObstacleRemoved] = []
        self._known = dict(live.state.obstacles)

    def __enter__(self) -> Trial:
        return self

    def __exit__(self, *error: object) -> None:
        roadmap = self.live.scene.world.roadmap
        for event in reversed(self._undo):
            if isinstance(event, ObstacleAdded):
                roadmap.remove_obstacle(event.obstacle)
            else:
                roadmap.add_obstacle(self._known[event.obstacle])

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
                self.live.scene.world.roadmap.remove_obstacle(id)
                self._undo.append(event)
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
        reached = [robot for robot in able if self._reaches(robot, task)]
        if not reached:
            names = ", ".join(robot.id for robot in able)
            raise BadInput(
                f"{' or '.join(show_point(stop.at) for stop in task.stops)} is out of reach of "
                f"{names}",
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
        for what, at, robots in self._occupied():
            for robot in robots:
                if not mission.motions[robot.motion].blocked_by(event.kind):
                    break
                gap = float(shapely.distance(polygon, shapely.Point(at)))
                if gap >= robot.radius:
                    break
            else:
                raise BadInput(
                    f"the obstacle would cover {what} at {show_point(at)}",
                    field="obstacle_location",
                    remedy="check the coordinates, or cancel the task first",
                )
        before = self._unreachable()
        obstacle = Obstacle(id=event.obstacle, kind=event.kind, polygon=event.polygon)
        live.scene.world.roadmap.add_obstacle(obstacle)
        self._undo.append(event)
        for what in self._unreachable() - before:
            raise BadInput(
                f"the obstacle would shut in {what}",
                field="obstacle_location",
                remedy="check the coordinates, or cancel the task first",
            )

    def _occupied(self) -> Iterator[tuple[str, Point, list[Robot]]]:
        """Robots and open stops: what, where, and for whom it must stay free."""
        state, mission = self.live.state, self.live.scene.mission
        for robot in mission.robots:
            yield robot.id, self.live.pose(robot.id), [robot]
        for id, task in state.tasks.items():
            if id in state.completed:
                continue
            carrier = state.carrier(id)
            able = [r for r in self._working() if r.can.get(task.type, 0.0) > 0]
            if carrier:
                able = [robot for robot in mission.robots if robot.id == carrier]
            for stop in task.stops[-1:] if carrier else task.stops:
                if able:
                    yield f"the {stop.name} of task {id}", stop.at, able

    def _unreachable(self) -> set[str]:
        """Open tasks that no robot which may do them reaches."""
        state = self.live.state
        found = set()
        for id, task in state.tasks.items():
            if id in state.completed or id in state.stranded:
                continue
            carrier = state.carrier(id)
            if carrier:
                robot = self.live.scene.mission.robot(carrier)
                if not self._hangs_together(robot, [task.stops[-1].at]):
                    found.add(f"the delivery of task {id}")
                continue
            able = [r for r in self._working() if r.can.get(task.type, 0.0) > 0]
            if able and not any(self._reaches(robot, task) for robot in able):
                found.add(f"task {id}")
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

    def _reaches(self, robot: Robot, task: Task) -> bool:
        return self._hangs_together(robot, [stop.at for stop in task.stops])

    def _hangs_together(self, robot: Robot, points: Sequence[Point]) -> bool:
        """Whether a robot can drive from where it is to all of these points."""
        world = self.live.scene.world
        mode = world.mode_of[robot.id]
        nodes, _, _ = world.roadmap.links(self.live.pose(robot.id), mode)
        there = [world.roadmap.insert(point) for point in points]
        if avoid := self.live.scene.rules.avoid:
            costs = world.roadmap.travel(mode, there, nodes, avoid)
            return bool(np.isfinite(costs).any(axis=1).all())
        component = world.roadmap.components(mode)
        here = {int(component[node]) for node in nodes}
        return all(int(component[node]) in here for node in there)


def _inside(at: Point, bounds: tuple[float, float, float, float], field: str) -> None:
    x0, y0, x1, y1 = bounds
    if not (x0 <= at[0] <= x1 and y0 <= at[1] <= y1):
        raise BadInput(
            f"{show_point(at)} lies outside the map [{x0:g}, {y0:g}, {x1:g}, {y1:g}]",
            field=field,
            remedy="give a point inside",
        )
