"""What an allocator is given: one allocation round as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from oath.model import Route

WAITING = "waits for a robot"
"""Why a task that some robot can do is not in any route after a round."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Aboard:
    """A task that a robot carries: only its delivery is left, and nobody else can do it."""

    task: str
    delivery: int
    """Location of its last stop."""
    service_time: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """R robots, P open tasks (not picked up by anyone yet) and L locations.

    What a robot does already stands in `routes` and comes first whatever is decided: all of its
    route for an allocator that gives idle robots something to do, the stop it is driving to for one
    that reconsiders the rest.

    Indices refer to `robots`, `tasks` and the rows of `cost`. Every array is read-only.
    """

    robots: tuple[str, ...]
    tasks: tuple[str, ...]
    start: NDArray[np.int32]
    """(R,) location where each robot is free to begin something new."""
    pickup: NDArray[np.int32]
    """(P,) location of a task's first stop."""
    delivery: NDArray[np.int32]
    """(P,) location of its last stop; the same as `pickup` for a visit."""
    visit: NDArray[np.bool_]
    """(P,) the task has one stop only and loads nothing."""
    service_time: NDArray[np.float64]
    """(P,) time at each stop [s]."""
    type: NDArray[np.int32]
    """(P,) the task's type, a column of `capability`."""
    capability: NDArray[np.float64]
    """(R, T) how well a robot does a type, 0 = not at all."""
    capacity: NDArray[np.int32]
    """(R,) tasks carried at once, less those that cannot be delivered any more."""
    load: NDArray[np.int32]
    """(R,) tasks carried now, before anything in `routes`."""
    speed: NDArray[np.float64]
    """(R,) [m/s]."""
    cost: NDArray[np.float64]
    """(M, L, L) travel cost [m] per mode of travel, inf = unreachable."""
    points: NDArray[np.float64]
    """(L, 2) where the locations are [m; world frame], for those who guess costs from them."""
    mode: NDArray[np.int32]
    """(R,) which of the M cost matrices a robot uses."""
    busy: NDArray[np.bool_]
    """(R,) the robot still has a route; `routes` says which."""
    routes: tuple[Route, ...]
    """(R,) what each robot is doing now; its tasks that are not picked up stand in `tasks` too."""
    types: tuple[str, ...]
    """(T,) the types' names, for messages only."""
    priority: NDArray[np.int8]
    """(P,) 1 = high, 0 = normal, -1 = low."""
    refused: NDArray[np.bool_]
    """(R, P) the robot was found unable to do the task, e.g. because a rule forbids it."""
    max_tasks: NDArray[np.int32]
    """(R,) tasks a robot may be given in all; the single-round problem has its capacity here."""
    ready: NDArray[np.float64]
    """(R,) when each robot is free at `start` [s from now]."""
    aboard: tuple[tuple[Aboard, ...], ...]
    """(R,) what each robot carries when it is free, and nothing in `routes` delivers."""
    previous: tuple[Route, ...]
    """(R,) what each robot was to do before this round; begins with `routes`."""

    def feasible(self) -> NDArray[np.bool_]:
        """(R, P): the robot can do the type, has room, reaches pickup and from there delivery.

        A robot that may be given no task at all can do none.
        """
        there = np.isfinite(self.cost[self.mode[:, None], self.start[:, None], self.pickup])
        on = np.isfinite(self.cost[:, self.pickup, self.delivery])[self.mode]
        room = (self.capacity[:, None] > 0) | self.visit
        able: NDArray[np.bool_] = there & on & room & (self.capability[:, self.type] > 0)
        return able & ~self.refused & (self.max_tasks[:, None] > 0)

    def only(self, tasks: Sequence[int]) -> Problem:
        """The same problem with some of its tasks only."""
        kept = np.array(tasks, dtype=np.intp)
        return replace(
            self,
            tasks=tuple(self.tasks[task] for task in tasks),
            pickup=self.pickup[kept],
            delivery=self.delivery[kept],
            visit=self.visit[kept],
            service_time=self.service_time[kept],
            type=self.type[kept],
            priority=self.priority[kept],
            refused=self.refused[:, kept],
        )
