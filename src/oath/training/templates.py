"""Templates and the lexicon.

``templates.txt`` holds what operators say in templates, whose choices are drawn and slots filled
from sample worlds; ``lexicon.txt`` words and phrases by what they do in an instruction.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files

from oath.instruct.offline.features import Concepts, stem
from oath.instruct.offline.names import KINDS, Names, key, plain, tag
from oath.instruct.offline.tokens import Token, clean, lex

SOURCE = "templates.txt"
LEXICON = "lexicon.txt"

GATED = "gated"
"""The class of utterances that the models do not learn."""

_MACRO = re.compile(r"([A-Z]+) = (.*)")
_OPEN = re.compile(r"\$([A-Z]+)")
_SLOT = re.compile(r"\{(\w+)\}")
_FOREIGN = ("nonsense", "other languages", "injection")
"""Families whose words are not those of an operator."""


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the training text: what it means, the family that it belongs to."""

    intent: str
    family: str
    pattern: str


@dataclass(frozen=True, slots=True)
class Drawn:
    """An utterance drawn of a template; `roles` are those of its places and points, by index."""

    line: Line
    text: str
    tokens: tuple[Token, ...]
    roles: tuple[tuple[int, str], ...]


def lines() -> tuple[list[Line], dict[str, str]]:
    """The lines of the training text, and its named sets of choices."""
    text = files("oath.training").joinpath(SOURCE).read_text(encoding="utf-8")
    found: list[Line] = []
    macros: dict[str, str] = {}
    intent = family = ""
    for row in text.splitlines():
        row = row.strip()
        if row.startswith("== "):
            intent = row[3:]
        elif row.startswith("-- "):
            family = f"{intent}/{row[3:]}"
        elif match := _MACRO.fullmatch(row):
            macros[match[1]] = match[2]
        elif row and not row.startswith("#"):
            found.append(Line(intent, family, row))
    return found, macros


def lexicon() -> dict[str, list[str]]:
    """Words and phrases by what they do in an instruction."""
    text = files("oath.training").joinpath(LEXICON).read_text(encoding="utf-8")
    rows = [row.partition(":") for row in text.splitlines() if row and row[0] != "#"]
    return {name: [one.strip() for one in entries.split(",")] for name, _, entries in rows}


def concepts(macros: Mapping[str, str]) -> Concepts:
    """The words and phrases of named sets of choices, and of the lexicon."""
    sets = {name: choices.split("|") for name, choices in macros.items()}
    sets |= {f"{name}_": entries for name, entries in lexicon().items()}
    found: dict[str, set[tuple[tuple[str, ...], str]]] = {}
    for name, choices in sets.items():
        for choice in choices:
            words = [one.text for one in plain(choice)]
            if words and re.fullmatch(r"[\w' -]+", choice.strip()):
                phrase = tuple(stem(one) if one.isalpha() else one for one in words)
                found.setdefault(phrase[0], set()).add((phrase, f"@{name.lower()}"))
    return {first: tuple(sorted(some)) for first, some in sorted(found.items())}


def everyday(rows: list[Line], macros: Mapping[str, str]) -> frozenset[str]:
    """Every word that a template can be made of."""
    plain = [row.pattern for row in rows if row.family.split("/")[1] not in _FOREIGN]
    words: set[str] = set()
    for pattern in (*plain, *macros.values()):
        bare = _OPEN.sub(" ", _SLOT.sub(" ", pattern.replace("[n|]", "")))
        for token in lex(clean(re.sub(r"[\[\]|]", " ; ", bare))):
            words.add(token.text if token.kind == "word" and token.text != "n" else "")
    return frozenset(word for word in words if len(word) > 1 or word in ("a", "i"))


def drawn(seed: int = 0, each: int = 5, world: Names | None = None) -> Iterator[Drawn]:
    """Draw up to `each` utterances of every line, in sample worlds or in one."""
    rows, macros = lines()
    words = everyday(rows, macros)
    worlds = [world] if world is not None else [_world(names, words) for names in _WORLDS]
    rng = random.Random(seed)
    for row in rows:
        seen = set()
        for _ in range(each):
            pattern = _choice(row.pattern, macros, rng)
            there = rng.choice(worlds)
            if pattern in seen:
                continue
            seen.add(pattern)
            yield _filled(row, pattern, there, rng)


def _choice(pattern: str, macros: Mapping[str, str], rng: random.Random) -> str:
    """Draw one of each choice, the innermost first."""
    for _ in range(50):
        pattern = _OPEN.sub(lambda match: f"[{macros[match[1]]}]", pattern)
        chosen = re.sub(r"\[([^\[\]]*)\]", lambda m: rng.choice(m[1].split("|")), pattern)
        if chosen == pattern:
            break
        pattern = chosen
    return " ".join(pattern.replace(" ,", ",").split())


# -- sample worlds

