"""The socket of a running server."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from service.servers import MAZE, OPERATOR, VIEWER, Server, serving

TIMEOUT = 60.0


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving(MAZE, "--speed", "10", "--allocator", "greedy") as server:
        yield server


def listening(server: Server, since: int | str = -1, token: str = OPERATOR) -> ClientConnection:
    headers = {"Authorization": f"Bearer {token}"}
    url = f"{server.socket_url}?since={since}"
    return connect(url, additional_headers=headers, max_size=None, proxy=None)


def frame(socket: ClientConnection) -> Any:
    message = socket.recv(TIMEOUT)
    return message if isinstance(message, bytes) else json.loads(message)


def until(socket: ClientConnection, type: str) -> Any:
    """The next frame of this type."""
    while True:
        found = frame(socket)
        if isinstance(found, dict) and found["type"] == type:
            return found


def events(socket: ClientConnection, count: int) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    while len(found) < count:
        found += until(socket, "events")["events"]
    return found


def test_hello(server: Server) -> None:
    with listening(server, token=VIEWER) as socket:
        hello = frame(socket)
    assert hello["type"] == "hello"
    assert hello["role"] == "viewer"
    assert hello["robots"] == ["robot1", "robot2", "robot3", "robot4"]


def test_all_events_in_order_without_gaps(server: Server) -> None:
    with listening(server) as socket:
        found = events(socket, 60)
    assert [event["seq"] for event in found] == list(range(len(found)))
    assert found == server.get("/api/events", limit=len(found))["events"]


def test_a_client_goes_on_where_it_was(server: Server) -> None:
    with listening(server) as socket:
        before = events(socket, 10)
    with listening(server, since=before[-1]["seq"]) as socket:
        after = events(socket, 5)
    seqs = [event["seq"] for event in before + after]
    assert seqs == list(range(len(seqs)))


def test_states_follow_their_events(server: Server) -> None:
    with listening(server) as socket:
        last, states = -1, []
        while len(states) < 4:
            found = frame(socket)
            if isinstance(found, bytes):
                continue
            if found["type"] == "events":
                last = found["events"][-1]["seq"]
            elif found["type"] == "state":
                assert found["state"]["seq"] <= last
                states.append(found["state"])
    assert [state["t"] for state in states] == sorted(state["t"] for state in states)
    assert set(states[0]) == set(server.get("/api/state"))


def test_poses(server: Server) -> None:
    with listening(server) as socket:
        found: list[bytes] = []
        while len(found) < 5:
            message = socket.recv(TIMEOUT)
            if isinstance(message, bytes):
                found.append(message)
    assert all(len(message) == 8 + 4 * 16 for message in found)
    times = [struct.unpack_from("<d", message)[0] for message in found]
    assert times == sorted(times)
    for x, y, heading, age in struct.iter_unpack("<4f", found[-1][8:]):
        assert 0 <= x <= 20
        assert 0 <= y <= 20
        assert -4 < heading < 4
        assert age == 0


def test_the_clock_is_told(server: Server) -> None:
    with listening(server) as socket:
        assert until(socket, "clock")["paused"] is False
        server.post("/api/clock", {"paused": True})
        assert until(socket, "clock")["paused"] is True
        server.post("/api/clock", {"paused": False})
        assert until(socket, "clock") == {"type": "clock", "speed": 10.0, "paused": False}


def test_a_command_is_told_to_everybody(server: Server) -> None:
    last = server.get("/api/health")["seq"]
    with listening(server, since=last) as one, listening(server, since=last) as other:
        seq = server.command("told", "pause_robot", robot="robot4").json()["seq"]
        for socket in (one, other):
            while (event := until(socket, "events")["events"])[-1]["seq"] < seq:
                pass
            assert any(line["seq"] <= seq for line in event)


def test_ping(server: Server) -> None:
    with listening(server) as socket:
        socket.send('{"type":"ping"}')
        assert until(socket, "pong") == {"type": "pong"}


@pytest.mark.parametrize(
    ("message", "code"),
    [
        ("no json", 1007),
        ("[]", 1008),
        ('{"type":"command"}', 1008),
        (b"\0", 1003),
        ('{"type":"ping","more":"' + "x" * 2000 + '"}', 1009),
        ("[" * 1000, 1007),
    ],
)
def test_what_a_client_may_not_say(server: Server, message: str | bytes, code: int) -> None:
    with listening(server) as socket:
        socket.send(message)
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                socket.recv(TIMEOUT)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == code


def test_a_client_that_says_too_much(server: Server) -> None:
    with listening(server) as socket, pytest.raises(ConnectionClosed) as closed:
        for _ in range(50):
            socket.send('{"type":"ping"}')
        while True:
            socket.recv(TIMEOUT)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1008


@pytest.mark.parametrize("since", ["x", "-2", "1.5", "9" * 20])
def test_a_beginning_that_is_no_number(server: Server, since: str) -> None:
    with pytest.raises(InvalidStatus), listening(server, since=since):
        pass


def test_a_client_from_the_future_hears_what_is_new(server: Server) -> None:
    with listening(server, since=10**9) as socket:
        assert frame(socket)["type"] == "hello"
        assert until(socket, "state")["state"]["seq"] >= 0


@pytest.mark.slow
def test_there_is_a_limit_to_clients() -> None:
    with serving() as server, ExitStack() as stack:
        for _ in range(64):
            socket = stack.enter_context(listening(server))
            assert frame(socket)["type"] == "hello"
        with pytest.raises(InvalidStatus), listening(server):
            pass


def test_sockets_are_closed_when_the_server_goes() -> None:
    with serving() as server, listening(server) as socket:
        assert frame(socket)["type"] == "hello"
        assert server.stop() == 0
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                socket.recv(TIMEOUT)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code in (1001, 1012)
