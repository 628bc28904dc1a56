"""What the words of an instruction stand for in the live world."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import lru_cache, partial

from oath.commands import Live
from oath.instruct.offline.axes import read_axes
from oath.instruct.offline.model import Models
from oath.instruct.offline.spelling import mended, spelled
from oath.instruct.offline.tokens import Token, clean, lex, read_numbers, read_points

NOUNS = {
    "place": {
        "point", "room", "station", "place", "location", "area", "bay", "site", "spot",
        "destination", "zone", "position", "delivery", "drop-off", "waypoint", "stop", "pick-up",
    },
    "label": {
        "task", "job", "label", "labelled", "labeled", "id", "named", "called", "order",
        "assignment", "errand", "request", "tasks", "jobs", "ticket", "delivery", "item", "work",
        "labels", "orders", "transport", "mission", "code", "tag", "tagged", "name",
    },
    "robot": {"robot", "bot", "unit", "r", "vehicle", "machine", "agv", "amr", "robots", "bots"},
    "obstacle": {"obstacle", "wall", "id", "barrier", "obstruction", "blockage"},
}  # fmt: skip
"""Words in front of a name that say what it names."""

KINDS = {
    "wall", "barrier", "bush", "box", "gate", "fence", "rock", "spill", "hole", "tree", "crate",
    "pallet", "cart", "car", "forklift", "door", "plant", "table", "chair", "ladder", "truck",
    "puddle", "shelf", "rack", "cone", "debris", "rubble", "hedge", "stone", "boulder", "trolley",
    "stretcher", "cable", "skip", "bucket", "hose", "sofa", "wheelchair", "bike", "bicycle",
    "lorry",
    "van", "tarpaulin", "beam", "pipe", "branch", "barrel", "drum", "bench", "fridge", "cabinet",
    "dumpster", "trailer", "rope", "net", "curtain", "leak", "ditch", "trench", "railing",
    "bollard",
    "column", "divider", "booth", "statue", "scooter", "desk", "wardrobe", "ramp", "cordon",
    "container", "cage", "pole", "pillar", "partition", "barricade", "scaffold", "scaffolding",
    "cupboard", "freezer", "tape", "pond", "pool", "plank", "mattress", "piano", "printer",
    "copier", "generator", "compressor", "tank", "pit", "crane", "digger", "excavator", "tractor",
    "wagon", "caravan", "tent", "banner", "signpost", "easel", "podium",
    "suitcase", "toolbox", "wheelbarrow", "hay", "bale", "sandbag", "sack", "keg",
    "cask", "spool", "drape", "gurney", "bed", "couch", "armchair", "stool",
    "bookcase", "bookshelf", "locker", "vending-machine", "kiosk", "turnstile",
    "girder", "brick", "gravel", "mud", "ice", "snow", "motorbike",
    "moped", "minibus", "bus", "ambulance", "hoist", "winch", "conveyor", "flowerbed", "shrub",
    "sapling", "stump", "fountain", "sculpture", "monument", "billboard", "barrow",
}  # fmt: skip
"""What obstacles are called anywhere, besides the kinds of the live world."""

_FLEET = "fleet|team|squad|crew|gang|herd|pack|lot|bunch|company|platoon|armada|flock"
ALL_ROBOTS = re.compile(
    r"(?:all|every|each)(?: of)?(?: the| our| my| them| those| these| single| damn| bloody)?"
    r"(?: <count>)? (?:robots?|bots?|units?|machines?|vehicles?|fleet|robos?)"
    r"|all(?: of)?(?: the)? <count>(?: of (?:them|you|em|us))?|(?:the|our|my|you) <count>"
    r"(?: robots| bots| units| machines)?"
    r"|everyone|everybody|everything|every1|all traffic|(?:them|em|you|ya) all|y'all robots"
    rf"|(?:the )?(?:whole|entire) (?:{_FLEET})(?: of (?:them|you|em))?"
    r"|the (?:fleet|robots|bots|team)|all units|all of (?:them|em)|all of you(?: robots| lot)?"
    r"|you robots|(?:the|every) (?:whole )?lot (?:of|o) (?:them|you|em|ya)"
    r"|every(?: single| last)? one of (?:them|you|em|the robots|the bots)(?: robots| bots)?"
    r"|robots 1 (?:to|through|thru|till|until|-) <count>"
)
"""Ways to name every robot; ``<count>`` is how many there are."""

_COMMON = frozenset({
    "a", "an", "and", "at", "be", "by", "can", "do", "does", "did", "done", "for", "from", "go",
    "going", "had", "has", "have", "he", "her", "him", "his", "i", "if", "in", "is", "it",
    "its", "me", "my", "need", "needs", "no", "not", "now", "of", "off", "on", "one", "or",
    "our", "out", "please", "she", "so", "some", "task", "tasks", "that", "the", "their",
    "them", "then", "there", "they", "this", "those", "to", "up", "us", "was", "we", "were",
    "what", "when", "where", "which", "who", "why", "will", "with", "would", "you", "your",
    "high", "low", "normal", "urgent", "first", "last", "next", "new", "job", "point", "room",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Names:
    """The names of the live world, and how they may be told.

    Each mapping leads from a name without case and punctuation to the name itself.
    """

    places: Mapping[str, str]
    robots: Mapping[str, str]
    labels: Mapping[str, str]
    obstacles: Mapping[str, str]
    kinds: Mapping[str, str]
    types: Mapping[str, str]
    everyday: frozenset[str] = frozenset()
    """Words of everyday instructions: a name that is one of them needs a noun in front."""
    known: frozenset[str] = frozenset()
    """Words in which no slip is seen."""
    label: Callable[[Sequence[str], Sequence[str]], float] = lambda before, after: 0.0
    """How likely an everyday word, as ``be``, is a label here: by the words around it."""

    @classmethod
    def of(cls, live: Live, trained: Models) -> Names:
        """The names of the live world."""
        state, mission = live.state, live.scene.mission
        kinds = {one.kind for one in (*state.obstacles.values(), *state.hidden.values())}
        for motion in mission.motions.values():
            kinds |= {*motion.ignores, *motion.cost}
        return cls(
            places=_keyed(mission.places),
            robots=_keyed(state.robots),
            labels=_keyed(state.tasks),
            obstacles=_keyed(state.obstacles),
            kinds={single(kind): kind for kind in sorted(KINDS | kinds, key=lambda k: k in kinds)},
            types=_keyed(mission.task_types),
            everyday=trained.everyday,
            known=trained.known,
            label=trained.label,
        )

    def groups(self) -> tuple[tuple[str, Mapping[str, str]], ...]:
        """What can be named, the most specific first."""
        return (
            ("obstacle", self.obstacles),
            ("robot", self.robots),
            ("place", self.places),
            ("label", self.labels),
        )


def _keyed(names: Iterable[str]) -> dict[str, str]:
    keyed: dict[str, str] = {}
    for name in names:
        keyed.setdefault(key(name), name)
    return keyed


def key(name: str) -> str:
    """A name without case and punctuation: ``Robot 1`` and ``robot-1`` are the same."""
    return "".join(one for one in name.casefold() if one.isalnum())


def single(word: str) -> str:
    """A noun in the singular: ``boxes`` is ``box``."""
    word = word.casefold()
    if word.endswith(("shes", "xes", "ches")):
        return word[:-2]
    return word[:-1] if word.endswith("s") and not word.endswith(("ss", "is")) else word


def plain(text: str) -> list[Token]:
    """Return the words, numbers and marks of a text."""
    return read_numbers(lex(clean(text)))


def tag(text: str, names: Names) -> list[Token]:
    """Return the tokens of an instruction, its entities found."""
    tokens = _named(plain(text), names)
    tokens = mended(tokens, names.known, partial(_known, names))
    tokens = _numbered(_all_robots(tokens, len(names.robots)), names)
    tokens = read_points(read_axes(tokens))
    tokens = _unknown(tokens, names)
    return [_kind_or_type(tokens, n, names) for n in range(len(tokens))]


def _known(names: Names, word: str) -> bool:
    """Whether a word names something as it is, or with a slip."""
    return word in names.types or single(word) in names.kinds or _mended(word, names) is not None


def _named(tokens: Sequence[Token], names: Names) -> list[Token]:
    """Replace names of the live world, up to three tokens long."""
    done: list[Token] = []
    at = 0
    while at < len(tokens):
        for size in (3, 2, 1):
            part = tokens[at : at + size]
            if len(part) == size and (found := _name(part, done, tokens[at + size :], names)):
                done.append(found)
                at += size
                break
        else:
            done.append(tokens[at])
            at += 1
    return done


def _name(
    part: Sequence[Token], before: Sequence[Token], after: Sequence[Token], names: Names
) -> Token | None:
    if any(one.kind in ("mark", "speech") for one in part):
        return None
    if len(part) == 1 and part[0].kind == "number":
        return None
    joined = "".join(_digits(one) for one in part)
    letters = spelled(part)
    last = before[-1].text if before and not before[-1].quoted else ""
    told_so = last in _BEFORE_PLACE | NOUNS["place"] | {"deliver"}
    if letters and (len(letters) > 1 or told_so) and (found := _spelled(part, letters, names)):
        return found
    raw = " ".join(one.raw for one in part)
    wanted = key(joined)
    fits = [(kind, known[wanted]) for kind, known in names.groups() if wanted in known]
    told = [one for one in fits if last in NOUNS[one[0]]]
    if told:
        kind, name = told[0] if last != "delivery" or len(told) == 1 else told[-1]
    elif fits:
        kind, name = fits[0]
    else:
        return None
    single = part[0]
    if len(part) == 1 and not single.quoted and _everyday(single, names):
        shouted = single.raw.isupper() and len(single.raw) > 1
        if kind == "label" and not shouted and not _is_label(before, after, names):
            return None
        if kind == "place" and last not in _BEFORE_PLACE | NOUNS["place"]:
            return None
    if kind == "label" and raw.casefold().replace(" ", "") != name.casefold():
        return None  # a label is said exactly
    quoted = any(one.quoted for one in part)
    return Token(kind, raw.casefold(), name, raw, quoted)


def _spelled(part: Sequence[Token], letters: str, names: Names) -> Token | None:
    """What letters of the radio alphabet name: a place if it is one, a task if there are more."""
    kind, known = ("place", names.places) if len(letters) == 1 else ("label", names.labels)
    raw = " ".join(one.raw for one in part)
    if letters in known:
        return Token(kind, raw.casefold(), known[letters], raw)
    return Token("unknown_label", raw.casefold(), None, raw) if len(letters) > 1 else None


_BEFORE_PLACE = {"to", "at", "from", "in", "the", "into", "for", "near", "->", "=>", "around", "by"}
_VERBS = {"cancel", "prioritize", "raise", "drop", "delete", "lower", "abort", "boost", "expedite"}


def _is_label(before: Sequence[Token], after: Sequence[Token], names: Names) -> bool:
    """Whether an everyday word is the label of a task here."""
    around = [[_shown(one) for one in some] for some in (before[-3:], after[:3])]
    others = any(one.kind == "label" for one in before) or any(
        one.text in names.labels and not _everyday(one, names) for one in after
    )
    return names.label(*around) > (0.9 if others else 0.5)


def _shown(token: Token) -> str:
    return token.text if token.kind in ("word", "mark") else f"<{token.kind}>"


def _everyday(token: Token, names: Names) -> bool:
    return token.text in _COMMON or token.text in names.everyday


def _digits(token: Token) -> str:
    """A whole number as digits, so that ``robot one`` is robot1; a dash that is spoken as none."""
    if token.text in ("dash", "hyphen"):
        return ""
    if token.kind == "number" and token.value is not None and token.value == int(token.value):
        return str(int(token.value))
    return token.text


def _numbered(tokens: Sequence[Token], names: Names) -> list[Token]:
    """Replace ``bot 2``, ``unit two`` or ``r2`` if only one robot has this number."""
    by_number: dict[str, list[str]] = {}
    for robot in names.robots.values():
        if match := re.search(r"(\d+)$", robot):
            by_number.setdefault(match[1], []).append(robot)
    done: list[Token] = []
    for token in tokens:
        last = done[-1] if done else None
        said = [one.text for one in done[-2:]]
        counted = len(said) == 2 and said[0] in NOUNS["robot"] and said[1] in _NUMBER
        if token.kind == "number" and counted:  # "robot number 3"
            last = done[-2]
            del done[-1]
        if token.kind == "number" and last is not None and last.text in NOUNS["robot"]:
            found = by_number.get(_digits(token), [])
            name = found[0] if len(found) == 1 else None
            raw = f"{last.raw} {token.raw}"
            done[-1] = Token("robot" if name else "unknown_robot", raw.casefold(), name, raw)
            continue
        joins = token.kind == "number" and last is not None and last.text in ("and", ",")
        if joins and len(done) > 1 and done[-2].kind in ("robot", "unknown_robot"):
            found = by_number.get(_digits(token), [])
            if len(found) == 1 and "robot" in done[-2].text:
                done.append(Token("robot", f"robot {token.text}", found[0], token.raw))
                continue
        if token.kind == "number" and said[-1:] == ["number"] and said[0] not in _NUMBERED:
            found = by_number.get(_digits(token), [])
            if len(found) == 1:
                raw = f"{done[-1].raw} {token.raw}"
                done[-1] = Token("robot", f"robot {token.text}", found[0], raw)
                continue
        if token.kind == "word" and (match := re.fullmatch(r"(?:r|bot|unit)(\d+)", token.text)):
            found = by_number.get(match[1], [])
            if len(found) == 1:
                token = Token("robot", token.text, found[0], token.raw)
        done.append(token)
    return done


_NUMBER = {"number", "no", "nr", "#", "num"}
_NUMBERED = {"task", "job", "order", "ticket", "room", "phone", "serial", "part", "the", "a"}
"""What a number may be one of, if not of a robot."""


def _all_robots(tokens: Sequence[Token], count: int) -> list[Token]:
    """Replace what names every robot."""
    done = list(tokens)
    at = 0
    while at < len(done):
        for size in (6, 5, 4, 3, 2, 1):
            part = done[at : at + size]
            plain = len(part) == size and all(
                one.kind in ("word", "number") or one.text == "-" for one in part
            )
            digits = [_digits(one) for one in part]
            said = " ".join("<count>" if one == str(count) else one for one in digits)
            part_of = (
                said[:4] == "the " and at > 0 and done[at - 1].text in ("from", "of", "to", "in")
            )
            others = at > 0 and done[at - 1].text in _BEFORE_OTHERS
            others = others or (at + size < len(done) and done[at + size].text == "else")
            if plain and not part_of and not others and ALL_ROBOTS.fullmatch(said):
                raw = " ".join(one.raw for one in part)
                done[at : at + size] = [Token("robot", raw.casefold(), "all", raw)]
                break
        at += 1
    return done


_BEFORE_OTHERS = {"before", "after", "over", "than", "above", "of", "but", "except", "outranks"}

_LABEL = re.compile(r"[a-z]{1,3}\d{0,3}|[a-z]+[-_]?\d{1,4}")
_LETTER = re.compile(r"[a-z]\d{0,2}|[a-z]{1,2}\d{1,2}")


def _unknown(tokens: Sequence[Token], names: Names) -> list[Token]:
    """Mark what is told like a name but names nothing, and mend slips in long names."""
    done: list[Token] = []
    for n, token in enumerate(tokens):
        last = done[-1] if done else None
        done.append(_told(token, last, tokens[n + 1 :], names))
    return done


def _told(token: Token, last: Token | None, after: Sequence[Token], names: Names) -> Token:
    if token.kind == "number" and last is not None and last.text in ("task", "label"):
        next_ = after[0] if after else None
        if next_ is None or next_.kind != "number":
            label = names.labels.get(_digits(token))
            return Token("label" if label else "unknown_label", token.text, label, token.raw)
    if token.kind != "word":
        return token
    word = token.text
    ends = not after or after[0].kind == "mark" or after[0].text in ("and", "as", "with", "to")
    if last is not None and last.text in NOUNS["place"] and token.raw in ("A", "I") and ends:
        return Token("unknown_place", word, None, token.raw)
    if _everyday(token, names) and not token.quoted:
        return token
    before = last.text if last is not None and last.kind == "word" and not last.quoted else ""
    if token.quoted:
        kind = next((one for one in ("label", "place", "robot") if before in NOUNS[one]), "label")
        return Token(f"unknown_{kind}", word, None, token.raw, True)
    if match := _mended(word, names):
        return Token(match[0], word, match[1], token.raw)
    if before in NOUNS["place"] - {"delivery"} and _LETTER.fullmatch(word) and word not in "xy":
        return Token("unknown_place", word, None, token.raw)
    if re.fullmatch(r"(?:robot|bot|unit|agv|amr)[-_]?\w*\d+", word):
        return Token("unknown_robot", word, None, token.raw)
    if re.fullmatch(r"(?:obstacle|\w{3,})[-_]\d+", word) and single(word[:-2]) in names.kinds:
        return Token("unknown_obstacle", word, None, token.raw)
    if before in (NOUNS["label"] | _VERBS) - {"delivery"} and _LABEL.fullmatch(word):
        return Token("unknown_label", word, None, token.raw)
    return token


def _mended(word: str, names: Names) -> tuple[str, str] | None:
    """The only place or robot that a slip in a word of four letters or more can mean."""
    if len(word) < 4:
        return None
    found = []
    for kind, known in (("place", names.places), ("robot", names.robots)):
        found += [(kind, name) for near, name in known.items() if slip(key(word), near)]
    return found[0] if len(found) == 1 else None


@lru_cache(maxsize=4096)
def slip(word: str, known: str) -> bool:
    """Whether a word is a known one with one letter wrong, missing, added or two swapped.

    Digits must be the same, and short words have no slips.

    Examples
    --------
    >>> slip("urgnet", "urgent"), slip("robot2", "robot1"), slip("kitchn", "kitchen")
    (True, False, True)
    """
    if len(known) < 4 or abs(len(word) - len(known)) > 1 or word == known:
        return False
    if re.sub(r"\D", "", word) != re.sub(r"\D", "", known):
        return False
    steps = [one for one in SequenceMatcher(None, word, known).get_opcodes() if one[0] != "equal"]
    if len(steps) == 1:
        _, a, b, c, d = steps[0]
        return max(b - a, d - c) == 1 or word[a:b] == known[c:d][::-1]
    return len(steps) == 2 and len(word) == len(known) and sorted(word) == sorted(known)


def _kind_or_type(tokens: Sequence[Token], at: int, names: Names) -> Token:
    token = tokens[at]
    if token.kind != "word" and token.kind != "unknown_label":
        return token
    next_ = tokens[at + 1].text if at + 1 < len(tokens) else ""
    before = tokens[at - 1].text if at else ""
    word = token.text
    if word in names.types:
        around = {next_, before, *(one.text for one in tokens[at - 3 : at])}
        if word in ("high", "low", "normal") and (around & {"priority", "urgency", "back"}):
            return token
        return Token("type", word, names.types[word], token.raw)
    if token.kind == "word" and not token.quoted:
        if single(word) in names.kinds and before not in ("by", "truck"):
            return Token("kind", word, names.kinds[single(word)], token.raw)
        if len(word) >= 5 and word not in names.known:
            near = [name for one, name in names.types.items() if slip(word, one)]
            if len(near) == 1:
                return Token("type", word, near[0], token.raw)
    return token
