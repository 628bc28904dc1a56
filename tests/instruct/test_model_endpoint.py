"""A key is sent to listed addresses only, and shown nowhere."""

from __future__ import annotations

import asyncio
import json
import logging
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from types import ModuleType
from typing import Any

import click
import pytest
from click.testing import CliRunner

from missions import delivery, robot, yard
from oath.cli.options import interpreter_options
from oath.commands import Live
from oath.errors import BadInput
from oath.instruct import Dialogue, Interpreter, Reply, chosen_interpreter
from oath.instruct.model import ModelInterpreter
from oath.instruct.model.endpoint import Endpoint, _Guard, endpoint, opened, seconds
from oath.scene import prepare
from oath.state import State
from oath.world.roadmap import Params

KEY = "sk-very-secret"


class Recorder(ThreadingHTTPServer):
    """Answers every request in the same way, and keeps what it was sent."""

    def __init__(self, status: int = 200, headers: dict[str, str] | None = None) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.status, self.headers = status, headers or {}
        self.seen: list[tuple[str, dict[str, str], bytes]] = []

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class _Handler(BaseHTTPRequestHandler):
    server: Recorder

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        sent = {name.lower(): value for name, value in self.headers.items()}
        self.server.seen.append((self.path, sent, body))
        answer = json.dumps(_OPENAI if "chat" in self.path else _ANTHROPIC).encode()
        self.send_response(self.server.status)
        for name, value in self.server.headers.items():
            self.send_header(name, value)
        self.send_header("content-type", "application/json")
        self.send_header("content-length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)

    def log_message(self, *args: Any) -> None:
        pass


_OPENAI = {
    "id": "1",
    "object": "chat.completion",
    "created": 1,
    "model": "m",
    "choices": [
        {"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": "hi"}}
    ],
}
_ANTHROPIC = {
    "id": "1",
    "type": "message",
    "role": "assistant",
    "model": "m",
    "content": [{"type": "text", "text": "hi"}],
    "stop_reason": "end_turn",
    "stop_sequence": None,
    "usage": {"input_tokens": 1, "output_tokens": 1},
}


