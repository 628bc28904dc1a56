"""Nobody gets in who is not allowed to: over HTTP and through the socket."""

from __future__ import annotations

import http.client
import socket
from collections.abc import Iterator

import httpx
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from service.servers import OPERATOR, VIEWER, Server, serving


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving() as server:
        yield server


def routes(server: Server) -> list[tuple[str, str]]:
    """Every route: method and path."""
    with server.client() as client:
        paths = client.get("/api/openapi.json").json()["paths"]
    found = [(method.upper(), path) for path, methods in paths.items() for method in methods]
    return [*found, ("GET", "/"), ("GET", "/static/main.js"), ("GET", "/api/openapi.json")]


def ask(server: Server, method: str, path: str, headers: dict[str, str]) -> httpx.Response:
    with httpx.Client(base_url=server.url, timeout=60, trust_env=False) as client:
        return client.request(method, path, headers=headers, json={} if method == "POST" else None)


BEARER = {"Authorization": f"Bearer {OPERATOR}"}


def test_there_are_routes(server: Server) -> None:
    assert len(routes(server)) >= 17


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Authorization": "Bearer wrong-token"},
        {"Authorization": f"Bearer {OPERATOR}x"},
        {"Authorization": f"Basic {OPERATOR}"},
        {"Authorization": OPERATOR},
        {"Cookie": "oath_token=wrong-token"},
        {"Cookie": f"token={OPERATOR}"},
    ],
)
def test_no_route_without_the_token(server: Server, headers: dict[str, str]) -> None:
    for method, path in routes(server):
        answer = ask(server, method, path, headers)
        assert answer.status_code == 401, (method, path)
        assert "oath_token" not in answer.headers.get("set-cookie", "")


def test_no_route_from_another_site_or_under_another_name(server: Server) -> None:
    for method, path in routes(server):
        for headers in (
            {"Origin": "http://evil.example"},
            {"Origin": "null"},
            {"Origin": f"https://127.0.0.1:{server.port}"},
            {"Host": "evil.example"},
            {"Host": f"evil.example:{server.port}"},
            {"Host": "127.0.0.1:1"},
        ):
            answer = ask(server, method, path, {**BEARER, **headers})
            assert answer.status_code == 403, (method, path, headers)


def test_a_viewer_changes_nothing(server: Server) -> None:
    for method, path in routes(server):
        answer = ask(server, method, path, {"Authorization": f"Bearer {VIEWER}"})
        assert (answer.status_code == 403) == (method == "POST"), (method, path)
    with server.client(VIEWER) as client:
        assert client.get("/api/me").json() == {"role": "viewer"}


def test_own_origin_is_welcome(server: Server) -> None:
    assert ask(server, "GET", "/api/me", {**BEARER, "Origin": server.url}).status_code == 200


def test_the_link_becomes_a_cookie(server: Server) -> None:
    with httpx.Client(base_url=server.url, trust_env=False) as client:
        page = client.get("/")
        assert page.status_code == 401
        assert "token" in page.text
        assert client.get("/", params={"token": "wrong-token"}).status_code == 401
        welcome = client.get("/", params={"token": OPERATOR})
        assert welcome.status_code == 303
        assert welcome.headers["location"] == "/"
        cookie = welcome.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert "path=/" in cookie
        assert client.get("/api/me").json() == {"role": "operator"}


def test_every_answer_is_marked(server: Server) -> None:
    answers = [
        ask(server, "GET", "/api/state", BEARER),
        ask(server, "GET", "/api/state", {}),
        ask(server, "GET", "/nothing", BEARER),
        ask(server, "GET", "/", {}),
    ]
    for answer in answers:
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self'" in policy
        assert "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert answer.headers["cross-origin-opener-policy"] == "same-origin"
        assert "server" not in answer.headers


def test_large_bodies(server: Server) -> None:
    with server.client() as client:
        large = b'{"text":"' + b"x" * 70_000 + b'"}'
        assert client.post("/api/instructions", content=large).status_code == 413
        parts = iter([large[:40_000], large[40_000:]])  # in chunks: without a length
        assert client.post("/api/instructions", content=parts).status_code == 413
        assert client.post("/api/finish", content=b"x" * 65_536).status_code in (400, 422)


def test_a_body_that_lies_about_its_length(server: Server) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    connection.putrequest("POST", "/api/finish")
    connection.putheader("Authorization", f"Bearer {OPERATOR}")
    connection.putheader("Content-Length", "99999999")
    connection.endheaders()
    assert connection.getresponse().status == 413
    connection.close()


def test_too_many_requests() -> None:
    with serving("missions/maze-25.yaml", "--rate", "5") as server, server.client() as client:
        statuses = [client.get("/api/health").status_code for _ in range(30)]
        assert statuses[:5] == [200] * 5
        assert 429 in statuses
        with server.client(VIEWER) as viewer:
            assert viewer.get("/api/health").status_code == 200
        # Guessing tokens does not shut out those who have one, and is slow itself.
        with server.client("wrong-token-1") as guesser:
            assert 429 in [guesser.get("/api/health").status_code for _ in range(30)]


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 401),
        ({"Authorization": "Bearer wrong-token"}, 401),
        ({"Cookie": "oath_token=wrong-token"}, 401),
        ({**BEARER, "Origin": "http://evil.example"}, 403),
    ],
)
def test_no_socket_either(server: Server, headers: dict[str, str], status: int) -> None:
    with (
        pytest.raises(InvalidStatus) as error,
        connect(server.socket_url, additional_headers=headers, proxy=None),
    ):
        pass
    assert error.value.response.status_code == status


def test_no_socket_under_another_name(server: Server) -> None:
    url = f"ws://evil.example:{server.port}/api/live"
    here = socket.create_connection(("127.0.0.1", server.port))
    with (
        pytest.raises(InvalidStatus) as error,
        connect(url, additional_headers=BEARER, proxy=None, sock=here),
    ):
        pass
    assert error.value.response.status_code == 403


@pytest.mark.parametrize(
    "way",
    [
        {"additional_headers": BEARER},
        {"additional_headers": {"Cookie": f"oath_token={VIEWER}"}},
        {"subprotocols": ["oath", f"bearer.{OPERATOR}"]},
    ],
)
def test_ways_into_the_socket(server: Server, way: dict[str, object]) -> None:
    with connect(server.socket_url, proxy=None, **way) as live:  # type: ignore[arg-type]
        assert '"type":"hello"' in str(live.recv(60))
        assert live.subprotocol in ("oath", None)


def test_a_made_up_token_is_printed_once() -> None:
    with serving(token=None) as server:
        assert len(server.token) >= 32
        assert server.get("/api/me") == {"role": "operator"}
        server.stop()
        assert server.process.stdout is not None
        assert server.process.stderr is not None
        assert server.token not in server.process.stdout.read() + server.process.stderr.read()
