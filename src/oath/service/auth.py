"""Who may ask what: tokens and roles, where requests come from, how much and how often."""

from __future__ import annotations

import hmac
import ipaddress
import re
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from typing import Literal

from oath.errors import BadInput

Role = Literal["operator", "viewer"]

COOKIE = "oath_token"
BEARER = "bearer."
"""Before the token among the subprotocols of a socket."""

BODY = 64 * 1024
"""Largest body of a request [bytes]."""

CLIENTS = 10_000
"""Of so many clients the pace is known; then those not heard of lately are forgotten."""

HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "x-frame-options": "DENY",
    "cache-control": "no-store",
}
"""Of every response; one that has its own value of a header keeps it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """Who is let in.

    Attributes
    ----------
    operator, viewer
        Their tokens; None = nobody is a viewer.
    hosts
        Names that requests may be addressed to; None = any address that is a number.
    port
        Port of the server.
    """

    operator: str = field(repr=False)
    viewer: str | None = field(default=None, repr=False)
    hosts: frozenset[str] = frozenset()
    any_address: bool = False
    port: int = 8080

    def role(self, token: str | None) -> Role | None:
        """The role that a token gives, in a time that does not tell how much of it is right."""
        if token is None:
            return None
        given = token.encode()
        operator = hmac.compare_digest(given, self.operator.encode())
        viewer = hmac.compare_digest(given, (self.viewer or self.operator).encode())
        return "operator" if operator else "viewer" if viewer else None

    def is_own(self, host: str | None) -> bool:
        """Whether a request's Host header names this server."""
        match = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[^:\[\]]+)(?::(\d{1,5}))?", host or "")
        if match is None or int(match[2] or 80) != self.port:
            return False
        name = match[1].strip("[]").lower()
        return name in self.hosts or (self.any_address and _is_address(name))

    def is_same_origin(self, origin: str | None, host: str | None) -> bool:
        """Whether a page that sends this Origin header, if any, came from this server."""
        return origin is None or origin.lower() == f"http://{host}".lower()


LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})


def access(
    *, host: str, port: int, token: str | None = None, viewer: str | None = None
) -> tuple[Access, bool]:
    """Return who is let in to a server at this address, and whether the token was made up.

    Raises
    ------
    BadInput
        If a token is weak, or none is given though others than this machine can connect.
    """
    if token is None and host not in LOOPBACK:
        raise BadInput(
            f"others can connect to {host}, so they need a token that you choose",
            field="--token",
            remedy="give --token, or leave out --host",
        )
    for name, value in (("--token", token), ("--viewer-token", viewer)):
        if value is not None and not re.fullmatch(r"[A-Za-z0-9._~-]{8,200}", value):
            raise BadInput(
                "a token must have at least 8 letters, digits, '.', '_', '~' and '-'",
                field=name,
                remedy="choose another",
            )
    if token is not None and token == viewer:
        raise BadInput("both tokens are the same", field="--viewer-token", remedy="change one")
    names = LOOPBACK | {host.lower()}
    made = token or secrets.token_urlsafe(24)
    any_address = host in ("0.0.0.0", "::")
    return (
        Access(operator=made, viewer=viewer, hosts=names, any_address=any_address, port=port),
        token is None,
    )


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def tokens(headers: Mapping[str, str]) -> Iterator[str]:
    """Yield every token that a request brings: as bearer, as cookie, as a socket's subprotocol."""
    scheme, _, given = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        yield given.strip()
    try:
        cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        cookie = None
    if cookie is not None:
        yield cookie.value
    for protocol in headers.get("sec-websocket-protocol", "").split(","):
        if protocol.strip().startswith(BEARER):
            yield protocol.strip().removeprefix(BEARER)


class Pace:
    """Lets every client do so much in a while: a bucket of `burst` that refills at `rate` [1/s]."""

    def __init__(
        self, rate: float, burst: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.rate, self.burst, self._clock = rate, burst, clock
        self._left: dict[str, tuple[float, float]] = {}

    def allows(self, client: str) -> bool:
        """Whether a client may go on; counts as done if so."""
        now = self._clock()
        left, seen = self._left.pop(client, (self.burst, now))
        left = min(self.burst, left + (now - seen) * self.rate)
        allowed = left >= 1.0
        self._left[client] = (left - allowed, now)
        if len(self._left) > CLIENTS:
            del self._left[next(iter(self._left))]
        return allowed
