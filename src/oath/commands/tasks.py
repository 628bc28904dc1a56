"""Commands about tasks: add one, cancel one, change how urgent it is."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from oath.commands.command import XY, Command, Live, Name, named, show_point
from oath.errors import BadInput
from oath.events import AnyEvent, PriorityChanged, TaskAdded, TaskCancelled
from oath.model import Point, Priority, Stop, Task


class AddTask(Command):
    """Fetch something at a location and take it to a place."""

    intent: ClassVar[str] = "add_task"

    location: XY = Field(description="where the task is picked up: [x, y] in metres")
    delivery_point: Name | XY = Field(description="name of the place it is taken to, or [x, y]")
    task_label: Name | None = Field(None, description="the task's label; made up if left out")
    task_type: Name | None = Field(None, description="one of the mission's task types")
    priority: Priority | None = Field(None, description="low, normal or high; normal if left out")

    def filled(self, live: Live) -> AddTask:
        """See `Command`."""
        mission, there = live.scene.mission, self.delivery_point
        if isinstance(there, str):
            there = named("place", "delivery_point", there, mission.places)
        return AddTask(
            location=self.location,
            delivery_point=there,
            task_label=self.task_label or _free_label(live),
            task_type=self._type(mission.task_types),
            priority=self.priority or "normal",
        )

    def _type(self, types: tuple[str, ...]) -> str:
        if self.task_type is not None:
            return named("task type", "task_type", self.task_type, types)
        usual = "normal" if "normal" in types else types[0]
        if usual != "normal" and len(types) > 1:
            raise BadInput(
                "the task's type is missing",
                field="task_type",
                remedy=f"say which: {', '.join(types)}",
            )
        return usual

    def task(self, live: Live) -> Task:
        """The task that a filled command adds."""
        there = self.delivery_point
        place = there if isinstance(there, str) else None
        at = live.scene.mission.places[there] if isinstance(there, str) else there
        assert self.task_label is not None and self.task_type is not None
        return Task(
            id=self.task_label,
            type=self.task_type,
            stops=(
                Stop(name="pickup", at=self.location),
                Stop(name="delivery", at=at, place=place),
            ),
            priority=self.priority or "normal",
        )

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        return (TaskAdded(t=live.state.t, task=self.task(live)),)

    def says(self, live: Live) -> str:
        """See `Command`."""
        there: str | Point = self.delivery_point
        where = there if isinstance(there, str) else show_point(there)
        urgent = "" if self.priority == "normal" else f", {self.priority} priority"
        return (
            f"adds task {self.task_label} at {show_point(self.location)}, delivery {where}, "
            f"{self.task_type}{urgent}"
        )


def _free_label(live: Live) -> str:
    """The first of t1, t2, ... that names nothing yet."""
    taken = {*live.state.labels, *live.scene.mission.places, *live.scene.mission.zones}
    return next(label for n in range(1, len(taken) + 2) if (label := f"t{n}") not in taken)


class ChangeTaskPriority(Command):
    """Serve a task before all others, or after them, or in its turn."""

    intent: ClassVar[str] = "change_task_priority"

    task_label: Name = Field(description="the task's label")
    priority: Priority = Field("high", description="low, normal or high")

    def filled(self, live: Live) -> ChangeTaskPriority:
        """See `Command`."""
        return self.model_copy(update={"task_label": known_task(live, self.task_label)})

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        return (PriorityChanged(t=live.state.t, task=self.task_label, priority=self.priority),)

    def says(self, live: Live) -> str:
        """See `Command`."""
        before = live.state.tasks[self.task_label].priority
        return f"changes the priority of task {self.task_label} from {before} to {self.priority}"


class CancelTask(Command):
    """Take a task out of the mission."""

    intent: ClassVar[str] = "cancel_task"

    task_label: Name = Field(description="the task's label")

    def filled(self, live: Live) -> CancelTask:
        """See `Command`."""
        return CancelTask(task_label=known_task(live, self.task_label))

    def events(self, live: Live) -> tuple[AnyEvent, ...]:
        """See `Command`."""
        return (TaskCancelled(t=live.state.t, task=self.task_label),)

    def says(self, live: Live) -> str:
        """See `Command`."""
        carrier = live.state.carrier(self.task_label)
        aboard = f"; {carrier} carries it already and keeps it aboard" if carrier else ""
        return f"cancels task {self.task_label}{aboard}"


def known_task(live: Live, label: str) -> str:
    """Return the label of a task of the mission as the mission spells it.

    Raises
    ------
    BadInput
        If there is none.
    """
    return named("task", "task_label", label, live.state.tasks)
