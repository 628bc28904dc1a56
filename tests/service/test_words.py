"""Words to a server: a language model that takes its time holds nobody up."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Thread
from typing import Any

from servers import TIMEOUT, serving

ANSWER = {
    "verdict": "command",
    "about": "new",
    "commands": [
        {"intent": "add_task", "parameters": {"location": [5, 19.5], "delivery_point": "c"}}
    ],
}


class Model(ThreadingHTTPServer):
    """Answers once it is told to."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.asked, self.answer = Event(), Event()


class _Handler(BaseHTTPRequestHandler):
    server: Model

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["content-length"]))
        self.server.asked.set()
        assert self.server.answer.wait(TIMEOUT)
        message = {"role": "assistant", "content": json.dumps(ANSWER)}
        choice = {"index": 0, "finish_reason": "stop", "message": message}
        whole = {"id": "1", "object": "chat.completion", "created": 1, "model": "m"}
        body = json.dumps({**whole, "choices": [choice]}).encode()
        self.send_response(200)
        self.send_header("content-type", "application/json")
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *args: Any) -> None:
        pass


@contextmanager
def model() -> Iterator[Model]:
    with Model() as running:
        thread = Thread(target=running.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield running
        running.answer.set()
        running.shutdown()
        thread.join()


def test_a_slow_model_holds_nobody_up() -> None:
    replies: list[dict[str, Any]] = []
    with model() as slow:
        url = f"http://127.0.0.1:{slow.server_address[1]}/v1"
        options = ["--llm", "llama.cpp:m", "--llm-url", url, "--llm-timeout", f"{TIMEOUT:g}s"]
        with serving("missions/maze-25.yaml", *options) as server:

            def instruct() -> None:
                said = {"text": "somebody at (5, 19.5) has a parcel that c would love to see"}
                replies.append(server.post("/api/instructions", said).json()["reply"])

            thread = Thread(target=instruct)
            thread.start()
            assert slow.asked.wait(TIMEOUT)
            # The model thinks; the mission runs, takes commands, and stops when it is told to.
            assert server.command("1", "cancel_task", task_label="bb").status_code == 200
            stopped = server.post("/api/instructions", {"text": "pause robot1"}).json()["reply"]
            assert stopped["done"]
            assert not replies
            slow.answer.set()
            thread.join(TIMEOUT)
    (reply,) = replies
    assert reply["status"] == "complete"
    assert [one["intent"] for one in reply["proposal"]["commands"]] == ["add_task"]
