"""What people say besides an instruction and what changes nothing: greetings, reasons, thanks."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from oath.instruct.offline import clear, gates
from oath.instruct.offline.new_task import said_priority
from oath.instruct.offline.tokens import Token

_WHY = re.compile(
    r"(?:just )?(?:because(?: of)?|cos|coz|cuz|bc|so that|so (?:we|i|they|the \w+|people|he"
    r"|she|nobody|"
    r"everyone|everybody|visitors|staff) (?:can|could|do|does|get|gets|will|have|has|may)\b"
    r"|in order"
    r" (?:to|that)|due to|owing to|on account of|thanks to|given(?: that)?|seeing (?:that|as|how)"
    r"|being that|as a result of|(?:since|as|for) (?:the|there|we|i|it|he|she|they|you|our|my"
    r"|his|her|their|its|a|an|that|these|those"
    r"|this|somebody|someone|people|nobody|no one|everybody|everyone|another|one of)\b"
    r"(?! (?:one|last|first|same|next|above|result|robot|start|beginning|rest)\b)"
    r"|since (?:this morning|yesterday|last night|noon|today|dawn|lunch(?:time)?|breakfast))"
)
"""Begins a reason or a purpose."""

_SO_FAR = re.compile(
    r"\b(ever )?since (early |late )?(this morning|yesterday|last night|noon|dawn|today|breakfast"
    r"|lunch|lunchtime|midnight)\b"
)
"""Tells that what began then is still so."""

_BEARS = re.compile(
    r"\b(first|last|before|after|later|sooner|earlier|next|urgen\w*|priorit\w*|wait\w*"
    r"|rush\w*|hurry"
    r"|instead|rather|unless|except|only|until|till|but|else|not that|no longer|otherwise|although"
    r"|though|however|without|jk|kidding|joking|joke|test|testing|tests|exercise|simulat\w*|example"
    r"|fake|fiction\w*|imaginary|hypothe\w*|theor\w*|pretend\w*|quot\w*|maybe|drill|story|dream\w*"
    r"|wrong|false|untrue|lie|lied|lies|nicht|kein\w*|pas|jamais|nunca|non|nein|nope|no|not"
    r"|never|nor"
    r"|former\w*|previous\w*|yesterday|tomorrow|tonight|soon|then|if|when|whenever|once|while"
    r"|as soon"
    r"|history|old|past|today|monday|tuesday|wednesday|thursday|friday|saturday|sunday"
    r"|special|normal"
    r"|also|too|and|or|it|that|this|them|him|her|both|same|again|undo|add|do|did|done|does|go|goes"
    r"|mission|game|movie|book|says?|said|film|question|wonder\w*|rumou?r\w*)\b"
)
"""Words with which a piece may bear on an instruction."""

_COURTESY = re.compile(
    r"(?:\W|you know|you see|bless (?:you|your \w+)|thank you(?: (?:so|very) much| kindly)?"
    r"|(?:many |much )?"
    r"(?:thanks|thx|ta|tack|cheers|merci|danke|gracias)(?: (?:a lot|a million|a bunch|so much"
    r"|in advance|mate"
    r"|love|pal|guys|all))?|much obliged|much appreciated|appreciate it"
    r"|please(?: and thank you)?|pretty "
    r"please|if you (?:please|will|would|can|could|do not mind|would not mind|like)|if i may"
    r"|sorry(?: about"
    r" (?:that|this|it))?(?: to (?:bother|trouble|bug|disturb) you)?|(?:my )?apolog\w+"
    r"|excuse me|pardon me"
    r"|over(?: and out)?|roger|copy(?: that)?|ten four|10-4|best(?: (?:regards|wishes))?"
    r"|(?:kind|warm)?"
    r" ?regards|greetings|yours(?: (?:truly|sincerely))?|sincerely|good (?:morning|day"
    r"|evening|afternoon"
    r"|lord|grief|gracious|heavens|people|buddy|man|lad|sir)|morning(?: all| team| everyone)?"
    r"|evening(?: all"
    r")?|afternoon(?: all)?|hello(?: there| again| all| team| everyone)?|hi(?:ya)?(?: there"
    r"| all| team"
    r"| guys| folks)?|hey(?: there| all| team| guys| folks| you)?|yo|oi|hoy|ahoy|howdy"
    r"|aye(?: aye)?|alright|"
    r"(?:all )?right(?: then)?(?: lads| guys| folks| team| everyone| people)?"
    r"|ok(?:ay)?(?: then)?(?: team| guys"
    r"| folks| people| everyone| all)?|well(?: now| then)?|now(?: then)?|so|oh(?: dear| no"
    r"| my| boy)?|ah|uh|um"
    r"|er|erm|hmm|like|look|listen(?: up)?|attention|(?:heads up)|fyi|btw|by the way"
    r"|for your information"
    r"|just so you know|for the record|to be honest|honestly|frankly|basically|literally"
    r"|anyway|anyhow"
    r"|as you (?:know|can see)|as i said|mind you|i say|i tell you|i swear|trust me"
    r"|believe me|guess what"
    r"|(?:my |our )?(?:dear|good|old|sweet)?(?: old)? ?(?:mate|buddy|pal|friends?|love"
    r"|darling|dear|honey"
    r"|sweetie|sir|madam|maam|ma'am|boss|chief|guys|folks|lads?|gents|gentlemen|ladies|team"
    r"|everyone"
    r"|everybody|people|dude|bro|bruh|fam|man|mates|colleagues?|comrades?|captain|control"
    r"|dispatch|base"
    r"|central|operator|computer|system|assistant|fleet|yall|y'all|crew|gang|hun|duck|pet|sunshine)"
    r"|would you|will you|could you|can you|okay|ok|yeah|yes|yep|yup|sure|lol|haha|omg|ugh"
    r"|phew|wow|damn"
    r"|dammit|blimey|crikey|gosh|jeez|bother|drat|heavens|mercy|my goodness|goodness(?: me)?|hooray"
    r"|great|good|fine|nice|lovely|perfect|brilliant|good (?:news|job|work)(?: everyone| all"
    r"| team)?"
    r"|bad news(?: everyone| all| team)?|great news|breaking news|news flash|no worries)+"
)
"""A piece that is no more than manners."""

_ENDS = {",", ".", "!", ";", ":"}
_LONGEST = 12
"""Words of a piece that is left out."""


def without_asides(tokens: Sequence[Token], words: frozenset[str]) -> tuple[Token, ...]:
    """Leave out reasons, manners, and pieces that name nothing and bear on nothing.

    `words` are those of everyday instructions. A piece is kept if a gate may have to see it, or if
    it may say by itself what is to be done.
    """
    if found := _SO_FAR.search(gates.as_line(tokens)):
        at = found.string[: found.start()].count(" ")
        tokens = [*tokens[:at], *tokens[at + found[0].count(" ") + 1 :]]
    kept: list[Token] = []
    for piece in _pieces(tokens):
        body, why = _without_reason(piece, words)
        if why and not _is_bare(body):
            kept += body
        elif _is_manners(piece) or (
            _is_bare(piece) and (_is_strange(piece, words) or (kept and _is_reason(piece)))
        ):
            continue
        else:
            kept += body
    return tuple(kept)


def _pieces(tokens: Sequence[Token]) -> Iterator[list[Token]]:
    piece: list[Token] = []
    for token in tokens:
        piece.append(token)
        if token.kind == "mark" and token.text in _ENDS:
            yield piece
            piece = []
    if piece:
        yield piece


def _is_bare(tokens: Sequence[Token]) -> bool:
    """Whether nothing is named."""
    return all(one.kind in ("word", "mark") and not one.quoted for one in tokens)


def _is_manners(piece: Sequence[Token]) -> bool:
    line = " ".join(one.text for one in piece)
    return bool(_COURTESY.fullmatch(line))


def _is_strange(piece: Sequence[Token], words: frozenset[str]) -> bool:
    """Whether most words of a short piece are unheard of, and none bears on an instruction."""
    named = [one for one in piece if one.kind == "word"]
    strange = [one for one in named if one.text not in words]
    if not 0 < len(named) <= 5 or 2 * len(strange) < len(named):
        return False
    return _is_idle(gates.as_line(piece))


_DECLARES = re.compile(
    r"^\W*(there|he|she|they|we|i|it|the \w+|my \w+|our \w+|his \w+|her \w+|a \w+|an \w+"
    r"|somebody|someone|people"
    r"|everybody|everyone|visitors|customers|guests|workers|children|kids)( \w+){0,2} (is|are"
    r"|am|has|have|need|needs|want"
    r"|wants|leave|leaves|wait|waits|come|comes|came|got|gets|go|goes|can|do|does|came|went"
    r"|left|took|ordered|called|asked"
    r"|arrived|finished|starts?|closes?|opens?|likes?|hates?|sits?|stands?|looks?|hit|must"
    r"|see|saw|know|hear|found)\b"
)
_UNSURE = re.compile(
    r"\b(not|never|no|none|was|were|had|will|would|shall|yesterday|tomorrow|tonight|o'clock"
    r"|pm|am not|says?|said|think"
    r"|believe|guess|maybe|probably|perhaps|might|again|too|also|undo|cancel\w*|monday"
    r"|tuesday|wednesday|thursday"
    r"|friday|saturday|sunday|week|month|year|hours?|minutes?|then|when|while|or|and|joke"
    r"|about it|fine|okay|wrong"
    r"|back|over|gone|removed|cleared|fixed|planned|going to (be|build|put|have)|supposed|low"
    r"|normal|special|old)\b"
)


def _is_reason(piece: Sequence[Token]) -> bool:
    """Whether a piece only says how things are, and nothing that bears on what is to be done."""
    line = gates.as_line(piece)
    if not _DECLARES.search(line) or said_priority(line):
        return False
    return not (_WEIGHS.search(line) or _UNSURE.search(line))


def _is_idle(line: str) -> bool:
    """Whether words say neither what to do nor anything that a gate holds back."""
    if _BEARS.search(line) or said_priority(line) or clear.is_evidence(line):
        return False
    return gates.not_meant(line, "add_task") is None and gates.doubtful(line, "add_task") is None


def _without_reason(
    piece: Sequence[Token], words: frozenset[str]
) -> tuple[list[Token], list[Token]]:
    """A piece without its reason, and the reason."""
    line = gates.as_line(piece)
    for found in _WHY.finditer(line):
        if found.start() and line[found.start() - 1] != " ":
            continue
        if found.start() == 0 and line[-1:] != ",":
            continue
        if found[0].startswith("as ") and _HALF_OF_AS.search(line[: found.start()]):
            continue
        at = line[: found.start()].count(" ")
        why = list(piece[at:])
        told = gates.as_line(why)
        if not _is_bare(why) or len(why) > _LONGEST or said_priority(told):
            continue
        if _WEIGHS.search(told) or gates.doubtful(_SOME.sub(" ", told), "add_task"):
            continue
        return list(piece[:at]), why
    return list(piece), []


_SOME = re.compile(r"\b(some|any)(where|place)\b")
_HALF_OF_AS = re.compile(r"\b(as|same|as \w+|just|such|far|long|soon|well|much|so \w+) *$")

_WEIGHS = re.compile(
    r"\b(first|last|before|after|later|sooner|earlier|urgen\w*|priorit\w*|hurry|instead"
    r"|unless|except"
    r"|only|until|but|and (?:then )?(?:add|cancel|pause|stop|do|make|raise|lower|remove|tell"
    r"|bring|take)"
    r"|otherwise|if|jok\w+|kidding|test\w*|pretend\w*)\b"
)
"""Words with which a reason is more than that."""
