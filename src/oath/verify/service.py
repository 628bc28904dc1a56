"""Judge the work: each task served once, by one capable robot, at the right point, long enough."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from oath.events import AnyEvent, Moved, StopServed, TaskAdded, TaskCancelled
from oath.model import Task
from oath.verify.record import TOLERANCE, Record, RuleName, Track, Violation, apart

SUMMARY_TOLERANCE = 1e-3
"""Slack on the summary's sums [m, s]: a summary may be rounded for reading, a log may not."""


@dataclass(slots=True)
class _Job:
    task: Task
    served: list[StopServed] = field(default_factory=list)
    cancelled: bool = False

    @property
    def done(self) -> bool:
        return {stop.stop for stop in self.served} == {stop.name for stop in self.task.stops}


@dataclass(slots=True)
class _Books:
    """What each robot carries and did last, kept while the log is replayed."""

    record: Record
    jobs: dict[str, _Job]
    carried: dict[str, set[str]]
    last_service: dict[str, float] = field(default_factory=dict)
    finished: set[str] = field(default_factory=set)


def judge_service(record: Record) -> Iterator[Violation]:
    """Yield what is wrong with the stops served, the tasks left and the summary."""
    books = _Books(
        record=record,
        jobs={task.id: _Job(task) for task in record.mission.tasks},
        carried={robot.id: set() for robot in record.mission.robots},
    )
    for seq, event in record.usable:
        for rule, text in _enter(books, event):
            robot = getattr(event, "robot", None)
            yield Violation(rule=rule, seq=seq, robot=robot, message=text)
    yield from _judge_end(books)


Fault = tuple[RuleName, str]


def _enter(books: _Books, event: AnyEvent) -> Iterator[Fault]:
    match event:
        case TaskAdded(task=task):
            books.jobs[task.id] = _Job(task)
            books.finished.discard(task.id)
        case TaskCancelled(task=task):
            books.jobs[task].cancelled = True
            for load in books.carried.values():
                load.discard(task)
        case StopServed():
            yield from _stop_faults(books, event)
        case _:
            pass


def _stop_faults(books: _Books, event: StopServed) -> Iterator[Fault]:
    job, track = books.jobs[event.task], books.record.tracks[event.robot]
    yield from _turn_faults(job, event)
    yield from _robot_faults(job, event, track)
    yield from _place_faults(job, event, track)
    yield from _time_faults(job, event, track, books.last_service.get(event.robot))
    yield from _load_faults(books.carried[event.robot], event, track)
    books.last_service[event.robot] = event.t
    job.served.append(event)
    if job.done:
        books.finished.add(event.task)


def _turn_faults(job: _Job, event: StopServed) -> Iterator[Fault]:
    names = [stop.name for stop in job.task.stops]
    before = [served.stop for served in job.served]
    label = f"{event.stop} of task '{event.task}'"
    if job.cancelled:
        yield "cancelled", f"{label} is served after the task was cancelled"
    if event.stop in before:
        yield "served_twice", f"{label} is served a second time"
    else:
        missing = [n for n in names[: names.index(event.stop)] if n not in before]
        if missing:
            yield "stop_order", f"{label} is served before its {missing[0]}"


def _robot_faults(job: _Job, event: StopServed, track: Track) -> Iterator[Fault]:
    robot, kind = track.robot, job.task.type
    others = [served.robot for served in job.served if served.robot != robot.id]
    first = all(served.robot != robot.id for served in job.served)
    if others and first:
        yield "one_robot", f"task '{event.task}' was begun by robot '{others[0]}'"
    if first and not robot.can.get(kind, 0.0) > 0:
        can = ", ".join(sorted(robot.can)) or "nothing"
        yield "capability", f"task '{event.task}' is of type '{kind}'; the robot can do {can}"
    for since, until, why in track.halts:
        if since + TOLERANCE < event.t < until - TOLERANCE:
            text = f"it serves task '{event.task}' though it is {why} since {since:.6g} s"
            yield "halted", text


def _place_faults(job: _Job, event: StopServed, track: Track) -> Iterator[Fault]:
    wanted = job.task.stop(event.stop).at
    label = f"{event.stop} of task '{event.task}'"
    for what, point in (("is logged at", event.at), ("is served from", track.at(event.t))):
        off = apart(point, wanted)
        if off > TOLERANCE:
            yield (
                "position",
                f"{label} {what} ({point[0]:.6g}, {point[1]:.6g}), {off:.6g} m from its point "
                f"({wanted[0]:.6g}, {wanted[1]:.6g}); at most {TOLERANCE:g} m is allowed",
            )
            return


