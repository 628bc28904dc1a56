"""Stands before the application: nothing gets in that is not allowed to, nothing out unmarked."""

from __future__ import annotations

from collections.abc import Iterable
from http import HTTPStatus
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from oath.service.auth import BODY, COOKIE, HEADERS, Access, Pace, Role, tokens
from oath.service.metrics import Metrics

_HOW = """<!doctype html><meta charset="utf-8"><title>OATH</title>
<h1>This console needs its token</h1>
<p>Open the link that <code>oath serve</code> printed when it started, with <code>?token=...</code>
at its end. Programs send the header <code>Authorization: Bearer ...</code>.</p>
"""


def failure(status: int, problem: str, remedy: str = "", field: str | None = None) -> Response:
    """Return an error as every route tells it."""
    error = {"problem": problem, "field": field, "remedy": remedy}
    return JSONResponse({"error": error}, status)


class Guard:
    """Checks every request and socket before the application sees it, and marks every response.

    Parameters
    ----------
    app
        What it guards.
    access
        Who is let in.
    pace
        How often each client may ask.
    metrics
        Counts what comes in.
    """

    def __init__(self, app: ASGIApp, access: Access, pace: Pace, metrics: Metrics) -> None:
        self._app, self._access, self._pace, self._metrics = app, access, pace, metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, or answer it here."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        send = self._marked(scope, send)
        headers = Headers(scope=scope)
        role = self._role(headers)
        refusal = self._refusal(scope, headers, role)
        if refusal is None and scope["type"] == "http":
            body = await _body(headers, receive)
            if body is None:
                refusal = failure(413, f"the body is larger than {BODY} bytes", "send less")
            else:
                receive = _again(body, receive)
        if refusal is not None:
            await refusal(scope, receive, send)
            return
        scope.setdefault("state", {})["role"] = role
        await self._app(scope, receive, send)

    def _role(self, headers: Headers) -> Role | None:
        return _best(self._access.role(token) for token in tokens(headers))

    def _refusal(self, scope: Scope, headers: Headers, role: Role | None) -> Response | None:
        host = headers.get("host")
        if not self._access.is_own(host):
            return failure(403, "this is not the host that was asked for", "use the server's name")
        if not self._access.is_same_origin(headers.get("origin"), host):
            return failure(403, "another site asks", "open the console of this server")
        who = f"{(scope.get('client') or ('?',))[0]} {role}"
        if not self._pace.allows(who):
            refusal = failure(429, "too many requests", "wait a little")
            refusal.headers["retry-after"] = "1"
            return refusal
        if role is None:
            return self._entry(scope)
        if role == "viewer" and scope["type"] == "http" and scope["method"] not in _READS:
            return failure(403, "viewers change nothing", "use the operator's token")
        query = parse_qs(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        if twice := next((name for name, values in query.items() if len(values) > 1), None):
            return failure(422, f"{twice!r} is given more than once", "give it once", twice)
        return None

    def _entry(self, scope: Scope) -> Response:
        """Answer somebody without a valid token: whoever brings one in the link gets in."""
        is_page = scope["type"] == "http" and scope["path"] == "/" and scope["method"] == "GET"
        if not is_page:
            refusal = failure(401, "a valid token is needed", "send Authorization: Bearer TOKEN")
            refusal.headers["www-authenticate"] = "Bearer"
            return refusal
        return self.welcome(scope) or HTMLResponse(_HOW, 401)

    def welcome(self, scope: Scope) -> Response | None:
        """Put a right token of a page's link into a cookie, and out of sight."""
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        if not given or self._access.role(given[0]) is None:
            return None
        response = RedirectResponse("/", 303)
        response.set_cookie(COOKIE, given[0], path="/", httponly=True, samesite="strict")
        return response

    def _marked(self, scope: Scope, send: Send) -> Send:
        async def marked(message: Message) -> None:
            if message["type"] in ("http.response.start", "websocket.http.response.start"):
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
                self._metrics.answered(scope.get("method", "SOCKET"), message["status"])
            await send(message)

        return marked


_READS = ("GET", "HEAD", "OPTIONS")


def _best(roles: Iterable[Role | None]) -> Role | None:
    found = set(roles)
    return "operator" if "operator" in found else "viewer" if "viewer" in found else None


async def _body(headers: Headers, receive: Receive) -> bytes | None:
    """Return a request's body; None if it is too large."""
    length = headers.get("content-length", "0")
    if not length.isdigit() or int(length) > BODY:
        return None
    body = b""
    while True:
        message = await receive()
        body += bytes(message.get("body", b""))
        if len(body) > BODY:
            return None
        if not message.get("more_body"):
            return body


def _again(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that gives the body once more."""
    left: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def again() -> Message:
        return left.pop() if left else await receive()

    return again


def phrase(status: int) -> str:
    """The usual words of a status, e.g. ``not found``."""
    return HTTPStatus(status).phrase.lower()
