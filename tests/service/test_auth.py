"""Who is let in: tokens, hosts, origins and the pace of requests."""

from __future__ import annotations

import pytest

from oath.errors import BadInput
from oath.service.auth import Access, Pace, access, tokens

HERE = Access(
    operator="operators-token",
    viewer="viewers-token",
    hosts=frozenset({"127.0.0.1", "localhost", "::1"}),
    port=8080,
)


@pytest.mark.parametrize(
    ("token", "role"),
    [
        ("operators-token", "operator"),
        ("viewers-token", "viewer"),
        ("operators-toke", None),
        ("operators-token ", None),
        ("", None),
        ("é", None),
        (None, None),
    ],
)
def test_tokens_give_roles(token: str | None, role: str | None) -> None:
    assert HERE.role(token) == role


def test_without_a_viewers_token_nobody_is_a_viewer() -> None:
    alone = Access(operator="operators-token")
    assert alone.role("None") is None
    assert alone.role("") is None


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8080", "localhost:8080", "LOCALHOST:8080", "[::1]:8080"]
)
def test_own_hosts(host: str) -> None:
    assert HERE.is_own(host)


@pytest.mark.parametrize(
    "host",
    [
        *("evil.example:8080", "127.0.0.1", "127.0.0.1:80", "127.0.0.1:8080:8080", "", None),
        *("a b:8080", "localhost.evil.example:8080", "user@localhost:8080", "[::1:8080"),
        "192.168.0.1:8080",
    ],
)
def test_foreign_hosts(host: str | None) -> None:
    assert not HERE.is_own(host)


def test_a_server_for_everybody_takes_addresses_but_no_names() -> None:
    anyone, _ = access(host="0.0.0.0", port=8080, token="a-long-token")
    assert anyone.is_own("192.168.0.7:8080")
    assert anyone.is_own("[fe80::1]:8080")
    assert not anyone.is_own("evil.example:8080")


def test_the_address_that_was_asked_for_is_own() -> None:
    named, _ = access(host="robots.example", port=8080, token="a-long-token")
    assert named.is_own("robots.example:8080")


@pytest.mark.parametrize(
    ("origin", "same"),
    [
        (None, True),
        ("http://localhost:8080", True),
        ("http://localhost:8081", False),
        ("https://localhost:8080", False),
        ("http://evil.example", False),
        ("null", False),
        ("", False),
    ],
)
def test_origins(origin: str | None, same: bool) -> None:
    assert HERE.is_same_origin(origin, "localhost:8080") is same


def test_made_up_tokens_differ_and_are_long() -> None:
    one, made_up = access(host="127.0.0.1", port=8080)
    other, _ = access(host="127.0.0.1", port=8080)
    assert made_up
    assert one.operator != other.operator
    assert len(one.operator) >= 32
    assert one.operator not in repr(one)


@pytest.mark.parametrize(
    ("host", "token", "viewer", "field"),
    [
        ("0.0.0.0", None, None, "--token"),
        ("127.0.0.1", "short", None, "--token"),
        ("127.0.0.1", "with spaces in it", None, "--token"),
        ("127.0.0.1", "a-long-token", "tiny", "--viewer-token"),
        ("127.0.0.1", "a-long-token", "a-long-token", "--viewer-token"),
    ],
)
def test_weak_access_is_refused(
    host: str, token: str | None, viewer: str | None, field: str
) -> None:
    with pytest.raises(BadInput) as error:
        access(host=host, port=1, token=token, viewer=viewer)
    assert error.value.field == field


def test_tokens_of_a_request() -> None:
    headers = {
        "authorization": "Bearer one",
        "cookie": "other=x; oath_token=two",
        "sec-websocket-protocol": "oath, bearer.three",
    }
    assert list(tokens(headers)) == ["one", "two", "three"]
    assert list(tokens({"authorization": "Basic b25l", "cookie": "=;=;\\"})) == []


def test_pace() -> None:
    now = 0.0
    pace = Pace(2.0, 4.0, clock=lambda: now)
    assert [pace.allows("a") for _ in range(5)] == [True] * 4 + [False]
    assert pace.allows("b"), "each client has its own pace"
    now = 1.0
    assert [pace.allows("a") for _ in range(3)] == [True, True, False]
    now = 1000.0
    assert [pace.allows("a") for _ in range(5)] == [True] * 4 + [False]
