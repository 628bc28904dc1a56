"""A mission server as a process of its own, on a free port of this machine."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

MAZE = "missions/maze-25.yaml"
OPERATOR, VIEWER = "operators-token", "viewers-token"
TIMEOUT = 60.0
"""Nothing takes so long [s]."""


@dataclass
class Server:
    """A running server and how to ask it."""

    process: subprocess.Popen[str]
    url: str
    token: str

    @property
    def port(self) -> int:
        return int(self.url.rpartition(":")[2])

    @property
    def socket_url(self) -> str:
        return self.url.replace("http", "ws") + "/api/live"

    def client(self, token: str | None = None, **headers: str) -> httpx.Client:
        headers = {"Authorization": f"Bearer {token or self.token}", **headers}
        return httpx.Client(base_url=self.url, headers=headers, timeout=TIMEOUT, trust_env=False)

    def get(self, path: str, **parameters: Any) -> Any:
        with self.client() as client:
            answer = client.get(path, params=parameters)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def post(self, path: str, body: Any) -> httpx.Response:
        with self.client() as client:
            return client.post(path, json=body)

    def command(self, id: str, intent: str, **parameters: Any) -> httpx.Response:
        commands = [{"intent": intent, "parameters": parameters}]
        return self.post("/api/commands", {"id": id, "commands": commands})

    def stop(self, sign: int = signal.SIGTERM) -> int:
        self.process.send_signal(sign)
        return self.process.wait(TIMEOUT)


@contextmanager
def serving(
    mission: str | Path = MAZE, *options: str, token: str | None = OPERATOR
) -> Iterator[Server]:
    """Start a server; end it in any case."""
    command = [sys.executable, "-W", "error", "-m", "oath.cli", "serve", str(mission)]
    command += ["--port", "0", *options]
    if token is not None:
        command += ["--token", token, "--viewer-token", VIEWER]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        match = re.match(r"console: (http://[^/]+)/(?:\?token=(.+))?$", line.strip())
        if match is None:
            raise AssertionError(line + process.communicate(timeout=TIMEOUT)[1])
        yield Server(process, match[1], token or match[2])
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()
