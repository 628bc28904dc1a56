"""What the linear models look at: words, their neighbours, and what words have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from oath.instruct.offline.tokens import Token

SPOTS = ("point", "place", "unknown_place")
"""Kinds of tokens that tell a place."""

_LONGEST = 90
"""Tokens that features are made of."""

Concepts = Mapping[str, tuple[tuple[tuple[str, ...], str], ...]]
"""What words and phrases have in common with others, by their first stem: ``(("call", "off"),
"@cancel")`` under ``call``."""


def stem(word: str) -> str:
    """A word without its usual endings: ``stopping`` and ``stopped`` are ``stop``."""
    for end in ("ing", "ed", "es", "s", "ly"):
        if word.endswith(end) and len(word) - len(end) >= 3 and not word.endswith("ss"):
            word = word[: -len(end)]
            break
    if len(word) > 3 and word[-1] == word[-2] and word[-1] not in "sl":
        word = word[:-1]
    return word.removesuffix("e") if len(word) > 3 else word


def shape(token: Token) -> str:
    """A token as the models see it: a word or mark as it is, an entity as a tag."""
    if token.kind in ("word", "mark"):
        return token.text
    return "<robots>" if token.kind == "robot" and token.value == "all" else f"<{token.kind}>"


def shapes(tokens: Sequence[Token]) -> list[str]:
    """An instruction as the models see it: runs of points as one."""
    seen: list[str] = []
    for token in tokens[:_LONGEST]:
        one = shape(token)
        if one == "<point>" and seen[-1:] in (["<point>"], ["<points>"]):
            seen[-1] = "<points>"
        elif (
            one == "<point>"
            and seen[-1:] in (["and"], [","], ["to"])
            and seen[-2:-1] in (["<point>"], ["<points>"])
        ):
            seen[-2:] = ["<points>"]
        else:
            seen.append(one)
    return seen


def _stems(words: Sequence[str]) -> list[str]:
    return [stem(one) if one.isalpha() else one for one in words]


def groups(stems: Sequence[str], concepts: Concepts) -> list[tuple[str, ...]]:
    """For each word which groups it, or a phrase that begins with it, belongs to."""
    return [
        (one,)
        if one[0] == "<"
        else tuple(
            group
            for phrase, group in concepts.get(one, ())
            if tuple(stems[n : n + len(phrase)]) == phrase
        )
        for n, one in enumerate(stems)
    ]


def classes(tokens: Sequence[Token], concepts: Concepts) -> set[str]:
    """The classes of words and phrases that an instruction holds."""
    stems = _stems([shape(one) for one in tokens[:_LONGEST]])
    return {group for some in groups(stems, concepts) for group in some if group[0] == "@"}


def of_line(tokens: Sequence[Token], concepts: Concepts) -> set[str]:
    """Of an instruction: words, pairs up to three apart, threes, pieces of words, concepts."""
    words = ["^", *shapes(tokens), "$"]
    stems = _stems(words)
    alike = groups(stems, concepts)
    found: set[str] = set()
    for n, word in enumerate(words):
        found |= {word, f"s:{stems[n]}", *alike[n]}
        for step in (1, 2, 3):
            if n + step >= len(words):
                break
            left, right = (stems[n], *alike[n]), (stems[n + step], *alike[n + step])
            if step == 3:
                left, right = left[:1], right[:1]
            found |= {f"{step}:{a} {b}" for a in left for b in right}
        if n + 2 < len(words):
            found.add(f"t:{stems[n]} {stems[n + 1]} {stems[n + 2]}")
        if word[0] != "<" and len(word) > 3:
            whole = f"[{word}]"
            found |= {f"~{whole[k : k + size]}" for size in (4, 5) for k in range(len(whole) - 3)}
    return found


def of_priority(line: set[str], intent: str, said: set[str]) -> set[str]:
    """Of an instruction's priority: the line's features, and the priorities that words name."""
    named = {f"@p{one}" for one in said or {"-"}}
    own = {f"{intent}|{one}" for one in line | named if one[:1] == "@" or one[:2] == "s:"}
    return line | named | own


def _around(tokens: Sequence[Token], at: int, concepts: Concepts, reach: int) -> set[str]:
    found: set[str] = set()
    seen = [shape(one) for one in tokens]
    alike = groups(_stems(seen), concepts)

    def word(n: int) -> str:
        return "^" if n < 0 else "$" if n >= len(seen) else seen[n]

    for step in range(-reach, reach + 1):
        one = word(at + step)
        bare = stem(one) if one.isalpha() else one
        found |= {f"{step}:{one}", f"{step}s:{bare}"}
        if 0 <= at + step < len(seen):
            found |= {f"{step}{group}" for group in alike[at + step]}
        found.add(f"{'b' if step < 0 else 'a'}:{bare}")
    found |= {
        f"b2:{word(at - 2)} {word(at - 1)}",
        f"b3:{word(at - 3)} {word(at - 2)} {word(at - 1)}",
        f"a2:{word(at + 1)} {word(at + 2)}",
        f"ba:{word(at - 1)} {word(at + 1)}",
    }
    return found


def of_mention(tokens: Sequence[Token], at: int, concepts: Concepts, intent: str) -> set[str]:
    """Of what is named at an index: what stands around it, and how many there are."""
    kind = tokens[at].kind.removeprefix("unknown_")
    spot = kind in SPOTS
    alike = [
        n
        for n, one in enumerate(tokens)
        if (one.kind in SPOTS if spot else one.kind.removeprefix("unknown_") == kind)
    ]
    order = alike.index(at)
    around = _around(tokens, at, concepts, 4)
    own = {
        f"{order} of {len(alike)}",
        f"kind {kind}",
        f"kind {tokens[at].kind}",
        f"{kind} {order} of {len(alike)}",
    }
    if sum(one.value == tokens[at].value for one in tokens) > 1:
        own.add("said again")
    for name, a, b in (
        ("then", at, alike[order + 1] if order + 1 < len(alike) else at),
        ("since", alike[order - 1] if order else at, at),
    ):
        between = _stems([shape(one) for one in tokens[a + 1 : b]][:8])
        own |= {f"{name}:{one}" for one in between}
        own |= {f"{name}:{one}" for some in groups(between, concepts) for one in some}
        own |= {f"{name}:{left} {right}" for left, right in pairwise(between)}
    kinds = [tokens[n].kind for n in alike]
    own.add(f"only {kind}" if kinds.count(tokens[at].kind) == 1 else f"several {kind}")
    return around | own | {f"{intent}|{one}" for one in around | own}


_SMALL = frozenset({
    "a", "an", "the", "some", "another", "is", "are", "was", "has", "have", "been", "lies",
    "lying", "blocks", "blocking", "stands", "standing", "sits", "from", "at", "between",
    "across", "along", "in", "on", "by", "left", "parked", "put", "there", "here", "now", "it",
    "its", "that", "this", "our", "my", "your", "his", "her", "their", "up", "down", "with",
    "for", "to", "into", "over", "all", "and", "or",
})  # fmt: skip
"""Words that are no part of a thing's name."""


