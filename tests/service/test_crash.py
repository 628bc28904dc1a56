"""A server that is killed at any moment forgets nothing that it has acknowledged."""

from __future__ import annotations

import random
import signal
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx
import pytest

import oath
from oath.events import AnyEvent, Commanded, MissionFinished, StopServed, TaskAdded
from oath.store.sqlite import read
from oath.verify import verify
from service.servers import MAZE, Server, serving

OPTIONS = ("--allocator", "greedy", "--points", "300", "--rate", "1000000")
SPOTS = [[1, 19], [11, 19], [5, 19.5], [1, 4], [1, 1.5], [19, 16.5], [19, 19], [9, 19.5]]


class Tower:
    """Another system that sends commands, each again and again until it is answered."""

    def __init__(self, rng: random.Random) -> None:
        self.answered: dict[str, int] = {}
        self.refused: set[str] = set()
        self.open: dict[str, Any] = {}
        self._orders = self._endless(rng)

    def _endless(self, rng: random.Random) -> Iterator[tuple[str, Any]]:
        n = 0
        while True:
            n += 1
            place = rng.choice("bcde")
            wanted = {"location": rng.choice(SPOTS), "delivery_point": place, "task_label": f"k{n}"}
            yield f"add-{n}", {"intent": "add_task", "parameters": wanted}
            urgent = {"task_label": f"k{n}", "priority": rng.choice(["low", "high"])}
            yield f"change-{n}", {"intent": "change_task_priority", "parameters": urgent}
            robot = {"robot": rng.choice(["robot1", "robot2", "all"])}
            yield f"pause-{n}", {"intent": "pause_robot", "parameters": robot}
            yield f"resume-{n}", {"intent": "resume_robot", "parameters": {"robot": "all"}}

    def send(self, server: Server, new: bool) -> None:
        """Send what is open, and something new; stop when the server is gone."""
        if new:
            self.open.update([next(self._orders)])
        with suppress(httpx.TransportError), server.client() as client:
            for id, command in list(self.open.items()):
                answer = client.post("/api/commands", json={"id": id, "commands": [command]})
                if answer.status_code == 200:
                    self.answered[id] = answer.json()["seq"]
                elif answer.status_code == 409:
                    self.refused.add(id)
                else:
                    assert answer.status_code == 503, answer.text
                    return
                del self.open[id]


def kill_at_random(kills: int, journal: Path, seed: int) -> None:
    rng = random.Random(seed)
    tower = Tower(rng)
    options = (*OPTIONS, "--journal", str(journal))
    for _ in range(kills):
        with serving(MAZE, *options, "--speed", "3") as server:
            for _ in range(rng.randrange(6)):
                tower.send(server, new=True)
            # The last command is in flight while the server dies.
            sending = threading.Thread(target=tower.send, args=(server, True))
            sending.start()
            sending.join(rng.uniform(0.0, 0.03))
            server.process.send_signal(signal.SIGKILL)
            sending.join()
    with serving(MAZE, *options, "--speed", "100", "--until-done") as server:
        tower.send(server, new=False)
        assert not tower.open
        with suppress(httpx.TransportError):  # it may be done before it hears of this
            server.command("at-last", "resume_robot", robot="all")
        assert server.process.wait(120) == 0
    check(read(journal).events, tower)


def check(events: list[AnyEvent], tower: Tower) -> None:
    assert isinstance(events[-1], MissionFinished)
    for id, seq in tower.answered.items():
        asked = next(e for e in reversed(events[: seq + 1]) if isinstance(e, Commanded))
        assert asked.source == "api"
        if id.startswith("add"):
            assert asked.command["parameters"]["task_label"] == f"k{id.removeprefix('add-')}"
    commands = [event for event in events if isinstance(event, Commanded)]
    late = len(commands) - len(tower.answered)
    assert late in (0, 1), "the last resume is not among the tower's own"
    added = Counter(event.task.id for event in events if isinstance(event, TaskAdded))
    wanted = {f"k{id.removeprefix('add-')}" for id in tower.answered if id.startswith("add")}
    assert added.keys() == wanted, "no task is lost, none appears unasked"
    assert set(added.values()) <= {1}, "no command is carried out twice"
    served = Counter((e.task, e.stop) for e in events if isinstance(e, StopServed))
    assert set(served.values()) == {1}, "no stop is served twice"
    mission = oath.load(MAZE)
    tasks = {task.id for task in mission.tasks} | added.keys()
    assert {task for task, stop in served if stop == "delivery"} == tasks
    assert events[-1].summary["unserved"] == {}
    assert verify(mission, events).violations == ()


@pytest.mark.slow
def test_a_few_kills(tmp_path: Path) -> None:
    kill_at_random(3, tmp_path / "maze.journal", seed=1)


@pytest.mark.slow
def test_many_kills(tmp_path: Path) -> None:
    kill_at_random(32, tmp_path / "maze.journal", seed=2)
