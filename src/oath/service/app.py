"""The routes of the mission server."""

from __future__ import annotations

import asyncio
import mimetypes
import re
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Depends, FastAPI, Header, Query, Request, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import PlainTextResponse, Response
from fastapi.security import HTTPBearer
from starlette.exceptions import HTTPException

from oath.commands import parse
from oath.errors import BadInput
from oath.service import shapes
from oath.service.auth import BODY, Access, Pace
from oath.service.feed import PAGE, Feed, to_json
from oath.service.guard import Guard, failure, phrase
from oath.service.live import Live
from oath.service.metrics import Metrics
from oath.service.owner import Busy, Gone, Owner
from oath.service.snapshot import mission_of, state_of
from oath.service.talk import Talks

T = TypeVar("T")

CONSOLE = Path(__file__).with_name("console")

PROBLEMS: dict[int | str, dict[str, Any]] = {
    400: {"model": shapes.Error, "description": "What was sent cannot be read"},
    401: {"model": shapes.Error, "description": "No valid token"},
    403: {"model": shapes.Error, "description": "Not allowed, or from another site"},
    413: {"model": shapes.Error, "description": f"A body of more than {BODY} bytes"},
    422: {"model": shapes.Error, "description": "A value is wrong"},
    429: {"model": shapes.Error, "description": "Too many requests"},
    503: {"model": shapes.Error, "description": "The mission has stopped"},
}
ABSENT: dict[int | str, dict[str, Any]] = {
    404: {"model": shapes.Error, "description": "There is no such thing"}
}
CONFLICT: dict[int | str, dict[str, Any]] = {
    409: {"model": shapes.Error, "description": "Not possible as the mission stands"}
}

Window = Annotated[
    str,
    Header(
        alias="Oath-Window",
        pattern=r"^[A-Za-z0-9._-]{0,64}$",
        description="which of the operator's windows talks; each has its own conversation",
    ),
]


def create(
    feed: Feed, owner: Owner, talks: Talks, access: Access, pace: Pace, metrics: Metrics
) -> Guard:
    """Return the whole application, guarded.

    Parameters
    ----------
    feed, owner, talks
        What happens, who runs the mission, and who talks with operators.
    access, pace
        Who is let in, and how often.
    metrics
        Counts what the server does.
    """
    app = FastAPI(
        title="OATH mission server",
        version="1",
        description="Runs a mission and takes changes to it.",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
    )
    for kind, answer in _FAILURES.items():
        app.add_exception_handler(kind, answer)
    app.include_router(_pages())
    app.include_router(_reading(feed, owner, metrics))
    app.include_router(_asking(owner, talks, metrics))
    live = Live(feed, metrics)

    @app.websocket("/api/live")
    async def _(socket: WebSocket) -> None:
        since = socket.query_params.get("since", "-1")
        if not re.fullmatch(r"-1|\d{1,12}", since):
            await socket.close(1008, "since must be a whole number from -1")
            return
        await live.serve(socket, int(since))

    return Guard(app, access, pace, metrics)


def _router() -> APIRouter:
    bearer = HTTPBearer(auto_error=False, description="the token that the server printed")
    return APIRouter(dependencies=[Depends(bearer)], responses=PROBLEMS)


def _raw(text: str) -> Response:
    return Response(text, media_type="application/json")


def _shape(model: type[Any]) -> dict[str, Any]:
    """Describe a response that is sent as it is."""
    return {"response_class": Response, "responses": {200: {"model": model}}}


# -- pages


def _pages() -> APIRouter:
    router = APIRouter(include_in_schema=False)

    @router.get("/")
    async def console() -> Response:
        return _file("index.html")

    @router.get("/static/{name}")
    async def static(name: str) -> Response:
        return _file(name)

    return router


def _file(name: str) -> Response:
    kind = mimetypes.guess_type(name)[0]
    path = CONSOLE / name
    if not re.fullmatch(r"[a-z0-9_-]+\.[a-z0-9]+", name) or kind is None or not path.is_file():
        raise HTTPException(404)
    return Response(path.read_bytes(), media_type=kind, headers={"cache-control": "no-cache"})


