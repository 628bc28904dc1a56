"""Words to commands by a language model, which proposes and never decides.

One call turns the newest words into typed commands or a question. The model has no tools; whatever
it answers is checked value by value against the operator's words and the live world; and if it does
not answer, the offline interpreter does.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from oath.commands import COMMANDS, Live
from oath.instruct import Dialogue, Interpreter, Reply
from oath.instruct.model.answer import Answer, Unusable, judge, read, settle
from oath.instruct.model.endpoint import TIMEOUT
from oath.instruct.model.prompt import LONGEST, answer_schema, message, plain, rules

if TYPE_CHECKING:
    from pydantic_ai.messages import ModelResponse
    from pydantic_ai.models import Model

__all__ = ["ModelInterpreter"]

Opened = Callable[[], "AbstractAsyncContextManager[Model]"]


class ModelInterpreter:
    """An `Interpreter` that asks a language model, and another interpreter if that fails.

    What happens without a confirmation (a stop) is for the other interpreter alone: it neither
    waits for the model nor depends on it.

    Parameters
    ----------
    opened
        Gives a model for one request, e.g. `oath.instruct.model.endpoint.opened` of an endpoint.
    offline
        Answers if the model does not, and the reply then says so; needs no time.
    timeout
        How long the model may take [s].
    """

    def __init__(self, opened: Opened, offline: Interpreter, *, timeout: float = TIMEOUT) -> None:
        # Loading the library takes seconds: not in the first instruction.
        import pydantic_ai.direct  # noqa: F401

        self._opened, self._offline, self._timeout = opened, offline, timeout
        self._rules = rules()

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        """See `Interpreter`."""
        said = dialogue.said[-1] if dialogue.said else ""
        if not plain(said).strip():
            return Reply(status="clarification", message="You said nothing. What is to be done?")
        if len(said) > LONGEST:
            return Reply(
                status="clarification",
                message=f"That is too long: {len(said)} characters, at most {LONGEST}. Say one "
                "thing at a time.",
            )
        reply = self._offline.interpret(dialogue, live)
        if reply.intent is not None and COMMANDS[reply.intent].immediate:
            return reply
        try:
            answer = self._ask(dialogue, live)
        except Exception as error:
            # The clients raise errors of many kinds. None of them may stop the dialogue, and their
            # texts may hold anything, so they are not shown.
            why = _what_happened(error, self._timeout)
            return replace(reply, note=f"(The language model {why}; understood offline.)")
        return settle(judge(answer, dialogue, live), reply, live)

    def _ask(self, dialogue: Dialogue, live: Live) -> Answer:
        """Ask in a thread of its own: the caller may have an event loop, and waits no longer."""
        schema, text = answer_schema(live, dialogue.said[-1]), message(dialogue, live)
        future: Future[Answer] = Future()

        def work() -> None:
            try:
                future.set_result(asyncio.run(self._request(text, schema)))
            except BaseException as error:
                future.set_exception(error)

        threading.Thread(target=work, daemon=True, name="language model").start()
        return future.result(self._timeout)

    async def _request(self, text: str, schema: dict[str, Any]) -> Answer:
        from pydantic_ai.direct import model_request
        from pydantic_ai.messages import ModelRequest
        from pydantic_ai.models import ModelRequestParameters
        from pydantic_ai.output import OutputObjectDefinition
        from pydantic_ai.tools import ToolDefinition

        async with asyncio.timeout(self._timeout), self._opened() as model:
            # A server that is made to keep to the schema answers in text. Anthropic allows too few
            # optional values for that, so there the answer is the one tool that must be "called".
            able = model.profile.get("supports_json_schema_output", False)
            native = able and model.system != "anthropic"
            tool = ToolDefinition(name="answer", parameters_json_schema=schema, kind="output")
            response = await model_request(
                model,
                [ModelRequest.user_text_prompt(text, instructions=self._rules)],
                model_request_parameters=ModelRequestParameters(
                    output_mode="native" if native else "tool",
                    output_object=OutputObjectDefinition(json_schema=schema, name="answer"),
                    output_tools=[tool],
                    allow_text_output=native,
                ),
                instrument=False,
            )
        return read(_content(response))


def _content(response: ModelResponse) -> str:
    """The answer's text, or what the one tool was called with."""
    from pydantic_ai.messages import TextPart, ToolCallPart

    if response.finish_reason not in (None, "stop", "tool_call"):
        raise Unusable
    calls = [part for part in response.parts if isinstance(part, ToolCallPart)]
    if len(calls) == 1:
        return calls[0].args_as_json_str()
    if calls:
        raise Unusable
    return "".join(part.content for part in response.parts if isinstance(part, TextPart))


def _what_happened(error: Exception, timeout: float) -> str:
    if isinstance(error, TimeoutError):
        return f"did not answer within {timeout:g} s"
    if isinstance(error, Unusable):
        return "gave no usable answer"
    status = getattr(error, "status_code", None)
    return f"refused with status {status}" if isinstance(status, int) else "cannot be reached"
