"""A full disk stops the mission, and nothing that was acknowledged is lost."""

from __future__ import annotations

import resource
import sys
from contextlib import suppress
from pathlib import Path

import httpx
import pytest

from oath.events import TaskAdded
from oath.store.sqlite import read
from service.servers import MAZE, TIMEOUT, Server, serving

ROOM = 60_000
"""So many bytes are left when it begins."""


def add(server: Server, n: int) -> httpx.Response:
    wanted = {"location": [1.0, 19.0], "delivery_point": "b", "task_label": f"k{n}"}
    return server.command(f"add-{n}", "add_task", **wanted)


@pytest.mark.skipif(sys.platform != "linux", reason="only there can a process be limited later")
@pytest.mark.slow
def test_a_full_disk(tmp_path: Path) -> None:
    journal = tmp_path / "maze.journal"
    options = ("--journal", str(journal), "--allocator", "greedy", "--points", "300")
    answered = []
    with serving(MAZE, *options) as server:
        most = Path(f"{journal}-wal").stat().st_size + ROOM
        limit = (most, most)
        resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE, limit)  # type: ignore[attr-defined]
        with suppress(httpx.TransportError):
            for n in range(1000):
                answer = add(server, n)
                if answer.status_code != 200:
                    assert answer.status_code == 503, answer.text
                    break
                answered.append(n)
        _, said = server.process.communicate(timeout=TIMEOUT)
        assert server.process.returncode == 2
    assert answered
    assert "cannot be stored" in said
    assert "make room" in said
    assert "Traceback" not in said
    kept = [event.task.id for event in read(journal).events if isinstance(event, TaskAdded)]
    assert kept == [f"k{n}" for n in answered]
    with serving(MAZE, *options) as server:
        assert add(server, answered[-1]).json()["repeated"] is True
        assert add(server, len(answered)).json()["repeated"] is False
        assert server.stop() == 0