def may_name(token: Token) -> bool:
    """Whether a token may be a word of what a thing is called."""
    return token.kind in ("word", "kind", "type") and token.text not in _SMALL


def of_kind(tokens: Sequence[Token], at: int, concepts: Concepts) -> set[str]:
    """Of a word that may be what an obstacle is called: its place in the sentence, its ending."""
    found = _around(tokens, at, concepts, 4)
    word = tokens[at].text
    found |= {f"-{word[-size:]}" for size in (2, 3, 4)}
    for step in range(1, 5):
        before = tokens[at - step].text if at >= step else "^"
        if before in _DETERMINERS:
            found.add(f"{before} {step} before")
            break
    points = [n for n, one in enumerate(tokens) if one.kind == "point"]
    if points:
        side = "before" if at < points[0] else "behind" if at > points[-1] else "between"
        near = min(points, key=lambda n: abs(n - at))
        apart = any(one.text in ".!;" for one in tokens[min(at, near) : max(at, near)])
        found |= {side, f"{min(abs(near - at), 9)} from points", f"{side}, apart {apart}"}
    kinds = [n for n, one in enumerate(tokens) if one.kind == "kind"]
    found |= {f"kind {'here' if n == at else 'before' if n < at else 'behind'}" for n in kinds}
    nth = sum(one.kind in ("word", "kind") for one in tokens[:at])
    found.add(f"word {min(nth, 6)}")
    return found


_DETERMINERS = frozenset({
    "a", "an", "the", "some", "another", "our", "my", "his", "her", "their", "this", "that",
    "these", "two", "three", "one",
})  # fmt: skip


def of_name(before: Sequence[str], after: Sequence[str]) -> set[str]:
    """Of a word that may be a label or just a word, as ``be``: what stands around it."""
    left = ["^", "^", "^", *before][-3:][::-1]
    right = [*after, "$", "$", "$"][:3]
    found = {f"-{n} {one}" for n, one in enumerate(left)}
    found |= {f"+{n} {one}" for n, one in enumerate(right)}
    found |= {f"-- {left[1]} {left[0]}", f"++ {right[0]} {right[1]}", f"-+ {left[0]} {right[0]}"}
    found |= {f"s-{n} {stem(one)}" for n, one in enumerate(left[:2])}
    found |= {f"s+{n} {stem(one)}" for n, one in enumerate(right[:2])}
    return found


_ENDS = frozenset(",.;:!?-")


def of_clarity(
    tokens: Sequence[Token], concepts: Concepts, intent: str, signs: set[str]
) -> set[str]:
    """Of an instruction that may be acted on.

    Its line, by itself and with the intent; words by whether they stand in a clause that names
    something or beside it; and signs of doubt.
    """
    line = of_line(tokens, concepts)
    own = {f"{intent}|{one}" for one in line if one[:2] in ("s:", "1:", "t:") or one[:1] in "@<"}
    found = {one for one in line if one[0] != "~"} | own | signs | {f"{intent}|{s}" for s in signs}
    clauses: list[list[Token]] = [[]]
    for token in tokens[:_LONGEST]:
        clauses[-1].append(token)
        if token.kind == "mark" and token.text in _ENDS:
            clauses.append([])
    named = [any(one.kind not in ("word", "mark") for one in clause) for clause in clauses]
    for clause, main in zip(clauses, named, strict=True):
        side = "in:" if main or not any(named) else "by:"
        stems = _stems(["^", *shapes(clause), "$"])
        alike = groups(stems, concepts)
        found |= {f"{side}{one}" for one in stems}
        found |= {f"{side}{one}" for some in alike for one in some}
        found |= {f"{side}{a} {b}" for a, b in pairwise(stems)}
    return found
