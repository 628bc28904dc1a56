"""A mission is recorded while it is served."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader

from oath.store.sqlite import read
from service.servers import MAZE, TIMEOUT, serving

OPTIONS = ("--allocator", "greedy", "--points", "300", "--speed", "100")


def recorded(path: Path) -> dict[str, list[int]]:
    """Log times [ns] by topic, in the order of the file; it must be whole."""
    times: dict[str, list[int]] = {}
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_summary() is not None
        for _, channel, message in reader.iter_messages(log_time_order=False):
            times.setdefault(channel.topic, []).append(message.log_time)
    return times


@pytest.mark.slow
def test_a_served_mission_is_recorded_even_if_it_goes_on_later(tmp_path: Path) -> None:
    journal = tmp_path / "maze.journal"
    options = (*OPTIONS, "--journal", str(journal), "--record")
    with serving(MAZE, *options, str(tmp_path / "a.mcap")) as server:
        server.command("more", "add_task", location=[1.0, 19.0], delivery_point="b")
        assert server.stop() == 0
    first = recorded(tmp_path / "a.mcap")
    assert len(first["/events"]) == len(read(journal).events)
    with serving(MAZE, *options, str(tmp_path / "b.mcap"), "--until-done") as server:
        assert server.process.wait(TIMEOUT) == 0
    whole = recorded(tmp_path / "b.mcap")
    assert len(whole["/events"]) == len(read(journal).events) > len(first["/events"])
    assert len(whole["/robots/robot1/pose"]) > 10
    for times in whole.values():
        assert times == sorted(times)


@pytest.mark.slow
def test_a_recording_that_exists_is_kept_and_no_journal_begun(tmp_path: Path) -> None:
    record, journal = tmp_path / "a.mcap", tmp_path / "maze.journal"
    record.write_text("mine")
    command = [sys.executable, "-m", "oath.cli", "serve", MAZE, "--port", "0"]
    command += ["--journal", str(journal), "--record", str(record)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    assert done.returncode == 2
    assert "a.mcap: exists already" in done.stderr
    assert record.read_text() == "mine"
    assert not journal.exists()
