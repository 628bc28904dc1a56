"""`oath interpret`, `oath chat` and `oath run --script`, as their users call them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from oath.cli import main

MAZE = "missions/maze-09.yaml"
KEYS = {"status", "intent", "parameters", "missing", "message"}


def call(*arguments: str, said: str | bytes = "") -> Result:
    return CliRunner().invoke(main, list(arguments), input=said)


def replies(*arguments: str, said: str | bytes) -> list[dict[str, Any]]:
    done = call("interpret", MAZE, "--points", "200", "--json", *arguments, said=said)
    assert done.exit_code == 0, done.output
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_every_line_gets_one_json_object() -> None:
    whole, part, other = replies(
        said="new normal task at (9, 8.5), take it to c\nadd a task at (9, 8.5)\nnice weather\n"
    )
    assert all(reply.keys() >= KEYS for reply in (whole, part, other))
    assert (whole["status"], whole["intent"]) == ("complete", "add_task")
    assert whole["parameters"]["location"] == [9.0, 8.5]
    assert whole["parameters"]["delivery_point"] == "c"
    assert "t1" in whole["message"]  # the label that was made up
    assert (part["status"], part["missing"]) == ("need_more_info", ["delivery_point"])
    assert other["status"] == "clarification" and other["intent"] is None


def test_lines_are_one_dialogue_on_request() -> None:
    asked, whole, done, status = replies(
        "--dialogue", said="add a task at (9, 8.5)\nto c\nyes\nhow is it going?\n"
    )
    assert asked["status"] == "need_more_info"
    assert whole["status"] == "complete" and whole["parameters"]["delivery_point"] == "c"
    assert done["message"].startswith("Done")
    assert "of 10 tasks" in status["message"]


def test_without_a_dialogue_no_line_changes_the_next() -> None:
    first, second = replies(said="pause robot1\npause robot1\n")
    assert first["status"] == second["status"] == "complete"


@pytest.mark.parametrize("said", ["", "\n", "\0\x1b[2J\n", "x" * 100_000 + "\n", "новая задача\n"])
def test_odd_input_gets_a_polite_answer(said: str) -> None:
    for reply in replies(said=said):
        assert reply["status"] != "complete" and reply["message"]


def test_bytes_that_are_no_text_get_an_answer_too() -> None:
    (reply,) = replies(said=b"\xff\xfe pause\n")
    assert reply.keys() >= KEYS


def test_a_chat_tells_news_and_ends_with_an_empty_line() -> None:
    said = "how is it going?\npause robot2\n\nnever read\n"
    done = call("chat", MAZE, "--points", "200", "--speed", "50", said=said)
    assert done.exit_code == 0, done.output
    assert "0 of 9 tasks are done" in done.output
    assert "pauses robot2" in done.output
    assert "stopped at" in done.output.splitlines()[-1]


def test_a_script_is_played_into_a_run(tmp_path: Path) -> None:
    script = tmp_path / "script.yaml"
    script.write_text(
        '- {at: 2, say: "new normal task at (9, 8.5), take it to c"}\n'
        '- {at: 3, say: "make a wall somewhere"}\n'
        "- {at: 4, do: {intent: pause_robot, parameters: {robot: robot2}}}\n"
        "- {at: 5, do: {intent: cancel_task, parameters: {task_label: t1}}, confirm: false}\n"
        "- {at: 9, do: {intent: resume_robot, parameters: {robot: robot2}}}\n"
    )
    done = call("run", MAZE, "--script", str(script), "--out", str(tmp_path / "out"), "--json")
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    assert summary["completed"] == summary["tasks"] == 10
    assert "[2.0 s] Adds task t1" in done.stderr and "[4.0 s] pauses robot2" in done.stderr
    judged = call("verify", MAZE, str(tmp_path / "out" / "events.jsonl"))
    assert judged.exit_code == 0, judged.output


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("- {at: 1, do: {intent: fly}}", "script.yaml:1: intent: unknown intent 'fly'"),
        ("- {at: 1, do: {intent: cancel_task}}", "script.yaml:1: task_label"),
        ("- {at: -1, say: hello}", "script.yaml:1: at"),
    ],
)
def test_a_wrong_script_is_named_and_leaves_nothing(
    entry: str, message: str, tmp_path: Path
) -> None:
    script = tmp_path / "script.yaml"
    script.write_text(entry)
    done = call("run", MAZE, "--script", str(script), "--out", str(tmp_path / "out"))
    assert done.exit_code == 2
    assert message in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "out" / "events.jsonl").exists()
    assert not (tmp_path / "out" / "summary.json").exists()
