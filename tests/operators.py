"""Operators who ask random things of a running mission, most of them possible."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

from missions import SIZE
from oath.commands import (
    AddTask,
    CancelTask,
    ChangeTaskPriority,
    Command,
    ObstacleUpdate,
    PauseRobot,
    QueryStatus,
    RemoveObstacle,
    ResumeRobot,
    RobotFailure,
    Undo,
)
from oath.errors import BadInput
from oath.events import AnyEvent
from oath.runtime import Runtime


class Operator:
    """Asks for `count` random commands at random times, the same for the same seed."""

    def __init__(self, seed: int, count: int, until: float = 30.0) -> None:
        self.rng = random.Random(seed)
        self.times = sorted(self.rng.uniform(0.0, until) for _ in range(count))
        self.done: list[AnyEvent] = []
        self.refused: list[BadInput] = []

    def command(self, runtime: Runtime) -> Command:
        """Return something to ask of a mission as it is now."""
        rng, state = self.rng, runtime.live().state
        tasks, robots = [*state.tasks, "nothing"], [*state.robots, "all"]
        makers: list[Callable[[], Command]] = [
            self._add_task,
            self._obstacle,
            lambda: ChangeTaskPriority(
                task_label=rng.choice(tasks), priority=rng.choice(["low", "normal", "high", "high"])
            ),
            lambda: CancelTask(task_label=rng.choice(tasks)),
            lambda: RemoveObstacle(obstacle=rng.choice([*state.obstacles, "o1"])),
            lambda: PauseRobot(robot=rng.choice(robots)),
            lambda: ResumeRobot(robot=rng.choice([*state.paused, "all"])),
            lambda: RobotFailure(robot=rng.choice(robots[:-1])),
            lambda: Undo(),
            lambda: QueryStatus(),
        ]
        return rng.choices(makers, [5, 6, 5, 3, 3, 3, 4, 1, 3, 1])[0]()

    def act(self, runtime: Runtime) -> None:
        """Ask for one thing, or two at once."""
        commands = [self.command(runtime) for _ in range(self.rng.choice([1, 1, 1, 2]))]
        try:
            self.done += runtime.command(commands, "operator")
        except BadInput as problem:
            self.refused.append(problem)

    def _spot(self) -> tuple[float, float]:
        if self.rng.random() < 0.5:
            return (float(self.rng.randint(0, 10)), float(self.rng.randint(0, 10)))
        return (self.rng.uniform(0, SIZE), self.rng.uniform(0, SIZE))

    def _add_task(self) -> AddTask:
        rng = self.rng
        return AddTask(
            location=self._spot(),
            delivery_point=rng.choice(["p", self._spot()]),
            task_label=rng.choice([None, None, "t0", "new"]),
            task_type=rng.choice(["carry", "inspect"]),
            priority=rng.choice([None, "low", "high"]),
        )

    def _obstacle(self) -> ObstacleUpdate:
        rng = self.rng
        x, y = self._spot()
        points: list[Any] = [(x, y), (x + rng.uniform(-3, 3), y + rng.uniform(-3, 3))]
        if rng.random() < 0.5:
            a, b = rng.uniform(0.1, 2), rng.uniform(0.1, 2)
            points = [(x, y), (x + a, y), (x + a, y + b), (x, y + b)]
        return ObstacleUpdate(
            obstacle_location=points, obstacle_type=rng.choice([None, "bush", "gate"])
        )
