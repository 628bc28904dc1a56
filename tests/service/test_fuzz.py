"""The API answers anything that its own description allows, and much that it does not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from service.servers import MAZE, OPERATOR, serving

# A body may be too large before it is looked at.
CONFIG = """
[checks.negative_data_rejection]
expected-statuses = ["400", "401", "403", "404", "405", "409", "413", "415", "422", "429"]
"""


def fuzz(folder: Path, seconds: int, *options: str) -> None:
    """Let schemathesis try every route with all its checks."""
    config = folder / "schemathesis.toml"
    config.write_text(CONFIG)
    with serving(MAZE, "--allocator", "greedy", "--rate", "1000000") as server:
        command = [sys.executable, "-m", "schemathesis.cli", "--config-file", str(config), "run"]
        command += [f"{server.url}/api/openapi.json", "-H", f"Authorization: Bearer {OPERATOR}"]
        command += ["--checks", "all", "--seed", "1", "--max-time", str(seconds), "--no-shrink"]
        done = subprocess.run(
            [*command, *options], cwd=folder, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert server.get("/api/health")["status"] == "ok"


@pytest.mark.slow
def test_a_mission_that_runs(tmp_path: Path) -> None:
    fuzz(tmp_path, 60, "--exclude-path", "/api/finish")


@pytest.mark.slow
def test_a_mission_that_ends(tmp_path: Path) -> None:
    fuzz(tmp_path, 20)