# -- routes that change nothing


def _reading(feed: Feed, owner: Owner, metrics: Metrics) -> APIRouter:
    router = _router()
    mission = feed.scene.mission
    fixed = to_json(mission_of(mission))

    @router.get("/api/health", **_shape(shapes.Health))
    async def health() -> Response:
        """Whether the server works."""
        return _raw(to_json({"status": "ok", "mission": mission.name, "seq": feed.last}))

    @router.get("/api/me", **_shape(shapes.Me))
    async def me(request: Request) -> Response:
        """Who asks."""
        return _raw(to_json({"role": request.state.role}))

    @router.get("/api/missions", **_shape(shapes.Missions))
    async def missions() -> Response:
        """The missions of this server."""
        assert feed.moment is not None
        state = feed.moment.state
        line = {
            "name": mission.name,
            "running": not state.finished,
            "tasks": len(state.tasks),
            "completed": len(state.completed),
            "robots": len(state.robots),
        }
        return _raw(to_json({"missions": [line]}))

    @router.get("/api/mission", **_shape(shapes.Mission))
    async def the_mission() -> Response:
        """What does not change while the mission runs."""
        return _raw(fixed)

    @router.get("/api/roadmap", **_shape(shapes.Roadmap))
    async def roadmap() -> Response:
        """Where robots can drive now."""

        def read() -> str:
            graph = owner.runtime.scene.world.roadmap
            nodes = graph.nodes().round(3).tolist()
            return to_json({"nodes": nodes, "edges": graph.edges().tolist()})

        return _raw(await owner.ask(read))

    @router.get("/api/state", **_with(_shape(shapes.State), ABSENT))
    async def state(
        seq: Annotated[int | None, Query(ge=-1, description="as it was after this event")] = None,
    ) -> Response:
        """The mission now, or as it was."""
        if seq is None:
            return _raw(feed.state(await owner.ask(owner.moment)))
        if seq > feed.last:
            raise HTTPException(404, f"the last event is {feed.last}")
        return _raw(feed.past(seq))

    @router.get("/api/events", **_shape(shapes.Events))
    async def events(
        since: Annotated[int, Query(ge=-1, description="only events after this one")] = -1,
        limit: Annotated[int, Query(ge=1, le=PAGE)] = PAGE,
    ) -> Response:
        """Events in order."""
        _, page = feed.page(min(since, feed.last), limit)
        return _raw(f'{{"events":{page},"last":{feed.last}}}')

    @router.get(
        "/api/metrics",
        response_class=Response,
        responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
    )
    async def numbers() -> Response:
        """What the server counts, for Prometheus."""
        assert feed.moment is not None
        plain = state_of(feed.scene, feed.moment, feed.history.tally)
        text = metrics.text(
            t=feed.moment.t,
            events=feed.last + 1,
            sockets=feed.listeners,
            tasks=Counter(task["status"] for task in plain["tasks"]),
            robots=Counter(robot["status"] for robot in plain["robots"]),
        )
        return PlainTextResponse(text)

    return router


def _with(route: dict[str, Any], more: dict[int | str, dict[str, Any]]) -> dict[str, Any]:
    return {**route, "responses": {**route["responses"], **more}}


# -- routes that change the mission


