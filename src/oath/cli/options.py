"""Arguments and options that several commands share."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from oath import DEFAULT_ALLOCATOR

if TYPE_CHECKING:
    from oath.instruct import Interpreter


def examples(*lines: str) -> str:
    """Return the examples of a command for its help."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def mission_argument(command: Callable[..., None]) -> Callable[..., None]:
    """The mission file."""
    return click.argument("mission", metavar="MISSION", type=click.Path(path_type=Path))(command)


def seed_option(command: Callable[..., None]) -> Callable[..., None]:
    """``--seed``."""
    return click.option(
        "--seed", default=0, show_default=True, type=click.IntRange(min=0), help="Random seed."
    )(command)


def json_option(command: Callable[..., None]) -> Callable[..., None]:
    """``--json``."""
    return click.option(
        "--json", "as_json", is_flag=True, help="Print one JSON object and nothing else."
    )(command)


def points_option(default: int) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """``--points``."""
    return click.option(
        "--points",
        default=default,
        show_default=True,
        type=click.IntRange(1, 1_000_000),
        help="Sampled points of the roadmap.",
    )


def allocator_option(command: Callable[..., None]) -> Callable[..., None]:
    """``--allocator``."""
    return click.option(
        "--allocator", default=DEFAULT_ALLOCATOR, show_default=True, help="Who assigns the tasks."
    )(command)


def weight_option(command: Callable[..., None]) -> Callable[..., None]:
    """``--makespan-weight``."""
    # None tells an allocator that weighs nothing from one that was asked to.
    return click.option(
        "--makespan-weight",
        type=click.FloatRange(min=0.0),
        help="Weight of the makespan beside the sum of lengths [m/s], for allocators that minimise "
        "both.  [default: 1]",
    )(command)


def seconds(ctx: click.Context, param: click.Parameter, value: str | None) -> float | None:
    """Parse a duration such as 200ms or 1.5s [s]."""
    if value is None:
        return None
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(ms|s)", value)
    if not match:
        raise click.BadParameter(f"'{value}' is no duration; write e.g. 200ms or 1.5s")
    return float(match[1]) * (1e-3 if match[2] == "ms" else 1.0)


def budget_option(command: Callable[..., None]) -> Callable[..., None]:
    """``--budget``."""
    return click.option(
        "--budget",
        callback=seconds,
        help="Time to improve an answer: 200ms, 1.5s.  [default: a fixed number of iterations, the "
        "same on every machine]",
    )(command)


def interpreter_options(command: Callable[..., None]) -> Callable[..., None]:
    """``--llm``, ``--llm-url``, ``--llm-timeout`` and ``--llm-host``.

    The command is given `interpreter`, which returns the interpreter that was chosen. There is no
    option for a key: what stands on a command line can be read by others.
    """

    @click.option(
        "--llm",
        metavar="PROVIDER:NAME",
        help="Language model that interprets first, e.g. ollama:qwen3:8b; none for none.  "
        "[default: $OATH_LLM_MODEL, else none]",
    )
    @click.option("--llm-url", metavar="URL", help="Its address.  [default: the provider's own]")
    @click.option(
        "--llm-timeout",
        callback=seconds,
        help="How long it may take: 500ms, 8s.  [default: $OATH_LLM_TIMEOUT, else 8s]",
    )
    @click.option(
        "--llm-host",
        multiple=True,
        metavar="HOST",
        help="Host that may be sent words and the key, beside the usual ones; may be repeated.",
    )
    @wraps(command)
    def with_interpreter(
        *args: Any,
        llm: str | None,
        llm_url: str | None,
        llm_timeout: float | None,
        llm_host: tuple[str, ...],
        **kwargs: Any,
    ) -> None:
        def interpreter() -> Interpreter:
            from oath.instruct import chosen_interpreter

            return chosen_interpreter(
                os.environ, model=llm, url=llm_url, timeout=llm_timeout, hosts=llm_host
            )

        command(*args, interpreter=interpreter, **kwargs)

    return with_interpreter
