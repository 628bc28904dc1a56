"""The routes of a running server, asked over HTTP."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import oath
from service.servers import MAZE, OPERATOR, Server, serving

NOTE = "note: without --journal, the mission ends with the server"


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving(MAZE, "--seed", "3", "--allocator", "greedy") as server:
        server.post("/api/clock", {"paused": True})
        yield server


def proposal(answer: Any) -> Any:
    assert answer.status_code == 200, answer.text
    return answer.json()["reply"]["proposal"]


def refused(answer: Any, status: int) -> dict[str, Any]:
    assert answer.status_code == status, answer.text
    error = answer.json()["error"]
    assert set(error) == {"problem", "field", "remedy"}
    assert error["problem"]
    return error


def test_health(server: Server) -> None:
    health = server.get("/api/health")
    assert health["status"] == "ok"
    assert health["mission"] == "maze-25"
    assert health["seq"] >= 1


def test_missions(server: Server) -> None:
    (line,) = server.get("/api/missions")["missions"]
    assert line["running"] is True
    assert line["robots"] == 4


def test_mission(server: Server) -> None:
    mission = oath.load(MAZE)
    plain = server.get("/api/mission")
    assert plain["bounds"] == list(mission.map.bounds)
    assert [robot["id"] for robot in plain["robots"]] == [robot.id for robot in mission.robots]
    assert plain["places"] == {name: list(at) for name, at in mission.places.items()}
    assert plain["grid"] is None
    assert len(plain["walls"]) == len(mission.map.walls)


def test_roadmap(server: Server) -> None:
    roadmap = server.get("/api/roadmap")
    count = len(roadmap["nodes"])
    assert count >= 1000
    assert all(0 <= node < count for edge in roadmap["edges"] for node in edge)


def test_state(server: Server) -> None:
    state = server.get("/api/state")
    assert state["finished"] is False
    assert state["clock"] == {"speed": 1.0, "paused": True}
    assert len(state["tasks"]) >= 25
    driving = [robot for robot in state["robots"] if robot["status"] == "driving"]
    assert driving
    for robot in driving:
        assert robot["path"][0] == robot["position"]
        assert robot["path"][-1] == robot["route"][0]["at"]
    assigned = {
        task["id"]: task["robot"] for task in state["tasks"] if task["status"] == "assigned"
    }
    for robot in state["robots"]:
        for stop in robot["route"]:
            assert assigned.get(stop["task"], robot["id"]) == robot["id"]


def test_the_past(server: Server) -> None:
    begin = server.get("/api/state", seq=-1)
    assert begin["t"] == 0.0
    assert all(robot["route"] == [] for robot in begin["robots"])
    assert {task["status"] for task in begin["tasks"]} == {"waiting"}
    now = server.get("/api/state")
    then = server.get("/api/state", seq=now["seq"])
    assert then["tasks"] == now["tasks"]
    with server.client() as client:
        refused(client.get("/api/state", params={"seq": 10**6}), 404)
        assert refused(client.get("/api/state", params={"seq": -2}), 422)["field"] == "seq"
        refused(client.get("/api/state", params={"seq": "x"}), 422)


def test_events(server: Server) -> None:
    whole = server.get("/api/events")
    assert [event["seq"] for event in whole["events"]] == list(range(whole["last"] + 1))
    assert whole["events"][0]["type"] == "mission_started"
    assert whole["events"][0]["schema"] == "oath/events/1"
    part = server.get("/api/events", since=1, limit=2)
    assert part["events"] == whole["events"][2:4]
    assert server.get("/api/events", since=10**9)["events"] == []


def test_metrics(server: Server) -> None:
    with server.client() as client:
        text = client.get("/api/metrics").text
    values = dict(line.rsplit(" ", 1) for line in text.splitlines() if not line.startswith("#"))
    assert float(values["oath_uptime_seconds"]) > 0
    assert float(values["oath_events_total"]) >= 1
    tasks = sum(float(value) for name, value in values.items() if name.startswith("oath_tasks"))
    assert tasks == len(server.get("/api/state")["tasks"])
    assert 'oath_http_requests_total{method="GET",status="200"}' in values


def test_unknown_routes(server: Server) -> None:
    with server.client() as client:
        refused(client.get("/api/nothing"), 404)
        refused(client.delete("/api/state"), 405)
        refused(client.get("/static/no-such-file.js"), 404)
        refused(client.get("/static/..%2fapp.py"), 404)


def test_commands_are_carried_out_once(server: Server) -> None:
    body = {
        "id": "tower-1",
        "commands": [
            {
                "intent": "add_task",
                "parameters": {"location": [5, 19.5], "delivery_point": "c", "task_label": "x1"},
            },
            {
                "intent": "change_task_priority",
                "parameters": {"task_label": "x1", "priority": "low"},
            },
        ],
    }
    first = server.post("/api/commands", body).json()
    again = server.post("/api/commands", body).json()
    assert first["repeated"] is False
    assert again == {"seq": first["seq"], "repeated": True}
    added = [e for e in server.get("/api/events")["events"] if e["type"] == "task_added"]
    assert [event["task"]["id"] for event in added].count("x1") == 1
    (task,) = [task for task in server.get("/api/state")["tasks"] if task["id"] == "x1"]
    assert task["priority"] == "low"
    last = server.get("/api/events", since=first["seq"] - 1, limit=1)["events"][0]
    assert last["type"] == "priority_changed"


def test_other_commands_under_a_used_id(server: Server) -> None:
    assert server.command("same", "pause_robot", robot="robot4").status_code == 200
    refused(server.command("same", "resume_robot", robot="robot4"), 409)
    assert server.command("other", "resume_robot", robot="robot4").status_code == 200


def test_all_commands_or_none(server: Server) -> None:
    before = server.get("/api/health")["seq"]
    commands = [
        {"intent": "pause_robot", "parameters": {"robot": "robot1"}},
        {"intent": "cancel_task", "parameters": {"task_label": "no-such-task"}},
    ]
    answer = server.post("/api/commands", {"id": "both", "commands": commands})
    assert refused(answer, 409)["field"] == "task_label"
    since = server.get("/api/events", since=before)["events"]
    assert not {"commanded", "robot_paused"} & {event["type"] for event in since}


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"{", 400),
        (b"\xff\xfe", 400),
        (b"[]", 422),
        (b'{"id":"a"}', 422),
        (b'{"id":"a","commands":[]}', 422),
        (b'{"id":"a b","commands":[{"intent":"undo","parameters":{}}]}', 422),
        (b'{"id":"a","commands":[{"intent":"fly","parameters":{}}]}', 422),
        (b'{"id":"a","commands":[{"intent":"undo","parameters":{"x":1}}]}', 422),
        (b'{"id":"a","commands":[{"intent":"undo","parameters":{}}],"more":1}', 422),
        (b'{"id":"a","commands":' + b"[" * 20_000, 400),
    ],
)
def test_malformed_commands(server: Server, body: bytes, status: int) -> None:
    with server.client() as client:
        headers = {"content-type": "application/json"}
        refused(client.post("/api/commands", content=body, headers=headers), status)


def test_proposals_are_confirmed_once(server: Server) -> None:
    commands = [{"intent": "pause_robot", "parameters": {"robot": "robot2"}}]
    assert server.post("/api/commands", {"id": "p", "commands": commands}).status_code == 200
    resume = {"commands": [{"intent": "resume_robot", "parameters": {"robot": "robot2"}}]}
    made = proposal(server.post("/api/proposals", resume))
    assert made["says"] == ["lets robot2 go on"]
    assert 0 < made["expires_in"] <= 120
    path = f"/api/proposals/{made['id']}/confirm"
    seq = server.post(path, {}).json()["seq"]
    assert server.get("/api/events", since=seq - 1)["events"][0]["type"] == "robot_resumed"
    assert "already" in refused(server.post(path, {}), 409)["problem"]


def test_a_proposal_for_another_world_is_refused(server: Server) -> None:
    wanted = {"commands": [{"intent": "robot_failed", "parameters": {"robot": "robot3"}}]}
    made = proposal(server.post("/api/proposals", wanted))
    assert server.command("meanwhile", "cancel_task", task_label="bb").status_code == 200
    answer = server.post(f"/api/proposals/{made['id']}/confirm", {})
    assert "changed" in refused(answer, 409)["problem"]
    assert server.get("/api/state")["robots"][2]["status"] != "failed"


def test_a_rejected_proposal_is_gone(server: Server) -> None:
    wanted = {"commands": [{"intent": "cancel_task", "parameters": {"task_label": "bc"}}]}
    made = proposal(server.post("/api/proposals", wanted))
    assert server.post(f"/api/proposals/{made['id']}/reject", {}).json() == {}
    refused(server.post(f"/api/proposals/{made['id']}/reject", {}), 409)
    refused(server.post(f"/api/proposals/{made['id']}/confirm", {}), 409)


def test_windows_do_not_hear_each_other(server: Server) -> None:
    wanted = {"commands": [{"intent": "cancel_task", "parameters": {"task_label": "bc"}}]}
    with server.client(**{"Oath-Window": "one"}) as one, server.client() as other:
        made = proposal(one.post("/api/proposals", json=wanted))
        refused(other.post(f"/api/proposals/{made['id']}/confirm", json={}), 409)
        assert one.post(f"/api/proposals/{made['id']}/confirm", json={}).status_code == 200


def test_an_impossible_proposal_is_explained(server: Server) -> None:
    wanted = {"commands": [{"intent": "cancel_task", "parameters": {"task_label": "zzz"}}]}
    reply = server.post("/api/proposals", wanted).json()["reply"]
    assert reply["status"] == "clarification"
    assert reply["proposal"] is None
    assert "zzz" in reply["message"]


def test_words(server: Server) -> None:
    asked = server.post("/api/instructions", {"text": "take something to c"}).json()["reply"]
    assert asked["status"] == "need_more_info"
    assert asked["proposal"] is None
    reply = server.post("/api/instructions", {"text": "cancel task be"}).json()["reply"]
    assert reply["intent"] == "cancel_task"
    assert reply["proposal"]["commands"] == [
        {"intent": "cancel_task", "parameters": {"task_label": "be"}}
    ]
    done = server.post("/api/instructions", {"text": "yes"}).json()["reply"]
    assert done["done"]["seq"] == server.get("/api/health")["seq"] or done["done"]["seq"] > 0
    assert "be" not in [task["id"] for task in server.get("/api/state")["tasks"]]


def test_a_pause_in_words_needs_no_confirmation(server: Server) -> None:
    reply = server.post("/api/instructions", {"text": "pause robot1"}).json()["reply"]
    assert reply["proposal"] is None
    assert reply["done"]["seq"] > 0
    assert server.get("/api/state")["robots"][0]["status"] == "paused"
    assert server.command("on", "resume_robot", robot="robot1").status_code == 200


@pytest.mark.parametrize("text", ["", "x" * 2001, 5, None])
def test_malformed_words(server: Server, text: Any) -> None:
    assert refused(server.post("/api/instructions", {"text": text}), 422)["field"] == "text"


def test_stepping(server: Server) -> None:
    before = server.get("/api/state")
    clock = server.post("/api/clock", {"step": True}).json()
    assert clock == {"speed": 1.0, "paused": True}
    after = server.get("/api/state")
    assert after["t"] > before["t"]
    events = server.get("/api/events", since=before["seq"])["events"]
    assert events
    assert {event["t"] for event in events} == {after["t"]}


def test_speed(server: Server) -> None:
    assert server.post("/api/clock", {"speed": 100}).json() == {"speed": 100.0, "paused": True}
    refused(server.post("/api/clock", {"speed": 1000}), 422)
    assert server.post("/api/clock", {}).json() == {"speed": 100.0, "paused": True}
    server.post("/api/clock", {"speed": 1.0})


@pytest.mark.slow
def test_a_server_ends_in_good_order() -> None:
    for sign in (signal.SIGINT, signal.SIGTERM):
        with serving() as server:
            assert server.stop(sign) == 0
            assert server.process.stderr is not None
            assert server.process.stderr.read().splitlines() == [NOTE]


def test_a_mission_can_be_finished() -> None:
    with serving(MAZE, "--allocator", "greedy") as server:
        seq = server.post("/api/finish", {}).json()["seq"]
        assert server.post("/api/finish", {}).json()["seq"] == seq
        state = server.get("/api/state")
        assert state["finished"] is True
        assert server.get("/api/events", since=seq - 1)["events"][0]["type"] == "mission_finished"
        refused(server.command("late", "pause_robot", robot="all"), 409)
        refused(server.post("/api/instructions", {"text": "pause all robots"}), 409)
        assert server.get("/api/missions")["missions"][0]["running"] is False


@pytest.mark.slow
def test_a_server_can_stop_when_all_is_done() -> None:
    with serving(MAZE, "--speed", "100", "--until-done", "--allocator", "greedy") as server:
        assert server.process.wait(60) == 0


def run(*options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "oath.cli", "serve", *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.slow
def test_a_port_that_is_taken() -> None:
    with serving() as server:
        done = run(MAZE, "--port", str(server.port), "--token", OPERATOR)
    assert done.returncode == 2
    assert done.stderr.startswith("error: --port: 127.0.0.1:")
    assert done.stdout == ""


def test_others_need_a_token() -> None:
    done = run(MAZE, "--host", "0.0.0.0", "--port", "0")
    assert done.returncode == 2
    assert "--token" in done.stderr


@pytest.mark.slow
def test_a_mission_goes_on_where_it_was(tmp_path: Path) -> None:
    journal = ("--journal", str(tmp_path / "maze.journal"))
    with serving(MAZE, *journal, "--speed", "20", "--allocator", "greedy") as server:
        first = server.command("once", "cancel_task", task_label="bb").json()
        server.post("/api/clock", {"paused": True})
        before = server.get("/api/state")
        assert server.stop() == 0
    with serving(MAZE, *journal, "--allocator", "lns") as server:
        server.post("/api/clock", {"paused": True})
        after = server.get("/api/state")
        assert after["seq"] >= before["seq"]
        assert after["t"] == pytest.approx(before["t"], abs=60.0)
        carrying = {robot["id"]: robot["carrying"] for robot in before["robots"]}
        assert {robot["id"]: robot["carrying"] for robot in after["robots"]} == carrying
        assert server.get("/api/state", seq=before["seq"])["tasks"] == before["tasks"]
        again = server.command("once", "cancel_task", task_label="bb").json()
        assert again == {"seq": first["seq"], "repeated": True}
        assert server.get("/api/events", limit=1)["events"][0]["allocator"] == "greedy"
        assert server.stop() == 0
        assert server.process.stderr is not None
        assert "goes on with the mission and settings it began with" in server.process.stderr.read()


@pytest.mark.slow
def test_a_journal_of_another_mission(tmp_path: Path) -> None:
    journal = ("--journal", str(tmp_path / "maze.journal"))
    with serving(MAZE, *journal) as server:
        in_use = run(MAZE, *journal, "--port", "0")
        assert in_use.returncode == 2
        assert "in use" in in_use.stderr
        server.stop()
    done = run("missions/office.yaml", *journal, "--port", "0")
    assert done.returncode == 2
    assert "is the journal of maze-25" in done.stderr


def test_bad_missions_leave_no_journal(tmp_path: Path) -> None:
    path = tmp_path / "maze.journal"
    assert run(str(tmp_path / "none.yaml"), "--journal", str(path), "--port", "0").returncode == 2
    assert not path.exists()


def test_a_parameter_given_twice(server: Server) -> None:
    with server.client() as client:
        answer = client.get("/api/state?seq=1&seq=0")
    assert refused(answer, 422)["field"] == "seq"
