"""Events that an older version wrote, brought up to date when they are read.

The journal keeps every event as it was written, with the version of its data. When the data of an
event type changes, the old form gets an upcaster here, and every event written from then on has
the next version.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

Line = dict[str, Any]
Upcaster = Callable[[Line], Line]
Upcasters = Mapping[tuple[str, int], Upcaster]
"""By event type and version: what makes such data that of the next version."""

UPCASTERS: Upcasters = {}
"""Nothing has changed so far."""


def current(upcasters: Upcasters) -> int:
    """Return the version of what is written now.

    Examples
    --------
    >>> current({}), current({("moved", 1): dict, ("planned", 2): dict})
    (1, 3)
    """
    return 1 + max((version for _, version in upcasters), default=0)


def upcast(line: Line, version: int, upcasters: Upcasters) -> Line:
    """Return an event's data in the current version.

    Examples
    --------
    >>> old = {"type": "robot_paused", "who": "r1"}
    >>> renamed = {("robot_paused", 1): lambda line: {"type": line["type"], "robot": line["who"]}}
    >>> upcast(old, 1, renamed)
    {'type': 'robot_paused', 'robot': 'r1'}
    """
    for old in range(version, current(upcasters)):
        change = upcasters.get((line["type"], old))
        line = change(line) if change else line
    return line
