"""The one thread that runs the mission, keeps its journal and listens to its operators."""

from __future__ import annotations

import asyncio
import logging
import queue
import struct
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from oath.commands import Command, to_plain
from oath.errors import BadInput, OathError
from oath.events import AnyEvent, Commanded, RobotFailed
from oath.runtime import Runtime
from oath.service.clock import Clock
from oath.service.history import EVERY
from oath.service.snapshot import Moment
from oath.store import Journal

T = TypeVar("T")
Happen = Callable[[Sequence[AnyEvent]], None]

TICK = 0.05
"""The mission is brought up to date this often [s, wall clock]."""

POSES_EVERY, MOMENTS_EVERY = 0.1, 0.5
"""How often poses and states are told [s, wall clock]."""

WAITING = 256
"""At most so many requests wait for the mission."""

_log = logging.getLogger(__name__)


class Listener(Protocol):
    """Who is told what happens; called from the mission's thread."""

    def happened(self, events: Sequence[AnyEvent], at: float) -> None:
        """Events that follow those before are durable since `at` [s, wall clock]."""

    def moved(self, poses: bytes, at: float) -> None:
        """Robots are somewhere else since `at` [s, wall clock], see `pack`."""

    def stands(self, moment: Moment, at: float) -> None:
        """The mission stands so since `at` [s, wall clock], after all events that were told."""

    def ended(self, failure: BaseException | None) -> None:
        """Nothing more will happen: all is done, or why not."""


class Busy(OathError):
    """Too much is asked of the mission at once."""


class Gone(OathError):
    """The mission runs no more."""


@dataclass(frozen=True, slots=True)
class _Request:
    """What somebody asks for, who waits for the answer, and whether it may come early."""

    work: Callable[[], Any]
    answer: Future[Any]
    once_durable: bool