_WORLDS = (
    (
        ("b", "c", "d", "e"),
        ("robot1", "robot2", "robot3", "robot4"),
        ("bb", "cb", "db", "gb", "bc", "cc", "dc", "fc", "bd", "cd", "fd", "ce", "af", "eg"),
        ("wall-1", "bush-3", "gate-1"),
        ("normal", "special"),
    ),
    (
        ("reception", "kitchen", "printer", "post"),
        ("cart-1", "cart-2", "drone-1"),
        ("mail-1", "mail-2", "t7", "j12", "parcel-3"),
        ("plant-1", "boxes-1", "obstacle-4"),
        ("carry", "inspect"),
    ),
    (
        ("dock", "pack-north", "pack-south", "charger"),
        ("amr-1", "amr-2", "amr-3"),
        ("t1", "t2", "t13", "q4", "x9"),
        ("pallet-2", "wall-12"),
        ("tote", "pallet"),
    ),
)


def _world(names: Sequence[tuple[str, ...]], words: frozenset[str]) -> Names:
    places, robots, labels, obstacles, types = ({key(one): one for one in some} for some in names)
    kinds = {kind: kind for kind in sorted(KINDS)}
    return Names(places, robots, labels, obstacles, kinds, types, words)


def _filled(row: Line, pattern: str, world: Names, rng: random.Random) -> Drawn:
    """Fill the slots of a drawn line; note what its places and points are for."""
    text = _SLOT.sub(lambda match: _value(match[1], world, rng), pattern)
    if rng.random() < 0.3:
        text = text[:1].upper() + text[1:]
    if rng.random() < 0.3 and text[-1:] not in "?.!":
        text += "?" if re.match(r"(can|could|would|will) you", pattern) else "."
    tokens = tuple(tag(text, world))
    asked = [slot for slot in _SLOT.findall(pattern) if slot in _ROLES]
    spots = [n for n, one in enumerate(tokens) if one.kind in ("point", "place", "unknown_place")]
    roles: tuple[tuple[int, str], ...] = ()
    if len(asked) == len(spots) and row.intent == "add_task":
        roles = tuple((n, _ROLES[slot]) for n, slot in zip(spots, asked, strict=True))
    return Drawn(row, text, tokens, roles)


_ROLES = {"pickup": "pickup", "delivery": "delivery", "place": "other", "point": "other"}


def _value(slot: str, world: Names, rng: random.Random) -> str:
    match slot:
        case "pickup":
            return _point(rng) if rng.random() < 0.85 else _place(world, rng)
        case "delivery":
            return _place(world, rng) if rng.random() < 0.85 else _point(rng)
        case "point":
            return _point(rng)
        case "points":
            return _points(rng)
        case "place":
            return _place(world, rng)
        case "label":
            label = rng.choice(list(world.labels.values()))
            return label if rng.random() < 0.7 else f'"{label}"'
        case "newlabel":
            return rng.choice(("aa", "zz", "n1", "xy7", '"hh"', "k3"))
        case "robots":
            return rng.choice(_EVERY)
        case "kind":
            return rng.choice(("wall", "wall", "bush", "pallet", "box", "fence", "gate", "door"))
        case "type":
            return rng.choice(list(world.types.values()))
        case "robot":
            return rng.choice(list(world.robots.values()))
        case "obstacle":
            return rng.choice(list(world.obstacles.values()))
    raise ValueError(slot)


_EVERY = (
    "all robots", "all the robots", "everyone", "everything", "the whole fleet", "every robot",
    "all units", "the fleet", "all of the robots",
)  # fmt: skip

_SPOKEN = ("three", "seven", "twelve", "four point five", "nineteen point five", "two and a half")


def _point(rng: random.Random) -> str:
    x, y = (rng.choice((rng.randint(1, 19), round(rng.uniform(1, 19), 1))) for _ in range(2))
    match rng.randrange(10):
        case 0:
            return f"{x}, {y}"
        case 1:
            return f"{x} {y}"
        case 2:
            return f"x={x} y={y}"
        case 3:
            return f"{rng.choice(_SPOKEN)} and {rng.choice(_SPOKEN)}"
        case 4:
            return f"[{x}, {y}]"
    return f"({x}, {y})"


def _points(rng: random.Random) -> str:
    points = [f"({rng.randint(1, 19)}, {rng.randint(1, 19)})" for _ in range(rng.randint(3, 5))]
    match rng.randrange(6):
        case 0:
            return f"[{', '.join(points)}]"
        case 1:
            return f"{', '.join(points[:-1])} and {points[-1]}"
        case 2:
            return f"{points[0]} and {points[1]}"
        case 3:
            return ", ".join(points)
    return f"{points[0]} to {points[1]}"


def _place(world: Names, rng: random.Random) -> str:
    name = rng.choice(list(world.places.values()))
    match rng.randrange(4):
        case 0:
            return name.upper() if len(name) == 1 else f"the {name}"
        case 1:
            noun = rng.choice(("point", "room", "station", "place"))
            return f"{noun} {name.upper()}" if len(name) == 1 else f"the {name}"
    return name
