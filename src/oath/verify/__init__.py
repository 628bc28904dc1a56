"""An independent judge of event logs: it shares no code with what plans and runs missions.

It rebuilds from the log alone who was where when, and says of everything that a mission promises
(each task served once by a capable robot, motion clear of all obstacles, rules obeyed) whether the
log keeps it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from oath.events import AnyEvent, ObstacleFound, StopServed
from oath.model import Mission
from oath.verify.commands import judge_commands
from oath.verify.motion import Separation, judge_motion, separation
from oath.verify.record import TOLERANCE, Record, RuleName, Violation, read
from oath.verify.rules import judge_rules
from oath.verify.service import judge_service

__all__ = ["TOLERANCE", "RuleName", "Separation", "Verdict", "Violation", "verify"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What the judge found.

    Attributes
    ----------
    violations
        Everything that is wrong, in the order of the log; empty if the log is good.
    checked
        How many events, moves, stops, tasks, obstacles, finds and rules were judged, so that an
        empty list of violations can be told from an empty log.
    separation
        The least distance between two robots' centres, who and when; None for a single robot. It
        is reported, not judged: robots do not promise to avoid each other.
    """

    violations: tuple[Violation, ...]
    checked: Mapping[str, int]
    separation: Separation | None

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong."""
        return not self.violations

    @property
    def least_separation(self) -> float | None:
        """Least distance between two robots' centres over the whole run [m]."""
        return None if self.separation is None else self.separation.distance


def verify(mission: Mission, events: Sequence[AnyEvent]) -> Verdict:
    """Judge the event log of a mission.

    Parameters
    ----------
    mission
        The mission as it was when it started.
    events
        The whole log in its order; an event's place is its sequence number.

    Raises
    ------
    BadInput
        One of the mission's own rules cannot be read.

    Examples
    --------
    >>> from oath.model import Map, Mission
    >>> empty = Mission(name="m", map=Map(bounds=(0, 0, 1, 1)), motions={}, places={},
    ...                 task_types=(), robots=(), tasks=(), zones={}, rules=())
    >>> for violation in verify(empty, []).violations:
    ...     print(violation)
    event 0: order: the log does not start with mission_started
    cut_off: the log is cut off: it does not end with mission_finished
    """
    record, violations = read(mission, events)
    violations += judge_service(record)
    violations += judge_motion(record)
    violations += judge_rules(record)
    violations += judge_commands(record)
    # Those that no event is to blame for come last; the sort is stable.
    violations.sort(key=lambda v: len(events) if v.seq is None else v.seq)
    return Verdict(
        violations=tuple(violations), checked=_counts(record), separation=separation(record)
    )


def _counts(record: Record) -> dict[str, int]:
    usable = [event for _, event in record.usable]
    return {
        "events": len(record.events),
        "moves": sum(len(track.seq) for track in record.tracks.values()),
        "stops": sum(isinstance(event, StopServed) for event in usable),
        "tasks": len(record.mission.tasks) + sum(e.type == "task_added" for e in usable),
        "obstacles": len(record.lives),
        "found": sum(isinstance(event, ObstacleFound) for event in usable),
        "rules": len(record.mission.rules) * len(record.tracks),
    }
