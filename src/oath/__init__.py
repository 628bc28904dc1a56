"""OATH: task assignment and planning for mixed robot fleets among obstacles.

Examples
--------
>>> import oath
>>> mission = oath.load("missions/maze-09.yaml")
>>> result = oath.run(mission, seed=7)
>>> result.summary["completed"], len(result.summary["unserved"])
(9, 0)
>>> oath.allocate(mission).unassigned
{}
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from oath.events import AnyEvent
    from oath.model import Assignment, Mission
    from oath.runtime import Result, Runtime

__all__ = ["DEFAULT_ALLOCATOR", "allocate", "load", "prepare", "run"]

DEFAULT_ALLOCATOR = "lns"

# The rooms are imported when they are needed: `import oath` itself costs next to nothing.


def load(path: str | Path) -> Mission:
    """Read a mission file.

    Raises
    ------
    BadInput
        Naming file, field, value, limit and remedy.
    """
    from oath.formats.mission import load as read

    return read(path)


def run(
    mission: Mission,
    *,
    allocator: str = DEFAULT_ALLOCATOR,
    makespan_weight: float | None = None,
    seconds: float | None = None,
    seed: int = 0,
    points: int = 1000,
    on_event: Callable[[AnyEvent], None] = lambda event: None,
) -> Result:
    """Run a mission in the built-in simulator, to its end.

    Parameters and errors as for `prepare`.

    Returns
    -------
    Result
        `summary` and `events`; a task that could not be done stands in `summary["unserved"]`.
    """
    return prepare(
        mission,
        allocator=allocator,
        makespan_weight=makespan_weight,
        seconds=seconds,
        seed=seed,
        points=points,
        on_event=on_event,
    ).run()


def prepare(
    mission: Mission,
    *,
    allocator: str = DEFAULT_ALLOCATOR,
    makespan_weight: float | None = None,
    seconds: float | None = None,
    seed: int = 0,
    points: int = 1000,
    on_event: Callable[[AnyEvent], None] = lambda event: None,
) -> Runtime:
    """Make a mission ready to run in the built-in simulator, and to take commands meanwhile.

    Parameters
    ----------
    mission
        What to do, from `load`.
    allocator
        Name of the allocator.
    makespan_weight
        Weight of the makespan beside the sum of lengths [m/s], for allocators that minimise it;
        None = their default.
    seconds
        Wall clock for improving each answer of the allocator [s]; None = a fixed number of
        iterations. With a clock, the same seed need not give the same events.
    seed
        Of the roadmap and the allocator: the same seed gives the same events, wall clock aside.
    points
        Sampled points of the roadmap.
    on_event
        Called with every event as it happens.

    Raises
    ------
    BadInput
        If a rule is wrong, a stop is out of reach of every capable robot, or the allocator knows no
        makespan weight.
    """
    from oath.allocate import Budget
    from oath.allocate import allocator as named
    from oath.fleet.sim import SimFleet
    from oath.runtime import Runtime
    from oath.scene import prepare as made_ready
    from oath.scene import require_reachable
    from oath.world.roadmap import Params

    chosen = named(allocator, makespan_weight=makespan_weight)
    scene = made_ready(mission, Params(points=points), seed)
    require_reachable(scene)

    def each(events: Sequence[AnyEvent]) -> None:
        for event in events:
            on_event(event)

    return Runtime(
        scene,
        SimFleet(mission),
        name=allocator,
        allocator=chosen,
        budget=Budget(seconds=seconds),
        seed=seed,
        journal=each,
    )


def allocate(
    mission: Mission,
    *,
    allocator: str = DEFAULT_ALLOCATOR,
    makespan_weight: float | None = None,
    max_tasks: int | None = None,
    seed: int = 0,
    points: int = 2000,
) -> Assignment:
    """Assign all tasks of a mission at once, without executing anything.

    Other parameters and errors as for `prepare`.

    Parameters
    ----------
    max_tasks
        Tasks that a robot may be given in all; None = any number.
    """
    from oath.allocate import Budget
    from oath.allocate import allocator as named
    from oath.scene import assign, require_reachable
    from oath.scene import prepare as made_ready
    from oath.world.roadmap import Params

    chosen = named(allocator, makespan_weight=makespan_weight)
    scene = made_ready(mission, Params(points=points), seed)
    require_reachable(scene)
    return assign(scene, chosen, Budget(), seed, max_tasks).assignment


class _Package(ModuleType):
    """Keeps `oath.allocate` the function: Python binds the room of that name when it is imported.

    The room's own names are there all the same, ``from oath.allocate import Problem``.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name == "allocate" and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