class Owner(threading.Thread):
    """Owns a mission: nobody else touches its runtime, its journal or its conversations.

    What is asked of it waits in a queue and is done between two events. A command is answered as
    soon as it is durable, before its consequences are worked out.

    Parameters
    ----------
    journal
        Where every event is kept before it is applied; closed when the thread ends.
    begin
        Begins the mission, or resumes it after the journal's events; called in this thread. New
        events must pass through what it is given before they are applied.
    listener
        Who is told what happens.
    speed
        Mission seconds per second.
    until_done
        Finish once every task is done or has a reason why not.
    """

    def __init__(
        self,
        journal: Journal,
        begin: Callable[[Sequence[AnyEvent], Happen], Runtime],
        listener: Listener,
        *,
        speed: float = 1.0,
        until_done: bool = False,
    ) -> None:
        super().__init__(name="mission", daemon=True)
        self.clock = Clock(speed=speed)
        self._journal, self._begin = journal, begin
        self._listener, self._until_done = listener, until_done
        self._requests: queue.Queue[_Request | None]
        self._requests = queue.Queue(WAITING)
        self._ready: Future[None] = Future()
        self._runtime: Runtime
        self._last = -1
        self._id: str | None = None
        self._commands: list[dict[str, Any]] = []
        self._asked: _Request | None = None
        self._lost: dict[str, float] = {}
        self._broken = False
        self._told_poses = b""
        self._told: tuple[object, ...] = ()
        self._poses_due = self._moment_due = 0.0
        self._over = self._stopping = False

    # -- for other threads

    def open(self) -> None:
        """Begin or resume the mission; return once it can be asked.

        Raises
        ------
        OathError, OSError
            If that is not possible.
        """
        self.start()
        self._ready.result()

    async def ask(self, work: Callable[[], T], *, once_durable: bool = False) -> T:
        """Let the mission's thread do something between two events; return what that returns.

        Parameters
        ----------
        work
            What to do.
        once_durable
            It is a `command`: answer as soon as its events are durable, before all that follows
            from them is worked out.

        Raises
        ------
        Busy, Gone
            If the mission takes no more requests, now or ever.
        """
        future: Future[T] = Future()
        if self._over:
            raise Gone("the mission has stopped")
        try:
            self._requests.put_nowait(_Request(work, future, once_durable))
        except queue.Full:
            raise Busy("too many requests wait for the mission") from None
        return await asyncio.wrap_future(future)

    def stop(self) -> None:
        """Finish the event in hand, close the journal and end the thread."""
        self._requests.put(None)
        self.join()

    # -- for work that is asked for; in the mission's thread

    @property
    def runtime(self) -> Runtime:
        """The mission that runs."""
        return self._runtime

    @property
    def last(self) -> int:
        """Number of the last event."""
        return self._last

    def moment(self) -> Moment:
        """How the mission stands."""
        live = self._runtime.live()
        poses = self._runtime.poses()
        ways = {
            id: [poses[id].at, *way[1:]]
            for id, way in self._runtime.ways().items()
            if id not in live.state.paused
        }
        return Moment(
            seq=self._last,
            t=live.state.t,
            state=self._runtime.state,
            speed=self.clock.speed,
            paused=self.clock.paused,
            poses=poses,
            ways=ways,
        )

    def command(
        self, commands: Sequence[Command], *, source: str, id: str | None = None
    ) -> tuple[int, bool]:
        """Carry out commands, or repeat the answer if this id was carried out before.

        Returns
        -------
        (int, bool)
            Number of the event that ends what was asked for, and whether that is a repetition.

        Raises
        ------
        BadInput
            If one of them is not possible; then nothing has changed.
        """
        asked = [to_plain(command) for command in commands]
        if id is not None and (known := self._journal.known(id)) is not None:
            if known.value != asked:
                raise BadInput(
                    f"the id {id!r} was used for other commands",
                    field="id",
                    remedy="make a new id for what is new",
                )
            return known.events.stop - 1, True
        if self._runtime.state.finished:
            raise BadInput("the mission is over", remedy="start another")
        self._id, self._commands = id, asked
        try:
            self._runtime.command(commands, source)
        finally:
            self._id = None
        return self._last, False

    def known(self, id: str) -> int | None:
        """The number of the event that ends what was carried out under this id, if it was."""
        known = self._journal.known(id)
        return None if known is None else known.events.stop - 1

    def set_clock(self, speed: float | None, paused: bool | None, step: bool) -> None:
        """Change how the mission clock goes; a step holds it at the next event."""
        if speed is not None:
            self.clock.speed = speed
        if paused is not None or step:
            self.clock.paused = bool(paused) or step
        if self.clock.paused:
            self.clock.t = self._runtime.now
        if step and not self._runtime.state.finished:
            self._runtime.step()
            self.clock.t = self._runtime.now
        self._tell(now=True)

    def finish(self) -> int:
        """End the mission; return the number of the last event."""
        if not self._runtime.state.finished:
            self._runtime.finish()
            self._tell(now=True)
        return self._last

    # -- inside

    def run(self) -> None:
        """Run the mission until it is told to stop."""
        try:
            known = self._journal.replay()
            self._last = len(known) - 1
            self._runtime = self._begin(known, self._happen)
        except BaseException as error:
            self._over = True
            self._ready.set_exception(error)
            return
        self._lost |= {e.robot: e.t for e in self._runtime.events if isinstance(e, RobotFailed)}
        self.clock.t = self._runtime.now
        self._tell(now=True)
        self._ready.set_result(None)
        failure: BaseException | None = None
        try:
            self._serve()
        except BaseException as error:
            failure = error
            _log.error("the mission stopped", exc_info=not isinstance(error, OathError | OSError))
        finally:
            self._over = True
            self._refuse_the_rest()
            self._journal.close()
        self._listener.ended(failure)

    def _serve(self) -> None:
        due = time.monotonic()
        while not self._stopping:
            left = due - time.monotonic()
            if left > 0.0:
                self._answer(wait=left)
                continue
            due = max(due + TICK, time.monotonic())
            if self._tick():
                return

    def _tick(self) -> bool:
        """Bring the mission up to date; return whether it is over and nobody waits for more."""
        self.clock.tick()
        self._runtime.collect()  # also while the clock is held
        self._catch_up()
        self._tell()
        if not self._until_done:
            return False
        state = self._runtime.state
        if not state.allocating and not any(robot.route for robot in state.robots.values()):
            self.finish()
        return self._runtime.state.finished

    def _catch_up(self) -> None:
        """Let everything happen until the clock's time, and answer who asks meanwhile."""
        while not (self.clock.paused or self._stopping or self._runtime.state.finished):
            if not self._runtime.step(self.clock.t):
                return
            self._tell()
            while self._answer():
                pass

    def _answer(self, wait: float = 0.0) -> bool:
        """Do what is asked next, if anything is until some time has gone by [s]."""
        try:
            request = self._requests.get(timeout=wait) if wait else self._requests.get_nowait()
        except queue.Empty:
            return False
        if request is None:
            self._stopping = True
        elif request.answer.set_running_or_notify_cancel():
            self._do(request)
        return True

    def _do(self, request: _Request) -> None:
        self._asked, answer = request, request.answer
        try:
            value = request.work()
        except BaseException as error:
            refused = isinstance(error, BadInput) and not (self._broken or answer.done())
            if not answer.done():
                answer.set_exception(error if refused else Gone("the mission has stopped"))
            if not refused:
                raise
        else:
            if not answer.done():
                answer.set_result(value)
        finally:
            self._asked = None

    def _happen(self, events: Sequence[AnyEvent]) -> None:
        """Make events durable and tell of them; then who asked for them may know."""
        if not events:
            return
        asked = any(isinstance(event, Commanded) for event in events)
        self._broken = True
        id = self._id if asked else None
        last = self._journal.append(events, id=id, answer=self._commands).stop - 1
        self._broken = False
        self._lost |= {event.robot: event.t for event in events if isinstance(event, RobotFailed)}
        self._listener.happened(events, time.monotonic())
        self._last = last
        if asked and self._asked is not None and self._asked.once_durable:
            self._asked.answer.set_result((last, False))

    def _tell(self, *, now: bool = False) -> None:
        """Tell where robots are and how the mission stands, if it is time to."""
        wall = time.monotonic()
        if now or wall >= self._poses_due:
            self._poses_due = max(self._poses_due + POSES_EVERY, wall)
            poses = pack(self._runtime, self._lost)
            if poses != self._told_poses:
                self._told_poses = poses
                self._listener.moved(poses, wall)
        if now or wall >= self._moment_due or self._last - self._told_seq >= EVERY:
            self._moment_due = wall + MOMENTS_EVERY
            told = (self._last, self._runtime.now, self.clock.speed, self.clock.paused)
            if told != self._told:
                self._told = told
                self._listener.stands(self.moment(), wall)

    @property
    def _told_seq(self) -> int:
        return self._told[0] if self._told else -1  # type: ignore[return-value]

    def _refuse_the_rest(self) -> None:
        while True:
            try:
                request = self._requests.get_nowait()
            except queue.Empty:
                return
            if request is not None and request.answer.set_running_or_notify_cancel():
                request.answer.set_exception(Gone("the mission has stopped"))


def pack(runtime: Runtime, lost: Mapping[str, float]) -> bytes:
    """Return where robots are as bytes.

    Little endian: float64 mission time [s], then for every robot in the mission's order float32 x,
    y [m], heading [rad], age [s] of the report: robots that failed report no more.

    Parameters
    ----------
    lost
        When robots failed [s].
    """
    poses, now = runtime.poses(), runtime.now
    values = []
    for robot in runtime.scene.mission.robots:
        pose = poses[robot.id]
        values += [*pose.at, pose.heading, now - lost.get(robot.id, now)]
    return struct.pack(f"<d{len(values)}f", now, *values)
