"""Everything that the events of a mission say, at one moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from oath.events import AnyEvent
from oath.model import Mission, Obstacle, Point, Route, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """Where a robot was last seen [m], what remains of its route, and the tasks it carries.

    What it cannot deliver stays in its hands.
    """

    position: Point
    route: Route = ()
    carrying: tuple[str, ...] = ()
    capacity: int = 1
    """Tasks that it has room for."""
    stale: bool = False
    """The plan ends differently than the route; it is due anew after the next stop."""
    left: float = 0.0
    """What was planned less what was driven since [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Everything that the events so far say."""

    t: float
    """Mission clock [s]."""
    tasks: Mapping[str, Task]
    robots: Mapping[str, RobotState]
    completed: frozenset[str] = frozenset()
    stranded: Mapping[str, str] = field(default_factory=dict)
    """Carried tasks that cannot be delivered, and why."""
    failed: frozenset[str] = frozenset()
    """Robots that are out of the mission."""
    reconsiders: bool = False
    """The allocator may change routes that are under way; else only idle robots get tasks."""
    refused: frozenset[tuple[str, str]] = frozenset()
    """(robot, task) pairs that turned out to have no plan."""
    unassigned: Mapping[str, str] = field(default_factory=dict)
    """Why tasks were left out of the last round."""
    rounds: int = 0
    """How often a round of allocation was asked for."""
    allocating: bool = False
    """One is in flight."""
    finished: bool = False
    paused: frozenset[str] = frozenset()
    """Robots that are told to hold; they keep their routes and get nothing new."""
    obstacles: Mapping[str, Obstacle] = field(default_factory=dict)
    """Everything that stands in the way and is known."""
    hidden: Mapping[str, Obstacle] = field(default_factory=dict)
    """What the mission says is there to be found."""
    labels: frozenset[str] = frozenset()
    """Every task label ever used."""
    obstacle_ids: frozenset[str] = frozenset()
    """Every obstacle id ever used."""
    changes: int = 0
    """How often tasks, priorities, obstacles or the robots' condition have changed."""
    undo: tuple[tuple[AnyEvent, ...], ...] = ()
    """For every command that is not undone what takes it back; () if nothing can."""
    recording: bool = False
    """The events that follow are what the last command does."""

    @classmethod
    def of(cls, mission: Mission, *, reconsiders: bool = False) -> State:
        """The state before anything happened."""
        obstacles = {obstacle.id: obstacle for obstacle in mission.map.obstacles}
        return cls(
            t=0.0,
            tasks={task.id: task for task in mission.tasks},
            robots={
                robot.id: RobotState(position=robot.start, capacity=robot.capacity)
                for robot in mission.robots
            },
            reconsiders=reconsiders,
            obstacles={id: one for id, one in obstacles.items() if one.known},
            hidden={id: one for id, one in obstacles.items() if not one.known},
            labels=frozenset(task.id for task in mission.tasks),
            obstacle_ids=frozenset(obstacles),
        )

    def carrier(self, task: str) -> str | None:
        """The robot that has a task aboard."""
        return next((id for id, robot in self.robots.items() if task in robot.carrying), None)

    def urgent(self) -> tuple[str, ...]:
        """Open tasks of high priority."""
        return tuple(id for id in self.open_tasks() if self.tasks[id].priority == "high")

    def deliverable(self, robot: str) -> tuple[str, ...]:
        """What a robot carries and will deliver: neither stranded nor cancelled meanwhile."""
        loads = self.robots[robot].carrying
        return tuple(id for id in loads if id in self.tasks and id not in self.stranded)

    def carried(self) -> frozenset[str]:
        """Tasks that some robot has picked up and will deliver."""
        return frozenset(task for robot in self.robots for task in self.deliverable(robot))

    def open_tasks(self) -> tuple[str, ...]:
        """Tasks that nobody has picked up, in their given order."""
        begun = self.completed | self.carried() | self.stranded.keys()
        return tuple(task for task in self.tasks if task not in begun)

    def waiting(self) -> tuple[str, ...]:
        """Open tasks that are in no robot's route."""
        routed = {stop.task for robot in self.robots.values() for stop in robot.route}
        return tuple(task for task in self.open_tasks() if task not in routed)

    def unserved(self) -> dict[str, str]:
        """Every task that is not done, and why."""
        reasons = {**self.unassigned, **self.stranded}
        paused = ", ".join(id for id in self.robots if id in self.paused - self.failed)
        for id in self.waiting() if paused else ():
            reasons[id] = f"{reasons.get(id, 'waits for a robot')} (paused: {paused})"
        for id in self.paused:
            robot = self.robots[id]
            held = {stop.task for stop in robot.route} | set(self.deliverable(id))
            reasons |= dict.fromkeys(held, f"given to {id}, which is paused")
        return {
            task: reasons.get(task, "not finished")
            for task in self.tasks
            if task not in self.completed
        }