def _time_faults(
    job: _Job, event: StopServed, track: Track, previous: float | None
) -> Iterator[Fault]:
    needed = job.task.service_time
    label = f"{event.stop} of task '{event.task}'"
    since = track.standing_since(event.t)
    if since is None:
        yield "service_overlap", f"{label} is served while the robot drives"
    elif event.t - since < needed - TOLERANCE:
        stood = event.t - since
        yield "service_time", f"{label} is served after {stood:.6g} s; it takes {needed:.6g} s"
    if previous is not None and event.t - needed < previous - TOLERANCE:
        yield (
            "service_overlap",
            f"{label} needs the robot from {event.t - needed:.6g} s on, but it serves another stop "
            f"until {previous:.6g} s",
        )


def _load_faults(carried: set[str], event: StopServed, track: Track) -> Iterator[Fault]:
    if event.stop == "delivery":
        carried.discard(event.task)
    elif event.stop == "pickup":
        carried.add(event.task)
        limit = track.robot.capacity
        if len(carried) > limit:
            yield (
                "capacity",
                f"load {len(carried)} ({', '.join(sorted(carried))}) exceeds the capacity {limit}",
            )


def _judge_end(books: _Books) -> Iterator[Violation]:
    finish = books.record.summary
    if finish is None:
        # A log that is cut off says nothing of what would still have been served.
        return
    seq, summary = len(books.record.events) - 1, finish.summary
    unserved = summary.get("unserved", {})
    reasons = unserved if isinstance(unserved, dict) else {}
    if unserved is not reasons:
        text = f"unserved is {unserved!r}; it must map each task left to a reason"
        yield Violation(rule="summary", seq=seq, message=text)
    for id, job in books.jobs.items():
        if not job.cancelled and id not in books.finished and not reasons.get(id):
            left = [s.name for s in job.task.stops if s.name not in {e.stop for e in job.served}]
            text = (
                f"task '{id}' is never served ({', '.join(left)}) and the summary gives no reason"
            )
            yield Violation(rule="unserved", seq=seq, message=text)
    for text in _summary_faults(books, summary, reasons):
        yield Violation(rule="summary", seq=seq, message=text)


def _summary_faults(books: _Books, summary: Any, reasons: dict[str, Any]) -> Iterator[str]:
    for id in sorted(reasons):
        if id in books.finished:
            yield f"task '{id}' is listed as unserved but it was served"
        elif id not in books.jobs:
            yield f"task '{id}' is listed as unserved but there is no such task"
    completed = summary.get("completed")
    if isinstance(completed, Collection):
        if set(completed) != books.finished:
            yield f"completed is {sorted(completed)}, by the log {sorted(books.finished)}"
    else:
        yield from _differs("completed", completed, len(books.finished))
    tracks = books.record.tracks.values()
    yield from _differs("total_steps", summary.get("total_steps"), sum(len(t.seq) for t in tracks))
    distance = sum(float(track.length.sum()) for track in tracks)
    yield from _differs("total_distance", summary.get("total_distance"), distance)
    served = max((e.t for _, e in books.record.usable if isinstance(e, StopServed)), default=0.0)
    driven = max((e.t for _, e in books.record.usable if isinstance(e, Moved)), default=0.0)
    # The time until the last stop; where nothing more was served it may include the last drive.
    yield from _differs("makespan", summary.get("makespan"), served, max(served, driven))
    for id, own in summary.get("per_robot", {}).items():
        if id not in books.record.tracks or not isinstance(own, Mapping):
            yield f"per_robot has '{id}': {own!r}; it must map the mission's robots to their sums"
            continue
        track = books.record.tracks[id]
        yield from _differs(f"per_robot.{id}.steps", own.get("steps"), len(track.seq))
        length = float(track.length.sum())
        yield from _differs(f"per_robot.{id}.distance", own.get("distance"), length)


def _differs(name: str, told: Any, low: float, high: float | None = None) -> Iterator[str]:
    high = low if high is None else high
    slack = SUMMARY_TOLERANCE + 1e-9 * abs(high)
    if not isinstance(told, int | float) or not low - slack <= told <= high + slack:
        yield f"{name} is {told}, by the log {low:.6g}"
