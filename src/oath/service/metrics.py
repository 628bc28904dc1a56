"""What the server counts of itself, as text for Prometheus."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

BUCKETS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5)
"""Upper bounds of the histograms' buckets [s]."""


@dataclass(slots=True)
class Histogram:
    """How long something took."""

    counts: list[int] = field(default_factory=lambda: [0] * (len(BUCKETS) + 1))
    total: float = 0.0

    def add(self, seconds: float) -> None:
        """Count one."""
        index = next((i for i, bound in enumerate(BUCKETS) if seconds <= bound), len(BUCKETS))
        self.counts[index] += 1
        self.total += seconds

    def lines(self, name: str, label: str = "") -> Iterable[str]:
        """Its text; a label is e.g. ``frame="poses"``."""
        more, alone = (f"{label},", f"{{{label}}}") if label else ("", "")
        below = 0
        for bound, count in zip((*map(str, BUCKETS), "+Inf"), self.counts, strict=True):
            below += count
            yield f'{name}_bucket{{{more}le="{bound}"}} {below}'
        yield f"{name}_sum{alone} {self.total:.6f}"
        yield f"{name}_count{alone} {below}"


class Metrics:
    """Counts requests, commands and how late clients hear of what happens."""

    def __init__(self) -> None:
        self._begin = time.monotonic()
        self._requests: Counter[tuple[str, int]] = Counter()
        self.lag = {"events": Histogram(), "poses": Histogram(), "state": Histogram()}
        """From when something is known until a client has been sent it."""
        self.command = Histogram()

    def answered(self, method: str, status: int) -> None:
        """A request was answered."""
        known = method in ("GET", "HEAD", "POST", "SOCKET")
        self._requests[method if known else "other", status] += 1

    def text(
        self,
        *,
        t: float,
        events: int,
        sockets: int,
        tasks: Mapping[str, int],
        robots: Mapping[str, int],
    ) -> str:
        """Everything in Prometheus' text format.

        Parameters
        ----------
        t
            Mission clock [s].
        events, sockets
            How many events there are, and clients that listen.
        tasks, robots
            How many of each status.
        """
        lines = [
            *_head("oath_uptime_seconds", "gauge", "Since the server started."),
            f"oath_uptime_seconds {time.monotonic() - self._begin:.3f}",
            *_head("oath_mission_seconds", "gauge", "Mission clock."),
            f"oath_mission_seconds {t:.3f}",
            *_head("oath_tasks", "gauge", "Tasks by status."),
            *(f'oath_tasks{{status="{name}"}} {count}' for name, count in tasks.items()),
            *_head("oath_robots", "gauge", "Robots by status."),
            *(f'oath_robots{{status="{name}"}} {count}' for name, count in robots.items()),
            *_head("oath_events_total", "counter", "Events in the journal."),
            f"oath_events_total {events}",
            *_head("oath_sockets", "gauge", "Clients that listen."),
            f"oath_sockets {sockets}",
            *_head("oath_http_requests_total", "counter", "Answers by method and status."),
            *(
                f'oath_http_requests_total{{method="{method}",status="{status}"}} {count}'
                for (method, status), count in sorted(self._requests.items())
            ),
            *_head("oath_command_seconds", "histogram", "From a command to its answer."),
            *self.command.lines("oath_command_seconds"),
            *_head("oath_lag_seconds", "histogram", "Until a client has been sent what is new."),
        ]
        for frame, lag in self.lag.items():
            lines += lag.lines("oath_lag_seconds", f'frame="{frame}"')
        return "\n".join(lines) + "\n"


def _head(name: str, kind: str, help: str) -> tuple[str, str]:
    return f"# HELP {name} {help}", f"# TYPE {name} {kind}"
