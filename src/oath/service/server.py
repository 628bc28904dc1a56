"""Puts the server together and runs it until it is told to stop."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import signal
import socket
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import uvicorn

from oath.allocate import Allocator, Budget
from oath.errors import BadInput
from oath.events import AnyEvent, Moved, ObstacleFound, StopServed
from oath.fleet.sim import SimFleet
from oath.instruct import Interpreter
from oath.model import Point
from oath.runtime import Runtime
from oath.scene import Scene
from oath.service.app import create
from oath.service.auth import Access, Pace
from oath.service.feed import Feed
from oath.service.history import EVERY, History
from oath.service.live import MESSAGE
from oath.service.metrics import Metrics
from oath.service.owner import Happen, Owner
from oath.service.snapshot import Moment
from oath.service.talk import Talks
from oath.store import Journal

if TYPE_CHECKING:
    from oath.picture.recording import Recorder

LAST_WORDS = 0.3
"""Clients have so long to hear how a mission ended before the server goes [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Running:
    """What a server runs: a mission made ready, who assigns its tasks, and what records it."""

    scene: Scene
    name: str
    allocator: Allocator
    budget: Budget
    seed: int
    interpreter: Callable[[], Interpreter]
    recorder: Recorder | None = None


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens; port 0 takes a free one.

    Raises
    ------
    BadInput
        If the address cannot be had.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio sends at once only on sockets that say they are TCP; others wait for acknowledgements.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise BadInput(
            f"{host}:{port} cannot be had: {error.strerror}",
            field="--port",
            remedy="choose another port, or 0 for any",
        ) from None
    return listener


def serve(
    running: Running,
    journal: Journal,
    listener: socket.socket,
    access: Access,
    *,
    speed: float = 1.0,
    until_done: bool = False,
    rate: float = 100.0,
    on_ready: Callable[[], None] = lambda: None,
) -> None:
    """Run a mission and its server until SIGINT, SIGTERM or, if so wanted, its last delivery.

    Parameters
    ----------
    running
        The mission; its recording is finished in the end.
    journal
        Where it is kept; if it holds events already, the mission is resumed.
    listener
        Where to listen.
    access
        Who is let in.
    speed
        Mission seconds per second.
    until_done
        Stop once every task is done or has a reason why not.
    rate
        So many requests each client may make [1/s].
    on_ready
        Called once requests are answered.

    Raises
    ------
    OathError, OSError
        If the mission cannot begin, or had to stop.
    """
    server = _Server(running, journal, access, speed, until_done, rate)
    with running.recorder or contextlib.nullcontext():
        asyncio.run(server.serve(listener, on_ready))


class _Server:
    """The event loop's side of a running server: hands what the mission tells to the feed."""

    def __init__(
        self,
        running: Running,
        journal: Journal,
        access: Access,
        speed: float,
        until_done: bool,
        rate: float,
    ) -> None:
        self._running, self._access, self._rate = running, access, rate
        mission = running.scene.mission
        history = History(mission, reconsiders=running.allocator.reconsiders)
        self._feed = Feed(running.scene, history)
        self._owner = Owner(journal, self._begin, self, speed=speed, until_done=until_done)
        self._uvicorn: _Uvicorn | None = None
        self._stopping = False
        self._failure: BaseException | None = None

    async def serve(self, listener: socket.socket, on_ready: Callable[[], None]) -> None:
        self._loop = asyncio.get_running_loop()
        for sign in (signal.SIGINT, signal.SIGTERM):
            self._loop.add_signal_handler(sign, self._stop)
        gc.disable()  # nothing that is read at the start is garbage
        await asyncio.to_thread(self._owner.open)
        gc.freeze()
        gc.enable()
        try:
            metrics = Metrics()
            talks = Talks(self._owner, self._running.interpreter)
            pace = Pace(self._rate, 2 * self._rate)
            app = create(self._feed, self._owner, talks, self._access, pace, metrics)
            config = uvicorn.Config(
                app,
                log_level="warning",
                access_log=False,
                lifespan="off",
                server_header=False,
                proxy_headers=False,
                ws="websockets-sansio",
                ws_max_size=MESSAGE,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=3,
                timeout_keep_alive=30,
            )
            self._uvicorn = _Uvicorn(config)
            self._uvicorn.should_exit = self._stopping
            on_ready()
            await self._uvicorn.serve(sockets=[listener])
        finally:
            gc.unfreeze()
            await asyncio.to_thread(self._owner.stop)
        if self._failure is not None:
            raise self._failure

    def _stop(self) -> None:
        self._stopping = True
        if self._uvicorn is not None:
            self._uvicorn.should_exit = True

    # -- called in the mission's thread

    def _begin(self, events: Sequence[AnyEvent], happen: Happen) -> Runtime:
        if (recorder := self._running.recorder) is not None and events:
            recorder.play(events)
        return begin(self._running, events, self._feed.history, happen)

    def happened(self, events: Sequence[AnyEvent], at: float) -> None:
        self._hand(lambda: self._feed.happened(events, at))
        if (recorder := self._running.recorder) is not None:
            for event in events:
                recorder.event(event)

    def moved(self, poses: bytes, at: float) -> None:
        self._hand(lambda: self._feed.moved(poses, at))
        if (recorder := self._running.recorder) is not None:
            runtime = self._owner.runtime
            now = {id: (*pose.at, pose.heading) for id, pose in runtime.poses().items()}
            recorder.poses(runtime.now, now)

    def stands(self, moment: Moment, at: float) -> None:
        self._hand(lambda: self._feed.stands(moment, at))

    def ended(self, failure: BaseException | None) -> None:
        self._failure = failure
        self._hand(self._end)

    def _hand(self, news: Callable[[], None]) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody listens any more
            self._loop.call_soon_threadsafe(news)

    def _end(self) -> None:
        self._feed.end()
        self._loop.call_later(LAST_WORDS, self._stop)


class _Uvicorn(uvicorn.Server):
    """Leaves signals to the server: one that is told to stop has done well."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def begin(
    running: Running, events: Sequence[AnyEvent], history: History, happen: Happen
) -> Runtime:
    """Begin a mission, or resume it after these events, its robots where they were last seen.

    Parameters
    ----------
    running
        The mission.
    events
        What the journal holds.
    history
        Takes note of these events.
    happen
        What new events must pass through before they are applied.
    """
    mission = running.scene.mission
    positions: dict[str, Point] = {}
    found = set()
    for event in events:
        match event:
            case Moved():
                positions[event.robot] = event.to
            case StopServed():
                positions[event.robot] = event.at
            case ObstacleFound():
                found.add(event.obstacle)
            case _:
                pass
    now = max((event.t for event in events), default=0.0)
    runtime = Runtime(
        running.scene,
        SimFleet(mission, now=now, positions=positions, found=found),
        name=running.name,
        allocator=running.allocator,
        budget=running.budget,
        seed=running.seed,
        journal=happen,
        solver=ThreadPoolExecutor(1, thread_name_prefix="solver"),
    )
    if not events:
        runtime.start()
        return runtime

    for first in range(0, len(events), EVERY):
        some = events[first : first + EVERY]
        runtime.follow(some)
        history.add(some)
        history.stands(runtime.state)
    runtime.resume()
    return runtime
