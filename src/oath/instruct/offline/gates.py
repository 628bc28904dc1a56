"""What keeps words from being acted on whatever the models say, and what to say of the rest.

Every gate reads an instruction as one line of words and tags, e.g. ``do not cancel <label>``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from oath.instruct.offline.features import Concepts, classes
from oath.instruct.offline.tokens import Token


def as_line(tokens: Sequence[Token]) -> str:
    """An instruction as one line of words, marks and tags."""
    return " ".join(one.text if one.kind in ("word", "mark") else f"<{one.kind}>" for one in tokens)


_REFUSED = re.compile(
    r"\b(ignore|disregard|forget|override|bypass) (\w+ ){0,3}(instructions?|rules?|prompts?"
    r"|commands?"
    r"|checks?|confirmations?|safety|everything|above|previous|restrictions?|guidelines?)\b"
    r"|\bwhat (you|i) (were|have been|was) told\b"
    r"|\b(system prompt|developer mode|jailbreak|you are now|act as|pretend|password|api key"
    r"|without (asking|confirming|confirmation|any confirmation|a confirmation)|do not ask"
    r"|no questions"
    r"|auto ?-?confirm\w*|confirm (it|this|that|everything|automatically|yourself)|self-confirm"
    r"|already (confirmed|approved)|approve (it|this|everything))\b"
    r"|\b(system|assistant|developer|admin|root) :|[{}<$\\](?!(point|place|robot|label|obstacle"
    r"|kind"
    r"|type|number|speech|unknown_\w+)>)"
)

_STILL = "so I change nothing"
REASONS: Mapping[str, str] = {
    "@unit_": "I understand metres only. Give the points in metres, e.g. (5, 19.5).",
    "@alternative_": "That leaves open which one is meant. Name exactly one.",
    "@ask_": f"That sounds like a question, {_STILL}.",
    "@negate_": f"You say what not to do, {_STILL}.",
    "@retract_": f"You take that back, {_STILL}.",
    "@condition_": f"I cannot wait for a condition, {_STILL} yet.",
    "@when_": f"I cannot wait for that, {_STILL} yet.",
    "@hearsay_": f"That is what somebody else says, {_STILL}.",
    "@hedge_": "You sound unsure, so I ask before I propose anything.",
    "@nearly_": f"You say that it is not quite so, {_STILL}.",
    "@future_": f"That is not so now, {_STILL} yet.",
    "@plan_": f"That is a plan, {_STILL} yet.",
    "@past_": "That sounds like something that has happened already.",
    "@duration_": "I cannot keep to times.",
    "@habit_": f"That is how it often is, {_STILL}.",
    "@except_": "I cannot keep to exceptions.",
    "@compare_": "I cannot order two tasks against each other; I can make a task high, normal or "
    "low priority, e.g. 'make bb high'.",
    "@degree_": "I know low, normal and high priority, and nothing by degrees.",
    "@general_": "One at a time, please, and by name.",
    "@pointing_": "Which one? Say its name.",
    "@vague_": "Where exactly? Give points in metres, e.g. (5, 19.5).",
    "@relative_": "Where exactly? Give points in metres, e.g. (5, 19.5).",
    "@worse_": "Is it out of service? Say 'robot1 has failed' if it is.",
    "@recovered_": f"That sounds as if all were well, {_STILL}.",
    "@joke_": f"You do not say it in earnest, {_STILL}.",
    "@irony_": f"You do not say it in earnest, {_STILL}.",
    "@example_": f"That is an example, {_STILL}.",
    "@quote_": f"That is quoted, {_STILL}.",
    "@wish_": f"That is a wish, {_STILL}.",
    "@opinion_": f"That is what you think of it, {_STILL}.",
}
"""What is said of an instruction that is not clear, by a class of words in it, in this order."""

IN_ANSWERS = ("@unit_", "@alternative_", "@condition_", "@hearsay_", "@hedge_")
"""Classes of words that keep also a mere answer from being taken."""


def reason(
    tokens: Sequence[Token], concepts: Concepts, among: Sequence[str] = tuple(REASONS)
) -> str | None:
    """Why an instruction is not clear, as far as its words tell; None if they do not."""
    found = classes(tokens, concepts)
    return next((REASONS[one] for one in among if one in found), None)


_VERB = (
    r"(?:add|create|register|insert|enter|make|set|mark|put|raise|lower|increase|decrease|change"
    r"|cancel|delete|remove|drop|abort|scrap|clear|erase|pause|stop|halt|hold|freeze|resume|restart"
    r"|continue|release|undo|revert|touch|take|bring|deliver|prioriti[sz]e|move|start|let|draw|log"
    r"|schedule|block|close|report|do|give|update|need|want|go|send|fetch|pick|collect|include|file"
    r"|skip|kill|bump|boost|expedite|finish|handle|place|book|open|call|declare|treat|consider|plan"
    r"|unpause|reopen|count|write|reset|switch|push|queue|note|act|carry|tell|have|get|keep)"
)

_OR = re.compile(
    r"(<\w+>) (,|\?)? ?or (the |to |at |in |from |rather |point |room |station |task "
    r"|maybe )*(<\w+>)"
    r"|\b(either|any of|one of (?:them|these|those)|whichever|some other|somewhere|someplace"
    r"|(?<!going )(?<!go )anywhere)\b"
)

_OR_DO = re.compile(rf"\b{_VERB}( it| <\w+>)? or( to| else)? {_VERB}\b")

_UNITS = re.compile(
    r"(<number>|<point>|\d) ?(feet|foot|ft|inch|inches|yards?|yd|cm|mm|km|kilometers?"
    r"|kilometres?|miles?"
    r"|centimeters?|centimetres?|millimeters?|millimetres?|pixels?|cells?|steps?|degrees?|px|tiles?"
    r"|blocks|paces|grid)\b|\bin (feet|foot|ft|inches|yards|cm|mm|km|centimeters|millimeters|miles|"
    r"pixels|cells)\b|\b(latitude|longitude|gps)\b"
)


def forbids(line: str, intent: str) -> bool:
    """Whether words are never acted on: they leave open which, or are in other units."""
    return intent != "query_status" and any(one.search(line) for one in (_OR, _OR_DO, _UNITS))


_REST_WAITS = re.compile(
    r"((and|but|while|,|;|\.) )*(everything|all|anything|every\w+|the|all the|the other|our)"
    r"( (else|others?|rest|tasks?|jobs?|orders?))* (can|may|must|has to|have to|should|will|could)"
    r" (wait|come (later|after\w*|second)|be done (later|after\w*)|follow|be left)( till later)?"
    r"|^\W*drop (everything|<robot>)( else)? (and|,|;|for)( (do|handle|take|get|deal with))?"
)


def without_rest(tokens: Sequence[Token]) -> tuple[Token, ...]:
    """Read ``everything else can wait`` as that what is named comes first."""
    line = as_line(tokens)
    found = _REST_WAITS.search(line)
    if found is None or "<label>" not in line.replace(found[0], " "):
        return tuple(tokens)
    begin = line[: found.start()].count(" ")
    end = begin + found[0].count(" ") + 1
    first = [Token("word", one, None, one) for one in ("do", "first")]
    if begin == 0:
        return (first[0], *tokens[end:], first[1])
    return (*tokens[:begin], first[1], *tokens[end:])


def refused(line: str) -> str | None:
    """Why an instruction is not read at all: it talks to the machine, not of the mission."""
    if _REFUSED.search(line):
        return (
            "I take instructions about the mission only, and every change is confirmed by a "
            "person. Say in plain words what is to change, e.g. 'cancel task bb'."
        )
    if "<speech>" in line:
        return (
            "I do not act on what stands in quotes. Say it in your own words; a name in quotes "
            'must be one word, e.g. task "bb".'
        )
    return None


_VAGUE = re.compile(
    r"(?:near|nearby|around|about|roughly|approximately|approx|circa|ca|close to|close by|closer to"
    r"|next to|beside|besides|behind|opposite|outside|past|beyond|towards|vicinity of|somewhere|by"
    r"|between|toward|alongside|adjacent to|far from|in front of|side of|north of|south of|east of"
    r"|west of|left of|right of|surroundings? of|neighbou?rhood of|proximity of|almost|nearly|under"
    r"|above|below|inside|more or less|corner of|end of|entrance of|exit of|door of|middle of"
    r"|edge of"
    r"|entrance to|door to|area around|away from)"
    r"(?: (?:to|of|the|a|an|at|from|in|room|point|station|place|coordinates?|location|position"
    r"|area|and"
    r"|corner|entrance|door|,|\(|\[))*$"
)
_VAGUE_AFTER = re.compile(
    r"^(?:or so|ish|approximately|roughly|more or less|give or take|area|region|or)\b"
)


def is_vague(tokens: Sequence[Token], at: int) -> bool:
    """Whether the place or point at an index is only the surroundings of what is meant."""
    before = as_line(tokens[max(at - 8, 0) : at])
    if sum(one.kind == "point" for one in tokens) > 2:  # corners
        before = re.sub(r"\b(inside|within|between|around)( of| the)?( \w+)?\W*$", "", before)
    before = re.sub(r"[\[(, ]+$", "", before)
    if tokens[at].kind == "point":
        before = re.sub(r"\bbetween( the)?( points?| coordinates?)?$", "", before.strip())
        before = re.sub(
            r"\b(\w+ed by|(go|get|gets|getting|pass|passes|come|comes|squeeze) past( from)?"
            r"|past from)$",
            "",
            before.strip(),
        )
        before = re.sub(r"\b(side|corner|end|entrance|middle|edge|door)s? at$", "", before)
    return bool(
        _VAGUE.search(before.strip()) or _VAGUE_AFTER.search(as_line(tokens[at + 1 : at + 5]))
    )
