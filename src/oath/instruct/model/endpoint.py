"""Where a language model is, and who may be sent the key to it.

A key goes to listed addresses only, over TLS. The clients of the providers never hold it: they work
with a placeholder, which is replaced in the very request, after its address was looked at.
"""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any

from oath.errors import BadInput

if TYPE_CHECKING:
    import httpx2
    from pydantic_ai.models import Model

TIMEOUT = 8.0
"""How long a model may take to answer [s], if nothing else is asked for."""

HOSTS = frozenset({"api.openai.com", "api.anthropic.com"})
"""Hosts that are listed from the start."""

_PROVIDERS: dict[str, tuple[str, str | None]] = {
    "openai": ("https://api.openai.com/v1", "OPENAI_API_KEY"),
    "anthropic": ("https://api.anthropic.com", "ANTHROPIC_API_KEY"),
    "ollama": ("http://127.0.0.1:11434/v1", None),
    "vllm": ("http://127.0.0.1:8000/v1", None),
    "llama.cpp": ("http://127.0.0.1:8080/v1", None),
}
"""The usual address of every provider, and the variable that holds the key for that address."""

_PLACEHOLDER = "no-key-here"

_SENT = frozenset(
    {
        "accept",
        "accept-encoding",
        "anthropic-beta",
        "anthropic-version",
        "authorization",
        "connection",
        "content-length",
        "content-type",
        "host",
        "transfer-encoding",
        "user-agent",
        "x-api-key",
    }
)
"""Headers that leave; the clients would add what they find in the environment."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Endpoint:
    """A language model at an address.

    Attributes
    ----------
    provider, model
        Who serves it, and its name there.
    url
        The address below which the API lies.
    key
        Sent with every request, if there is one.
    temperature
        Of the sampling; by default the provider's own.
    max_tokens
        Longest answer [tokens].
    """

    provider: str
    model: str
    url: str
    key: str | None = field(default=None, repr=False)
    temperature: float | None = None
    max_tokens: int = 2000


def endpoint(
    environ: Mapping[str, str], *, model: str, url: str | None = None, hosts: Iterable[str] = ()
) -> Endpoint:
    """The model that is asked for, with the key for its address.

    Parameters
    ----------
    environ
        The environment; it holds the keys.
    model
        ``PROVIDER:NAME``, e.g. ``ollama:qwen3:8b``.
    url
        Its address; the provider's usual one by default.
    hosts
        Listed hosts beyond `HOSTS`.

    Raises
    ------
    BadInput
        If the provider is unknown, the address is not listed or not safe, or the key is missing.
    """
    provider, _, name = model.partition(":")
    if provider not in _PROVIDERS or not name:
        raise BadInput(
            f"{model!r} names no language model",
            field="llm",
            remedy=f"write PROVIDER:NAME; providers: {', '.join(_PROVIDERS)}",
        )
    usual, variable = _PROVIDERS[provider]
    listed = {*HOSTS, *(host.casefold() for host in hosts)}
    host = _checked_host(url or usual, listed)
    at_home = variable is not None and host == _host(usual)
    key = environ.get("OATH_LLM_KEY") or (environ.get(variable) if variable and at_home else None)
    if at_home and not key:
        raise BadInput(f"{provider} needs a key", field="llm", remedy=f"set {variable}")
    if key and not (key.isascii() and key.isprintable() and " " not in key):
        raise BadInput("the key holds blanks or odd characters", field="llm", remedy="set it again")
    return Endpoint(
        provider=provider,
        model=name,
        url=url or usual,
        key=key if host in listed else None,
        temperature=None if at_home else 0.0,
    )


def seconds(text: str) -> float:
    """A timeout [s] from the environment.

    Raises
    ------
    BadInput
        If it is no number between 0.1 and 600.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.1 <= value <= 600:
        raise BadInput(
            f"the timeout {text[:20]!r} must be a number of seconds from 0.1 to 600",
            field="OATH_LLM_TIMEOUT",
            remedy="write e.g. 8",
        )
    return value


def _host(url: str) -> str:
    import httpx2

    return httpx2.URL(url).host.casefold()