def _asking(owner: Owner, talks: Talks, metrics: Metrics) -> APIRouter:
    router = _router()

    async def timed(answer: Awaitable[T]) -> T:
        begin = time.monotonic()
        value = await answer
        metrics.command.add(time.monotonic() - begin)
        return value

    @router.post("/api/instructions", **_with(_shape(shapes.Replied), CONFLICT))
    async def instruct(said: shapes.Instruction, window: Window = "") -> Response:
        """Say something in words; nothing happens before the proposal is confirmed, but a pause."""
        heard = await _possible(owner.ask(lambda: talks.hear(window, said.text)))
        if callable(heard):
            # A language model may take seconds; the mission does not wait for it.
            understood = await asyncio.to_thread(heard)
            heard = await _possible(owner.ask(lambda: talks.take(window, understood)))
        return _raw(to_json({"reply": heard}))

    @router.post("/api/proposals", **_with(_shape(shapes.Replied), CONFLICT))
    async def propose(asked: shapes.Commands, window: Window = "") -> Response:
        """Have commands read back, as if they had been said in words."""
        commands = [parse(dict(command)) for command in asked.commands]
        reply = await _possible(owner.ask(lambda: talks.propose(window, commands)))
        return _raw(to_json({"reply": reply}))

    @router.post("/api/proposals/{id}/confirm", **_with(_shape(shapes.Done), CONFLICT))
    async def confirm(id: str, nothing: shapes.Nothing, window: Window = "") -> Response:
        """Carry out a proposal; the answer comes once that is durable."""
        work = owner.ask(lambda: talks.confirm(window, id), once_durable=True)
        seq, _ = await timed(_possible(work))
        return _raw(to_json({"seq": seq}))

    @router.post("/api/proposals/{id}/reject", **_with(_shape(shapes.Nothing), CONFLICT))
    async def reject(id: str, nothing: shapes.Nothing, window: Window = "") -> Response:
        """Drop a proposal."""
        await _possible(owner.ask(lambda: talks.reject(window, id)))
        return _raw("{}")

    @router.post("/api/commands", **_with(_shape(shapes.Commanded), CONFLICT))
    async def command(asked: shapes.IdentifiedCommands) -> Response:
        """Carry out commands of another system at once; the answer comes once they are durable."""
        commands = [parse(dict(one)) for one in asked.commands]
        work = owner.ask(
            lambda: owner.command(commands, source="api", id=asked.id), once_durable=True
        )
        seq, repeated = await timed(_possible(work))
        return _raw(to_json({"seq": seq, "repeated": repeated}))

    @router.post("/api/clock", **_shape(shapes.Clock))
    async def clock(change: shapes.ClockChange) -> Response:
        """Change how the mission clock goes."""

        def work() -> dict[str, Any]:
            owner.set_clock(change.speed, change.paused, bool(change.step))
            return {"speed": owner.clock.speed, "paused": owner.clock.paused}

        return _raw(to_json(await owner.ask(work)))

    @router.post("/api/finish", **_shape(shapes.Done))
    async def finish(nothing: shapes.Nothing) -> Response:
        """End the mission."""
        return _raw(to_json({"seq": await owner.ask(owner.finish)}))

    return router


class _Conflict(Exception):
    """Something that is well said is not possible as the mission stands."""

    def __init__(self, error: BadInput) -> None:
        self.error = error


async def _possible(work: Awaitable[T]) -> T:
    try:
        return await work
    except BadInput as error:
        raise _Conflict(error) from None


# -- failures


def _answer_validation(request: Request, error: Any) -> Response:
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"][1:] if not isinstance(part, int))
    if first["type"] == "json_invalid":
        return failure(400, "the body is no JSON", "send a JSON object")
    return failure(422, first["msg"], "see /api/openapi.json", where or None)


def _answer_bad_input(request: Request, error: Any) -> Response:
    return failure(422, error.problem, error.remedy, error.field)


def _answer_conflict(request: Request, error: Any) -> Response:
    return failure(409, error.error.problem, error.error.remedy, error.error.field)


def _answer_http(request: Request, error: Any) -> Response:
    usual = error.detail == phrase(error.status_code)
    problem = phrase(error.status_code) if usual else str(error.detail).lower()
    response = failure(error.status_code, problem, "see /api/openapi.json")
    response.headers.update(error.headers or {})
    return response


def _answer_busy(request: Request, error: Any) -> Response:
    response = failure(429, str(error), "wait a little")
    response.headers["retry-after"] = "1"
    return response


def _answer_gone(request: Request, error: Any) -> Response:
    return failure(503, str(error), "start the server again")


_FAILURES: dict[type[Exception], Callable[[Request, Any], Response]] = {
    RequestValidationError: _answer_validation,
    BadInput: _answer_bad_input,
    _Conflict: _answer_conflict,
    HTTPException: _answer_http,
    Busy: _answer_busy,
    Gone: _answer_gone,
}
