"""The socket: events, states and poses as they come, to everybody at their own pace."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time

from starlette.websockets import WebSocket, WebSocketDisconnect

from oath.service.auth import Pace
from oath.service.feed import Feed, to_json
from oath.service.metrics import Metrics

SOCKETS = 64
"""At most so many clients listen at once."""

MESSAGE = 1024
"""Longest message that a client may send [bytes]."""

SLOW = 20.0
"""A client that takes nothing for so long is dropped [s]."""

PROTOCOL = "oath"


class Live:
    """Tells one client after the other what happens.

    Parameters
    ----------
    feed
        What there is to tell.
    metrics
        Counts how late clients hear of events.
    """

    def __init__(self, feed: Feed, metrics: Metrics) -> None:
        self._feed, self._metrics = feed, metrics

    async def serve(self, socket: WebSocket, since: int) -> None:
        """Tell a client all events after a number, and then everything as it comes."""
        if self._feed.listeners >= SOCKETS:
            await socket.close(1013, "too many clients")
            return
        offered = socket.scope.get("subprotocols", [])
        await socket.accept(PROTOCOL if PROTOCOL in offered else None)
        with self._feed.listening() as wake:
            tasks = [
                asyncio.create_task(self._tell(socket, since, wake)),
                asyncio.create_task(self._listen(socket)),
            ]
            try:
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                results = await asyncio.gather(*tasks, return_exceptions=True)
        code = next((result for result in results if isinstance(result, int)), 1011)
        with contextlib.suppress(RuntimeError, WebSocketDisconnect):
            await socket.close(code)

    async def _listen(self, socket: WebSocket) -> int:
        """Hear what a client says; return the code to close with."""
        pace = Pace(5.0, 20.0)
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return 1000
            text = message.get("text")
            if text is None:
                return 1003
            if len(text) > MESSAGE or not pace.allows(""):
                return 1008
            try:
                said = json.loads(text)
            except (ValueError, RecursionError):
                return 1007
            if not isinstance(said, dict) or said.get("type") != "ping":
                return 1008
            await socket.send_text('{"type":"pong"}')

    async def _tell(self, socket: WebSocket, since: int, wake: asyncio.Event) -> int:
        """Tell a client everything; return the code to close with."""
        feed = self._feed
        assert feed.moment is not None
        await self._send(socket, _hello(feed, socket))
        cursor = max(min(since, feed.last), -1)
        moment, poses, clock = None, b"", None
        while True:
            await wake.wait()
            wake.clear()
            while cursor < feed.last:
                known_at = feed.known_at(cursor + 1)
                cursor, page = feed.page(cursor)
                await self._send(socket, f'{{"type":"events","events":{page}}}')
                if known_at is not None:
                    self._late("events", known_at)
            if feed.moment is not moment:
                moment = feed.moment
                if clock != (moment.speed, moment.paused):
                    clock = moment.speed, moment.paused
                    frame = {"type": "clock", "speed": moment.speed, "paused": moment.paused}
                    await self._send(socket, to_json(frame))
                known_at = feed.moment_at
                await self._send(socket, feed.state_frame(moment))
                self._late("state", known_at)
            if feed.poses is not poses:
                poses, known_at = feed.poses, feed.poses_at
                await self._send(socket, poses)
                self._late("poses", known_at)
            if feed.ended and cursor == feed.last:
                return 1001

    def _late(self, frame: str, known_at: float) -> None:
        self._metrics.lag[frame].add(time.monotonic() - known_at)

    async def _send(self, socket: WebSocket, frame: str | bytes) -> None:
        async with asyncio.timeout(SLOW):
            if isinstance(frame, str):
                await socket.send_text(frame)
            else:
                await socket.send_bytes(frame)


def _hello(feed: Feed, socket: WebSocket) -> str:
    assert feed.moment is not None
    return to_json(
        {
            "type": "hello",
            "seq": feed.last,
            "t": feed.moment.t,
            "role": socket.scope["state"]["role"],
            "robots": [robot.id for robot in feed.scene.mission.robots],
        }
    )
