"""How much of a core a mission server needs, and how late its clients hear of what happens.

Run with ``python bench/serve.py [--quick]``. The server is a process of its own. First its start on
a long journal is timed, then commands on the paper's maze, then 200 robots of a generated mission
drive and 20 clients listen through sockets. A frame's lag is the wall time between its mission
clock and when a client has it, counted from the fastest frame of the last seconds: what it needs
(about 1 ms) is left out, but what the mission clock waits for planning counts. What the server
itself measures, from when something is known until a client has been sent it, stands beside it.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import random
import re
import struct
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import AsyncExitStack, closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx
import numpy as np
import yaml
from websockets.asyncio.client import ClientConnection, connect

from journal import MISSION, long_log
from oath.store import Origin
from oath.store.sqlite import SqliteJournal

MAZE = Path(__file__).parent.parent / "missions" / "maze-25.yaml"
TOKEN = "token-of-the-bench"
SIDE, AISLE = 120, 6
"""A hall of so many metres with racks every so many."""

WINDOW = 20
"""Lag is counted from the fastest of so many frames."""


def table(what: str, measured: str, figure: str) -> None:
    """Print one row."""
    print(f"{what:78} {measured:>22} {figure:>14}")


def hall(robots: int, tasks: int, seed: int = 0) -> dict[str, Any]:
    """Return a hall with racks and a fleet that has enough to do."""
    rng = random.Random(seed)
    racks = [
        [[x, y], [x, y + 8]] for x in range(AISLE, SIDE, AISLE) for y in range(4, SIDE - 8, 12)
    ]

    def spot() -> list[float]:
        x = rng.randrange(SIDE // AISLE) * AISLE + AISLE / 2
        return [x, round(rng.uniform(2, SIDE - 2), 1)]

    return {
        "schema": "oath/mission/1",
        "name": "hall",
        "map": {"bounds": [0, 0, SIDE, SIDE], "walls": racks, "wall_thickness": 0.5},
        "places": {name: spot() for name in "bcde"},
        "robots": [
            {"id": f"robot-{n}", "start": spot(), "can": ["normal"], "capacity": 3}
            for n in range(robots)
        ],
        "tasks": [{"id": f"task-{n}", "pickup": spot(), "delivery": spot()} for n in range(tasks)],
    }


@contextmanager
def serving(mission: Path, *options: str, journal: Path | None = None) -> Iterator[tuple[int, str]]:
    """Start a server; yield its process and address."""
    command = [sys.executable, "-m", "oath.cli", "serve", str(mission), "--port", "0"]
    with TemporaryDirectory() as folder:
        command += [
            "--token",
            TOKEN,
            "--journal",
            str(journal or f"{folder}/journal"),
            "--rate",
            "1000000",
        ]
        process = subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            assert line.startswith("console: "), line
            yield process.pid, line.split()[1].rstrip("/")
        finally:
            process.terminate()
            process.wait(30)


def cpu(process: int) -> float:
    """CPU time of a process so far [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Client:
    """Listens, and notes how late everything comes.

    Only one that `reads` looks into events and states: all clients share this process, and reading
    JSON for twenty would keep it busier than the server.
    """

    def __init__(self, reads: bool) -> None:
        self.reads = reads
        self.poses: list[float] = []
        self.states: list[float] = []
        self.events: list[float] = []
        self._offsets: deque[float] = deque(maxlen=WINDOW)
        self.measuring = False
        self.next_seq = 0
        self.bytes = 0

    async def listen(self, socket: ClientConnection) -> None:
        """Take everything that comes; events must be in order without gaps."""
        async for message in socket:
            now = time.monotonic()
            self.bytes += len(message)
            if isinstance(message, bytes):
                offset = now - struct.unpack_from("<d", message)[0]
                self._offsets.append(offset)
                self._note(self.poses, offset)
                continue
            if not self.reads:
                continue
            frame = json.loads(message)
            if frame["type"] == "state":
                self._note(self.states, now - frame["state"]["t"])
            elif frame["type"] == "events":
                for event in frame["events"]:
                    assert event["seq"] == self.next_seq, "a gap"
                    self.next_seq += 1
                    self._note(self.events, now - event["t"])

    def _note(self, lags: list[float], offset: float) -> None:
        if self.measuring and len(self._offsets) == WINDOW:
            lags.append(offset - min(self._offsets))


async def commands(
    http: httpx.AsyncClient, rate: float, seconds: float, robots: list[str], tasks: list[str]
) -> tuple[list[float], int]:
    """Send commands for some time [s]; return how long each took [s], and how many were refused."""
    rng, times, refused = random.Random(1), [], 0
    end = time.monotonic() + seconds
    for n in range(100_000):
        begin = time.monotonic()
        if begin > end:
            break
        intent, parameters = [
            ("pause_robot", {"robot": rng.choice(robots)}),
            ("resume_robot", {"robot": "all"}),
            ("change_task_priority", {"task_label": rng.choice(tasks), "priority": "low"}),
            (
                "add_task",
                {"location": [11.0, 3.0 + n % 7 / 10], "delivery_point": rng.choice("bcde")},
            ),
            ("obstacle_update", {"obstacle_location": [[7, 5], [8, 5]], "obstacle_type": "wall"}),
            ("undo", {}),
        ][n % 6]
        body = {"id": f"c{n}", "commands": [{"intent": intent, "parameters": parameters}]}
        begin = time.monotonic()
        answer = await http.post("/api/commands", json=body)
        if answer.status_code == 200:
            times.append(time.monotonic() - begin)
        else:
            assert answer.status_code == 409, answer.text
            refused += 1
        await asyncio.sleep(max(0.0, 1 / rate - (time.monotonic() - begin)))
    return times, refused


def told(times: list[float], refused: int, rate: float, figure: str) -> None:
    """Print how long commands took."""
    p50, p95, most = np.percentile(times, [50, 95, 100]) * 1e3
    about = f"durable command, {rate:g} a second, {len(times)} done and {refused} refused"
    table(f"{about}: p50, p95, max", f"{p50:.1f}, {p95:.1f}, {most:.0f} ms", figure)


def client(url: str) -> httpx.AsyncClient:
    """Return what asks a server."""
    headers = {"Authorization": f"Bearer {TOKEN}"}
    return httpx.AsyncClient(base_url=url, headers=headers, timeout=60, trust_env=False)


def start_time(events: int, starts: int) -> None:
    """Time starts on a long journal, from nothing to an answer."""
    origin, log = Origin.of(MISSION, allocator="lns", seconds=0.05), long_log(events)
    walls, shares = [], []
    for _ in range(starts):
        with TemporaryDirectory() as folder:
            path = Path(folder, "journal")
            with closing(SqliteJournal.create(path, origin)) as journal:
                journal.append(log)
            begin = time.monotonic()
            with serving(Path(MISSION), journal=path) as (process, url):
                headers = {"Authorization": f"Bearer {TOKEN}"}
                httpx.get(f"{url}/api/health", headers=headers, trust_env=False).raise_for_status()
                walls.append(time.monotonic() - begin)
                shares.append(cpu(process))
    about = f"start on {events} events until it answers, median of {starts}: wall, processor"
    table(about, f"{np.median(walls):.2f}, {np.median(shares):.2f} s", "<= 2 s")


async def command_time(url: str, seconds: float) -> None:
    """Time commands to a small mission."""
    async with client(url) as http:
        state = (await http.get("/api/state")).json()
        robots, tasks = ([one["id"] for one in state[what]] for what in ("robots", "tasks"))
        rate = 10.0
        told(*await commands(http, rate, seconds, robots, tasks), rate, "p95 <= 25 ms")


def own_p95(text: str, frame: str) -> str:
    """The upper bound of the bucket that holds the 95th percentile."""
    found = re.findall(rf'oath_lag_seconds_bucket{{frame="{frame}",le="(.+)"}} (\d+)', text)
    most = int(found[-1][1])
    bound = next(bound for bound, count in found if int(count) >= 0.95 * most)
    return f"<= {float(bound) * 1e3:g} ms"


async def load(process: int, url: str, count: int, seconds: float) -> None:
    """Listen with many clients for some time [s] while many robots drive."""
    headers = {"Authorization": f"Bearer {TOKEN}"}
    clients = [Client(reads=n == 0) for n in range(count)]
    live = url.replace("http", "ws") + "/api/live"
    async with AsyncExitStack() as stack, client(url) as http:
        listening = []
        for one in clients:
            way = connect(live, additional_headers=headers, max_size=None, proxy=None)
            socket = await stack.enter_async_context(way)
            listening.append(asyncio.create_task(one.listen(socket)))
        await asyncio.sleep(5.0)  # until everybody has heard the past, and knows the fastest frame
        for one in clients:
            one.measuring, one.bytes = True, 0
        before = (await http.get("/api/state")).json()
        begin, used = time.monotonic(), cpu(process)
        await asyncio.sleep(seconds)
        passed = time.monotonic() - begin
        share = (cpu(process) - used) / passed
        for one in clients:
            one.measuring = False
        after = (await http.get("/api/state")).json()
        text = (await http.get("/api/metrics")).text
        robots, tasks = ([one["id"] for one in before[what]] for what in ("robots", "tasks"))
        rate = 1.0
        timed = await commands(http, rate, seconds, robots, tasks[-100:])
    await asyncio.gather(*listening)
    driving = sum(robot["status"] == "driving" for robot in before["robots"])
    table("robots that drive, of all", f"{driving} / {len(before['robots'])}", "")
    table("events a second", f"{(after['seq'] - before['seq']) / passed:.0f}", "")
    table("bytes a second to each client", f"{clients[0].bytes / passed / 1000:.0f} kB", "")
    table("pose frames a second to each client", f"{len(clients[0].poses) / passed:.1f}", "10")
    table("server, share of one core", f"{share:.0%}", "<= 50 %")
    waited = passed - (after["t"] - before["t"])
    table("mission clock waited", f"{waited:.1f} of {passed:.0f} s", "")
    for frame in ("poses", "events", "state"):
        table(f"the server's own count of the lag of {frame}: p95", own_p95(text, frame), "")
    for what in ("poses", "events", "states"):
        lags = np.concatenate([getattr(one, what) for one in clients])
        p50, p95 = np.percentile(lags, [50, 95]) * 1e3
        table(f"lag of {what}: p50, p95", f"{p50:.0f}, {p95:.0f} ms", "p95 <= 150 ms")
    told(*timed, rate, "")


def main() -> None:
    """Print every figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a shorter time")
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--tasks", type=int, default=600)
    parser.add_argument("--clients", type=int, default=20)
    parser.add_argument("--allocator", default="greedy", help="of the many robots")
    parser.add_argument("--events", type=int, default=100_000, help="in the long journal")
    given = parser.parse_args()
    seconds = 10.0 if given.quick else 30.0
    table("start", "measured", "figure")
    start_time(given.events, 5)
    print()
    table("maze-25, 4 robots", "measured", "figure")
    with serving(MAZE) as (_, url):
        asyncio.run(command_time(url, seconds))
    print()
    table(f"hall, {given.robots} robots, {given.clients} clients", "measured", "figure")
    with TemporaryDirectory() as folder:
        path = Path(folder, "hall.yaml")
        path.write_text(yaml.safe_dump(hall(given.robots, given.tasks)))
        with serving(path, "--points", "3000", "--allocator", given.allocator) as (process, url):
            asyncio.run(load(process, url, given.clients, seconds))


if __name__ == "__main__":
    main()
