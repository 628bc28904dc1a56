"""Commands about robots: hold one, let it go on, count it out."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from oath.commands.command import Command, Live, Name, named
from oath.dispatch import failure
from oath.errors import BadInput
from oath.events import AnyEvent, RobotPaused, RobotResumed

ALL = "all"
"""Names every robot, unless a robot is called so."""


class _OfRobot(Command):
    robot: Name = Field(description="the robot's id, or all")

    def filled(self, live: Live) -> _OfRobot:
        """See `Command`."""
        if self.robot.casefold() == ALL and ALL not in live.state.robots:
            return self.model_copy(update={"robot": ALL})
        name = named("robot", "robot", self.robot, live.state.robots)
        return self.model_copy(update={"robot": name})

    def _robots(self, live: Live) -> list[str]:
        """The robots that are meant; of all only those that can still do anything."""
        if self.robot in live.state.robots:
            return [self.robot]
        return [robot for robot in live.state.robots if robot not in live.state.failed]


class PauseRobot(_OfRobot):
    """Hold a robot where it is, at once."""

    intent: ClassVar[str] = "pause_robot"
    immediate: ClassVar[bool] = True

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        robots = self._robots(live)
        if self.robot == ALL:
            robots = [robot for robot in robots if robot not in live.state.paused]
            if not robots:
                raise BadInput("every robot is paused already", field="robot", remedy="resume one")
        return tuple(RobotPaused(t=live.state.t, robot=robot) for robot in robots)

    def says(self, live: Live) -> str:
        """See `Command`."""
        return "pauses all robots" if self.robot == ALL else f"pauses {self.robot}"


class ResumeRobot(_OfRobot):
    """Let a paused robot go on."""

    intent: ClassVar[str] = "resume_robot"

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        robots = self._robots(live)
        if self.robot == ALL:
            robots = [robot for robot in robots if robot in live.state.paused]
            if not robots:
                raise BadInput("no robot is paused", field="robot", remedy="nothing is to be done")
        return tuple(RobotResumed(t=live.state.t, robot=robot) for robot in robots)

    def says(self, live: Live) -> str:
        """See `Command`."""
        return "lets all robots go on" if self.robot == ALL else f"lets {self.robot} go on"


class RobotFailure(_OfRobot):
    """A robot is out of the mission; what it carried waits where it stands."""

    intent: ClassVar[str] = "robot_failed"

    robot: Name = Field(description="the robot's id")

    def filled(self, live: Live) -> RobotFailure:
        """See `Command`."""
        return RobotFailure(robot=named("robot", "robot", self.robot, live.state.robots))

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        return failure(live.state, self.robot, live.pose(self.robot))

    def says(self, live: Live) -> str:
        """See `Command`."""
        load = live.state.robots[self.robot].carrying
        stranded = f"; {', '.join(load)} waits where it stands" if load else ""
        return f"counts {self.robot} out as failed{stranded}"