@pytest.fixture
def recorder() -> Iterator[Recorder]:
    with Recorder() as server:
        thread = Thread(target=server.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture(autouse=True)
def others_secrets(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything that the providers' clients would send of their own accord."""
    for name in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY", "ANTHROPIC_AUTH_TOKEN", "OPENAI_ADMIN_KEY"):
        monkeypatch.setenv(name, "sk-of-another")
    monkeypatch.setenv("OPENAI_ORG_ID", "org-of-another")
    monkeypatch.setenv("OPENAI_PROJECT_ID", "project-of-another")
    monkeypatch.setenv("OPENAI_CUSTOM_HEADERS", "X-Mine: a-of-another")
    monkeypatch.setenv("ANTHROPIC_CUSTOM_HEADERS", "Authorization: Bearer b-of-another")
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    monkeypatch.delenv("NO_PROXY", raising=False)


class Deaf:
    """Stands in for the offline interpreter."""

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        return Reply(status="clarification", message="What do you mean?")


@pytest.fixture(scope="module")
def live() -> Live:
    mission = yard([robot("r", (1, 1))], [delivery("aa", (1, 9), (5, 9))])
    return Live(prepare(mission, Params(points=20)), State.of(mission))


def call(where: Endpoint) -> str:
    from pydantic_ai.direct import model_request
    from pydantic_ai.messages import ModelRequest

    async def request() -> str:
        async with asyncio.timeout(20), opened(where) as model:
            prompt = ModelRequest.user_text_prompt("hello")
            return str(await model_request(model, [prompt], instrument=False))

    return asyncio.run(request())


PROVIDERS = ["openai", "ollama", "vllm", "llama.cpp", "anthropic"]


@pytest.mark.parametrize("provider", PROVIDERS)
def test_an_address_off_the_list_is_sent_no_key(provider: str, recorder: Recorder) -> None:
    environ = {"OATH_LLM_KEY": KEY, "OPENAI_API_KEY": KEY, "ANTHROPIC_API_KEY": KEY}
    where = endpoint(environ, model=f"{provider}:m", url=recorder.url)
    assert "hi" in call(where)
    ((_, headers, body),) = recorder.seen
    assert KEY not in json.dumps(headers) + body.decode()
    assert "another" not in json.dumps(headers) + body.decode()
    assert "authorization" not in headers
    assert "x-api-key" not in headers


@pytest.mark.parametrize("provider", ["openai", "llama.cpp"])
def test_a_listed_address_is_sent_the_key(provider: str, recorder: Recorder) -> None:
    environ = {"OATH_LLM_KEY": KEY}
    where = endpoint(environ, model=f"{provider}:m", url=recorder.url, hosts=["127.0.0.1"])
    call(where)
    ((path, headers, _),) = recorder.seen
    assert headers["authorization"] == f"Bearer {KEY}"
    assert path == "/chat/completions"
    assert "another" not in json.dumps(headers)


def test_anthropic_is_sent_the_key_in_its_own_way(
    recorder: Recorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ANTHROPIC_CUSTOM_HEADERS")
    environ = {"OATH_LLM_KEY": KEY}
    call(endpoint(environ, model="anthropic:m", url=recorder.url, hosts=["127.0.0.1"]))
    ((path, headers, _),) = recorder.seen
    assert path == "/v1/messages"
    assert KEY in (headers.get("x-api-key", "") + headers.get("authorization", ""))
    assert "anthropic-version" in headers


@pytest.mark.parametrize("provider", PROVIDERS)
def test_an_answer_is_held_to_the_schema(provider: str, recorder: Recorder, live: Live) -> None:
    where = endpoint({}, model=f"{provider}:m", url=recorder.url)
    ModelInterpreter(lambda: opened(where), Deaf()).interpret(Dialogue(said=("hello",)), live)
    ((_, _, body),) = recorder.seen
    sent = json.loads(body)
    if provider == "anthropic":
        (tool,) = sent["tools"]
        assert sent["tool_choice"]["type"] in ("any", "tool")
        schema = tool["input_schema"]
    else:
        assert "tools" not in sent
        schema = sent["response_format"]["json_schema"]["schema"]
    assert schema["required"] == ["verdict", "about", "commands"]
    assert ("max_completion_tokens" in sent) == (provider == "openai")
    assert sent.get("temperature") == 0.0


def test_a_redirect_is_not_followed(recorder: Recorder) -> None:
    with Recorder() as other:
        thread = Thread(target=other.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        recorder.status, recorder.headers = 307, {"location": f"{other.url}/chat/completions"}
        environ = {"OATH_LLM_KEY": KEY}
        where = endpoint(environ, model="openai:m", url=recorder.url, hosts=["127.0.0.1"])
        with pytest.raises(Exception) as caught:
            call(where)
        other.shutdown()
        thread.join()
        assert other.seen == []
        assert len(recorder.seen) == 1
        assert KEY not in str(caught.value)


def test_a_request_elsewhere_is_stopped() -> None:
    import httpx2

    guard = _Guard(httpx2.URL("https://api.openai.com/v1"), KEY)
    for url in ("https://api.openai.com.evil.net/v1", "http://api.openai.com/v1", "https://a.b/"):
        with pytest.raises(BadInput):
            asyncio.run(guard(httpx2.Request("POST", url)))


def test_nothing_is_tried_twice(recorder: Recorder) -> None:
    recorder.status = 500
    with pytest.raises(Exception, match="500"):
        call(endpoint({}, model="llama.cpp:m", url=recorder.url))
    assert len(recorder.seen) == 1


def test_the_key_is_in_no_log_and_no_representation(
    recorder: Recorder, caplog: pytest.LogCaptureFixture
) -> None:
    where = endpoint({"OATH_LLM_KEY": KEY}, model="openai:m", url=recorder.url, hosts=["127.0.0.1"])
    with caplog.at_level(logging.DEBUG):
        call(where)
    assert KEY not in caplog.text
    assert KEY not in repr(where)
    assert KEY not in str(replace(where, model="n"))


@pytest.mark.parametrize("provider", ["openai", "anthropic"])
def test_nothing_is_traced(
    provider: str, recorder: Recorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    import opentelemetry.trace as trace

    spans: list[str] = []

    class Tracer(trace.NoOpTracer):
        def start_span(self, name: str, *args: Any, **kwargs: Any) -> trace.Span:
            spans.append(name)
            return super().start_span(name, *args, **kwargs)

        def start_as_current_span(self, name: str, *args: Any, **kwargs: Any) -> Any:
            spans.append(name)
            return super().start_as_current_span(name, *args, **kwargs)

    class Provider(trace.NoOpTracerProvider):
        def get_tracer(self, *args: Any, **kwargs: Any) -> trace.Tracer:
            return Tracer()

    monkeypatch.setattr(trace, "_TRACER_PROVIDER", Provider())
    monkeypatch.setenv("ANTHROPIC_OPEN_TELEMETRY_TRACES_CONTENT_MODE", "content")
    call(endpoint({}, model=f"{provider}:m", url=recorder.url))
    assert spans == []
    assert "traceparent" not in recorder.seen[0][1]


REFUSED = [
    ("qwen3", None, (), "names no language model"),
    ("qwen3:8b", None, (), "names no language model"),
    ("openai:", None, (), "names no language model"),
    ("openai:m", "https://evil.net/v1", (), "not among the hosts"),
    ("openai:m", "https://api.openai.com.evil.net/v1", (), "not among the hosts"),
    ("openai:m", "https://127.0.0.1.evil.net/v1", (), "not among the hosts"),
    ("openai:m", "https://api.openai.com@evil.net/v1", (), "no name, password"),
    ("openai:m", "https://evil.net\\@api.openai.com/v1", (), "no URL|name, password|not among"),
    ("openai:m", "http://api.openai.com/v1", (), "in private"),
    ("openai:m", "http://my.host/v1", ("my.host",), "in private"),
    ("openai:m", "https://api.openai.com/v1?key=1", (), "query"),
    ("openai:m", "ftp://api.openai.com/v1", (), "must begin with"),
    ("openai:m", "api.openai.com/v1", (), "must begin with"),
    ("openai:m", "http://[::1", (), "no URL"),
    ("openai:m", None, (), "needs a key"),
    ("anthropic:m", None, (), "needs a key"),
]


@pytest.mark.parametrize(("model", "url", "hosts", "problem"), REFUSED)
def test_a_configuration_that_is_not_safe_is_refused(
    model: str, url: str | None, hosts: tuple[str, ...], problem: str
) -> None:
    with pytest.raises(BadInput, match=problem) as caught:
        endpoint({}, model=model, url=url, hosts=hosts)
    assert caught.value.remedy


def test_a_key_that_cannot_be_one_is_refused_unseen() -> None:
    for key in ("sk-very-secret\nX-Header: 1", "sk-very secret", "sk-very-secrét"):
        with pytest.raises(BadInput) as caught:
            endpoint({"OATH_LLM_KEY": key}, model="openai:m")
        assert "very" not in str(caught.value)


def test_whose_key_is_whose() -> None:
    environ = {"OPENAI_API_KEY": "sk-openai", "ANTHROPIC_API_KEY": "sk-anthropic"}
    assert endpoint(environ, model="openai:m").key == "sk-openai"
    assert endpoint(environ, model="anthropic:m").key == "sk-anthropic"
    mine = "https://my.host/v1"
    assert endpoint(environ, model="openai:m", url=mine, hosts=["My.Host"]).key is None
    assert endpoint(environ, model="ollama:m").key is None
    own = {**environ, "OATH_LLM_KEY": "sk-mine"}
    assert endpoint(own, model="vllm:m", url=mine, hosts=["my.host"]).key == "sk-mine"
    assert endpoint(own, model="vllm:m").key is None


@pytest.mark.parametrize("text", ["nan", "0", "-1", "1e9", "soon", ""])
def test_a_timeout_is_a_number_of_seconds(text: str) -> None:
    with pytest.raises(BadInput):
        seconds(text)


# -- what is chosen


@pytest.fixture
def offline(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("oath.instruct.offline")
    module.Offline = Deaf  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "oath.instruct.offline", module)


@pytest.mark.usefixtures("offline")
def test_without_a_model_nothing_is_asked() -> None:
    assert isinstance(chosen_interpreter({}), Deaf)
    assert isinstance(chosen_interpreter({"OATH_LLM_MODEL": ""}), Deaf)
    off = chosen_interpreter({"OATH_LLM_MODEL": "ollama:m"}, model="none")
    assert isinstance(off, Deaf)


@pytest.mark.usefixtures("offline")
def test_a_model_is_chosen_by_the_environment_or_by_options(recorder: Recorder, live: Live) -> None:
    environ = {"OATH_LLM_MODEL": "vllm:m", "OATH_LLM_URL": recorder.url, "OATH_LLM_KEY": KEY}
    dialogue = Dialogue(said=("cancel aa",))
    for given in (environ, {**environ, "OATH_LLM_HOSTS": "my.host, 127.0.0.1"}):
        chosen_interpreter(given).interpret(dialogue, live)
    chosen_interpreter(
        {"OATH_LLM_KEY": KEY}, model="vllm:n", url=recorder.url, hosts=["127.0.0.1"]
    ).interpret(dialogue, live)
    keys = [headers.get("authorization") for _, headers, _ in recorder.seen]
    assert keys == [None, f"Bearer {KEY}", f"Bearer {KEY}"]
    assert [json.loads(body)["model"] for *_, body in recorder.seen] == ["m", "m", "n"]


@pytest.mark.usefixtures("offline")
def test_a_wrong_configuration_is_told_at_once() -> None:
    for environ in ({"OATH_LLM_MODEL": "gpt"}, {"OATH_LLM_MODEL": "openai:m"}):
        with pytest.raises(BadInput):
            chosen_interpreter(environ)
    with pytest.raises(BadInput, match="timeout"):
        chosen_interpreter({"OATH_LLM_MODEL": "ollama:m", "OATH_LLM_TIMEOUT": "soon"})


@pytest.mark.usefixtures("offline")
def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("httpx2", "pydantic_ai", "pydantic_ai.direct"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(BadInput, match=r"install oath-fleet\[llm\]"):
        chosen_interpreter({}, model="ollama:m")


@pytest.mark.usefixtures("offline")
def test_the_program_gives_a_command_its_interpreter(monkeypatch: pytest.MonkeyPatch) -> None:
    @click.command()
    @interpreter_options
    def listen(interpreter: Callable[[], Interpreter]) -> None:
        click.echo(type(interpreter()).__name__)

    monkeypatch.delenv("OATH_LLM_MODEL", raising=False)
    run = CliRunner().invoke
    assert run(listen, []).output == "Deaf\n"
    model = ["--llm", "ollama:m", "--llm-timeout", "500ms", "--llm-host", "my.host"]
    assert run(listen, model).output == "ModelInterpreter\n"
    assert isinstance(run(listen, ["--llm", "gpt"]).exception, BadInput)
