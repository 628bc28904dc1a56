"""Words that no instruction in training had."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Sequence

from oath.instruct.offline.gates import as_line
from oath.instruct.offline.tokens import Token

_HARMLESS = re.compile(r"[^\w]|[a-z]|\d+", re.UNICODE)


def strange(tokens: Sequence[Token], words: Container[str]) -> tuple[list[str], int]:
    """Words that no instruction in training had, and how many plain words there are."""
    plain = [one for one in tokens if one.kind == "word" and not _HARMLESS.fullmatch(one.text)]
    return [one.raw for one in plain if one.text not in words], len(plain)


_CLAUSES = {",", ".", ";", ":", "!", "and", "because", "since", "so", "but", "as", "for", "-"}


_IT = {"it", "that", "this", "him", "her", "them", "he", "she", "they", "one", "task", "job"}


def foreign(
    tokens: Sequence[Token], words: Container[str], means: Callable[[str], bool]
) -> str | None:
    """A word that no instruction in training had, beside a name or in an instruction without.

    None if a clause without such words says by itself what is to be done: `means` tells.
    """
    clauses: list[list[Token]] = [[]]
    for token in tokens:
        if token.text in _CLAUSES and token.kind in ("word", "mark"):
            clauses.append([])
        else:
            clauses[-1].append(token)
    named = [part for part in clauses if any(one.kind not in ("word", "mark") for one in part)]
    odd = [one for part in named or clauses for one in part if _is_foreign(one, words)]
    for part in clauses:
        told = part in named or any(one.text in _IT for one in part)
        if told and not any(_is_foreign(one, words) for one in part) and means(as_line(part)):
            return None
    return odd[0].raw if odd else None


def _is_foreign(token: Token, words: Container[str]) -> bool:
    plain = token.kind == "word" and not _HARMLESS.fullmatch(token.text)
    return plain and token.text not in words
