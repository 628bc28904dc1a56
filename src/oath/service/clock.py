"""The mission clock: wall time times a speed, unless it is held."""

from __future__ import annotations

import time
from collections.abc import Callable

SLOWEST, FASTEST = 0.1, 100.0
"""Speeds that can be asked for [mission seconds per second]."""

LONGEST = 0.1
"""So much wall time counts between two looks at the clock [s].

If the mission needs longer, for planning say, its clock waits: nothing is skipped over.
"""


class Clock:
    """Where the mission's time should be.

    Parameters
    ----------
    t
        Mission time to begin with [s].
    speed
        Mission seconds per second.
    wall
        Wall clock [s].
    """

    def __init__(
        self, t: float = 0.0, speed: float = 1.0, wall: Callable[[], float] = time.monotonic
    ) -> None:
        self.t, self.speed, self.paused = t, speed, False
        self._wall = wall
        self._seen = wall()

    def tick(self) -> float:
        """Let the time go on; return the mission time [s]."""
        wall = self._wall()
        if not self.paused:
            self.t += min(wall - self._seen, LONGEST) * self.speed
        self._seen = wall
        return self.t