def _checked_host(url: str, listed: set[str]) -> str:
    """The host of an address that may be talked to."""
    import httpx2

    try:
        parsed = httpx2.URL(url)
    except (httpx2.InvalidURL, ValueError):
        raise BadInput("the model's address is no URL", field="llm-url", remedy=_EXAMPLE) from None
    host = parsed.host.casefold()
    if parsed.scheme not in ("http", "https") or not host:
        raise BadInput(
            "the model's address must begin with https:// or http://",
            field="llm-url",
            remedy=_EXAMPLE,
        )
    if parsed.userinfo or parsed.query or parsed.fragment:
        raise BadInput(
            "the model's address must hold no name, password, query or fragment",
            field="llm-url",
            remedy="give the key in OATH_LLM_KEY",
        )
    if is_loopback(host):
        return host
    if host not in listed:
        raise BadInput(
            f"{host} is not among the hosts that may be sent words and keys",
            field="llm-url",
            remedy=f"if you trust it, add it: OATH_LLM_HOSTS={host}",
        )
    if parsed.scheme != "https":
        raise BadInput(
            f"{host} is not on this machine, so it must be talked to in private",
            field="llm-url",
            remedy="use https://",
        )
    return host


_EXAMPLE = "write e.g. http://127.0.0.1:8080/v1"


def is_loopback(host: str) -> bool:
    """Whether a host is this machine."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@asynccontextmanager
async def opened(where: Endpoint) -> AsyncIterator[Model]:
    """A model that asks this endpoint, once per request: no retries, no redirects, no telemetry."""
    import httpx2
    from pydantic_ai.settings import ModelSettings

    settings = ModelSettings(max_tokens=where.max_tokens)
    if where.temperature is not None:
        settings["temperature"] = where.temperature
    base = httpx2.URL(where.url)
    async with httpx2.AsyncClient(
        event_hooks={"request": [_Guard(base, where.key)]},
        follow_redirects=False,
        # Requests to this machine must not pass a proxy.
        trust_env=not is_loopback(base.host.casefold()),
        timeout=None,
    ) as client:
        common: dict[str, Any] = {
            "base_url": where.url,
            "api_key": _PLACEHOLDER,
            "http_client": client,
            "max_retries": 0,
        }
        if where.provider == "anthropic":
            from anthropic import AsyncAnthropic
            from pydantic_ai.models.anthropic import AnthropicModel
            from pydantic_ai.providers.anthropic import AnthropicProvider

            anthropic = AsyncAnthropic(open_telemetry=False, **common)
            provider = AnthropicProvider(anthropic_client=anthropic)
            yield AnthropicModel(where.model, provider=provider, settings=settings)
            return
        from openai import AsyncOpenAI
        from pydantic_ai.models.openai import OpenAIChatModel
        from pydantic_ai.profiles.openai import OpenAIModelProfile
        from pydantic_ai.providers.openai import OpenAIProvider
        from pydantic_ai.providers.openai_compatible import OpenAICompatibleProvider

        openai = AsyncOpenAI(**common)
        if where.provider == "openai":
            own = OpenAIProvider(openai_client=openai)
            yield OpenAIChatModel(where.model, provider=own, settings=settings)
            return
        # The servers that people run keep to a schema, and know the limit by its old name.
        profile = OpenAIModelProfile(
            supports_json_schema_output=True, openai_chat_supports_max_completion_tokens=False
        )
        other = OpenAICompatibleProvider(where.provider, openai_client=openai)
        yield OpenAIChatModel(where.model, provider=other, settings=settings, profile=profile)


class _Guard:
    """Looks at every request: it goes to the endpoint, with the key and nothing else private."""

    def __init__(self, base: httpx2.URL, key: str | None) -> None:
        self._origin = (base.scheme, base.host, base.port)
        self._key = key

    async def __call__(self, request: httpx2.Request) -> None:
        url = request.url
        if (url.scheme, url.host, url.port) != self._origin:
            raise BadInput("a request would go to another address than the model's")
        for name, value in list(request.headers.items()):
            if name.lower() not in _SENT:
                del request.headers[name]
            elif name.lower() in ("authorization", "x-api-key"):
                del request.headers[name]
                if self._key and _PLACEHOLDER in value:
                    request.headers[name] = value.replace(_PLACEHOLDER, self._key)
