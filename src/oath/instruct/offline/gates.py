"""What keeps words from being acted on: they ask, deny, doubt, report, or say more than is known.

Every gate reads an instruction as one line of words and tags, e.g. ``do not cancel <label>``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

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

_VERB = (
    r"(?:add|create|register|insert|enter|make|set|mark|put|raise|lower|increase|decrease|change"
    r"|cancel|delete|remove|drop|abort|scrap|clear|erase|pause|stop|halt|hold|freeze|resume|restart"
    r"|continue|release|undo|revert|touch|take|bring|deliver|prioriti[sz]e|move|start|let|draw|log"
    r"|schedule|block|close|report|do|give|update|need|want|go|send|fetch|pick|collect|include|file"
    r"|skip|kill|bump|boost|expedite|finish|handle|place|book|open|call|declare|treat|consider|plan"
    r"|unpause|reopen|count|write|reset|switch|push|queue|note|act|carry|tell|have|get|keep)"
)

_NOT = re.compile(
    rf"\b(do|please|never|should|must|would|need|to|can|could|may|shall"
    rf"|will) not (?:\w+ ){{0,2}}{_VERB}\b"
    rf"|\b(never|not|rather not|refrain from|avoid|instead of|without"
    rf"|stop) (?:to )?{_VERB}(?:ing|ting"
    rf"|ping|ning)?\b|\bno (?:need|reason|point|use|way)\b|\bby no means\b"
    rf"|\bunder no circumstances\b"
    r"|\b(adding|creating|cancelling|pausing|stopping|removing|resuming|raising) \w+ is (not"
    r"|wrong)\b"
    r"|\bdid not\b|\b(has|have|had) not\b|\bneither\b|\b(is|are|am) not (going|planning|asking"
    r"|saying)\b"
    r"|\bnot (a|an|the|<\w+>|yet|now|today)\b|\bno (new|more)? ?(task|job|order)s?\b|\bnever\b"
)
_NOT_AFTER_ALL = re.compile(
    r"\b(do not|never) (mind|forget|hesitate|delay|wait|postpone|put off|be late|miss|lose time"
    r"|leave)\b"
    r"|\b(do|does|did|can|could|may|must|should|will|would|shall) (not|no longer) (\w+ )?(pass"
    r"|drive|"
    r"go|enter|get|move|work|respond|answer|react|start|cross|run|reach|use|wait|be|seem|look|need|"
    r"want(?! to)|exist|block|fit|traverse|turn|reply|function|operate|stand|matter|communicate"
    r"|continue|"
    r"boot|have|count|rely|think(?! we| i)|rush|hurry|take|let|care|travel|navigate|proceed|know)\b"
    r"|\bno need (for|to (hurry|rush|wait|do|deliver|fetch|handle|pick|bother|hold|keep)\b)"
    r"|\bno (longer|more|rush|hurry|urgency)\b|\bnot (any|so|that|very|too|really"
    r"|urgent|important|needed|in a hurry|as)\b|\bneed not\b|\bnot a priority\b|\bnot (\w+ing)\b"
    r"|\b(is|are) not (?!going|planning|asking|saying)"
)

_ASKS = re.compile(
    r"^(?:\W*(?:and|but|so|hey|hi|hello|ok|okay|well|um|sorry|please|now) )*"
    r"(?:(?:(?:is|are)(?! (?:possible to|new|now|one|some|also|more|another|big|urgent)\b(?!.*\?))"
    r"|was|were|does|did|has|had|why|who|whose|what|where|am)\b"
    r"|how (?!about)|which (?!is\b)"
    r"|when (?:is|are|was|will|do|does|did|can|should)\b"
    r"|(?:do|have|should|shall|must|may|might) (?:you|we|i|they|it|he|she|the|a|any|robots|there"
    r"|somebody|someone|anyone|this|that)\b"
    r"(?! (?:ask|request|trouble|bother|beg) you to\b)"
    r"|(?:should|shall|must|may|might)(?: the)? <\w+>)"
    r"|^(?:can|could|would|will|might|may) <robot>(?!.*\bplease\b)(?! (?:stop|wait|hold|pause"
    r"|continue|go|resume|proceed|stand|stay|halt|move|carry|drive|start|freeze|be|take|bring"
    r"|deliver|fetch|collect|pick|get|transport)\b)"
)
_ASKS_FOR = re.compile(
    r"^(can|could|would|will) |\bi (want|need|would (like|love|need))\b|\bask you to\b|\b(can"
    r"|could|would|will|may|might) (you|we|i|somebody|someone"
    r"|<robot>|u|one|anybody|anyone)\b"
    r"|\b(would|do) you mind\b|\bwhy (not|do not we|do not you)\b|\bhow about\b|\bmind (\w+ing)\b"
    r"|\bpossible to\b|\blet us\b|\bshall we\b|\bplease\b"
)
_ASKS_ABOUT = re.compile(
    r"\b(wonder|wondering|know|tell (me|us)|ask(ing)?|check|find out|see|sure|curious"
    r"|doubt) (if|whether"
    r"|why|when|who|what|how|where)\b|\bwhat if\b|\bright \?$|\b(is|are|was) (it|there"
    r"|that) not \?$"
    r"|\b(not|correct|yes|no) \?$"
)

_IF = re.compile(
    r"\b(if|unless|until(?! <point>| \(| further| later| the (?:very )?end| last| every| all)"
    r"|till(?! <point>| further| later| the (?:very )?end| last| every| all)|(?<!at )once|whenever"
    r"|in case|in the event|provided|assuming|assume|suppose|supposing"
    r"|imagine|as long as|except|depending|otherwise|in order of|pending)\b"
    r"|\b(when|after|while|as soon as|before)(?= (the |a |my |our )?(<\w+>|(?:i|you|we|it|he|she"
    r"|they|(?!\w+thing|bring)\w+ing"
    r"|someone|people|lunch|dinner|breakfast|sunset|shift|\w+ (is|are|has|have|arrives?|comes?"
    r"|goes|leaves?"
    r"|returns?|starts?|ends?|opens?|closes?))\b))"
)
_IF_POLITE = re.compile(
    r"\b(if|when|whenever|once|as soon as|as long as) (you|it is|it's|that is|at all|there is)?"
    r" ?(can|could|would|may|like|please|want|wish|get|have|are|possible|convenient|time|ready"
    r"|free|do"
    r" not mind|need be|a (chance|moment|minute|second))\b"
    r"|\bif (it|that|this) (is|would be|be) (ok|okay|all right|alright|fine|possible|convenient"
    r"|no (trouble|bother|problem)|not too (much|late)[a-z ]*|good|acceptable|allowed)\b"
    r"|\bif (it|that|this) (is|would)( be)? not (too|asking|a|an|any) (\w+ ){0,3}(much"
    r"|trouble|bother"
    r"|hassle|problem|many|far|late|imposition|inconvenien\w*|burden)( to ask| of (you"
    r"|a bother)| trouble)?\b"
    r"|\bif (it|that) (pleases|suits|does not bother|is all the same to)( you)?\b"
    r"|\bif (i|we) (might|could|can|dare|must)( (be so bold|ask|trouble you|bother you))?\b"
    r"|\bif (any|some)(one|body) (is|could|can|has|wants|happens|fancies|would|passes)\b"
    r"|\bif you (two|lot|guys|all|folks)? ?(have|find|get|got|would be so|could be so)\b"
    r"|\bif (i may|you please|you would|you will|you do not mind|that suits you)\b"
    r"|\b(appreciate|grateful|great|nice|good|glad|happy|lovely|helpful|thankful|wonderful|better"
    r"|obliged|kind|best)( it)? if\b"
    r"|\b(when|while|as) (i|we) (was|were) \w+ing\b"
    r"|\b(in case you (missed|have not)|as soon as possible|when (you )?(have|get|find) (a|the"
    r"|some)"
    r" (chance|time|moment|minute))\b|\b(when|while) (everything|all) (else|others) (is"
    r"|are)( all)? done\b"
    r"|\bafter (all|every|the) (\w+ )?(others?|tasks?|else|rest)\b"
)

_TOLD = re.compile(
    r"\b(said|told|(?:i|we) (?:have |just )?read(?: that)?|claims?|claimed|mentioned|heard"
    r"|according to|allegedly|rumou?rs?|thinks|believes"
    r"|supposedly|wrote|states|announced"
    r"|(?<!boss )(?<!director )(?<!manager )(?<!client )(?<!customer )(?<!chef )(?<!doctor"
    r" )insists?|suspects?|quote|hearsay|reckons|texted|emailed"
    r"|reportedly|wants (me|us|you)|asked (me|us|you|to|if|whether))\b"
    r"|\b(?!it\b)\w+ says\b|\b(\w+) (?<!\bbe )(?<!\bto )(reports|reported) (that|there|a|an"
    r"|seeing)\b"
)
_TOLD_BY_ME = re.compile(r"\b(as )?i (said|told you|mentioned|already said)\b")

_PAST = re.compile(
    r"\b((?<!from )yesterday|last (week|night|month|time|year|spring|summer|autumn|fall|winter"
    r"|shift|"
    r"season|quarter|monday|tuesday|wednesday|thursday|friday|saturday|sunday)|ago"
    r"|earlier today|(?<!from )this morning"
    r"|previously|used to|(?:we|i|they) had|had been|formerly|back then|the other day|once upon"
    r"|on monday|(in|during|on) (the|our|my) (previous|former|earlier|old|past|last) \w+"
    r"|in the past)\b"
    r"|(?<!\w)(i|we|he|she|they|you|someone|somebody|tom|<robot>|shift|operator|colleague) (have "
    r"|has |had |"
    r"just |already |also )*(added|created|registered|cancelled|deleted|paused|stopped|resumed"
    r"|raised"
    r"|lowered|changed|released|prioritized|restarted|undid|undone|entered|logged|inserted|reverted"
    r"|halted|aborted|scheduled|bumped|delivered|finished|completed)\b"
    r"|(?<!\w)(task|job|order|<label>|priority|<robot>) (was|were|has been|had been|got"
    r"|have been) (\w+ )?"
    r"(added|created|registered|cancelled|deleted|paused|stopped|resumed|raised|lowered|changed"
    r"|done"
    r"|released|prioritized|delivered|finished|completed|restarted|entered|bumped)\b"
    r"|\bthere (was|were|had been)\b"
)
_STILL_PAST = re.compile(
    r"\b(cancelled|withdrawn) by the \w+\b|\bchanged my mind\b|\bby (mistake|accident|error)\b"
    r"|\bno longer\b|\bso (please )?\w+"
)

_DOUBTS = re.compile(
    r"\b(maybe|perhaps|probably|possibly|presumably|apparently|seemingly|potentially|might"
    r"|could be|"
    r"may (?:be|have)|may not|may need|not (?:sure|certain)|unsure|i (?:think|guess|believe"
    r"|suppose|"
    r"assume|suspect|feel|reckon|imagine|fear)|seems?|seemed|appears to|looks (?:like|as)"
    r"|sounds like"
    r"|not know|kind of|sort of|or something|or whatever|somehow|somewhat|doubt|likely|unclear"
    r"|or so"
    r"|if i (?:am|remember)|we (?:should|could|may|might) (?:probably|maybe|perhaps|consider)"
    r"|not think"
    r"|considering|thinking (?:about|of)|wonder|guess|supposed to|there should be|some kind"
    r"|hopefully)\b"
)

_OR = re.compile(
    r"(<\w+>) (,|\?)? ?or (the |to |at |in |from |rather |point |room |station |task "
    r"|maybe )*(<\w+>)"
    r"|\b(either|any of|one of (?:them|these|those)|whichever|some other|somewhere|someplace"
    r"|(?<!going )(?<!go )anywhere)\b"
)

_OR_DO = re.compile(rf"\b{_VERB}( it| <\w+>)? or( to| else)? {_VERB}\b")

_COMPARES = re.compile(
    r"<label> (\w+ ){0,4}(before|after|than|over|ahead of|instead of|rather than|as|like"
    r"|but not|behind"
    r"|prior to|until) (task |job |the |both )*<label>|\b(before|after|than|over|ahead of"
    r"|instead of|"
    r"rather than|swap|exchange|behind|between|same) (\w+ ){0,4}<label>"
    r"|\b(nearest|closest|farthest|furthest|biggest|smallest|longest|shortest|oldest|newest|same)\b"
)

_LIMITS = re.compile(
    r"\b(tomorrow|tonight|o'clock|noon|midnight|pm|am (?!i)|minutes?|hours?|seconds?|secs?|mins?|"
    r"monday|tuesday|wednesday|thursday|friday|saturday|sunday|weekly|daily|hourly|every (?:day"
    r"|hour|"
    r"morning|time|week|other)|each (?:day|hour|time)|twice|thrice|three times|times"
    r"|again and again"
    r"|except|but not|apart from|other than|half of|most of|only (?:if|on|in|when|as|until|after"
    r"|while)|at least|at most|per|percent|%)"
    r"(?: |$)"
)
_NO_LIMIT = re.compile(
    r"\b(for|hold on|wait|stop|pause) (a|one|some|few|a few) (minutes?|seconds?|moment|hours?)\b"
    r"|\b(a|one|this|spare|free|any|half a|your) (spare |free |quick )?(minute|second|moment"
    r"|sec|min|hour)\b|\bmost (?:urgent|important)\b"
    r"|\bat all times\b|\b(checked|looked|tried|asked|called|tested) (\w+ )?(twice|\w+ times)\b"
)

_UNITS = re.compile(
    r"(<number>|<point>|\d) ?(feet|foot|ft|inch|inches|yards?|yd|cm|mm|km|kilometers?"
    r"|kilometres?|miles?"
    r"|centimeters?|centimetres?|millimeters?|millimetres?|pixels?|cells?|steps?|degrees?|px|tiles?"
    r"|blocks|paces|grid)\b|\bin (feet|foot|ft|inches|yards|cm|mm|km|centimeters|millimeters|miles|"
    r"pixels|cells)\b|\b(latitude|longitude|gps)\b"
)


_NO_OTHER = re.compile(r"\b(nothing|no|none)( \w+){1,6} (than|as) <label>")
"""Says that one comes before all others."""


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


def conditional(line: str) -> str | None:
    """Why words are no instruction yet: they hang on a condition."""
    if _IF.search(_IF_POLITE.sub(" ", line)) or re.search(r"\bif there (is|are)\b", line):
        return "I cannot wait for a condition, so I change nothing yet."
    return None


def not_meant(line: str, intent: str) -> str | None:
    """Why words are no instruction although they sound like one; None if they may be one."""
    line = _NO_OTHER.sub(" ", line)
    if intent == "undo":
        if re.search(r"\b(not|never) (\w+ ){0,2}(undo|revert|reverse|take|roll|go|change)\b", line):
            return "You say what not to do, so I change nothing."
        if why := conditional(line):
            return why
        if re.match(r"(what|why|when|who|how) (do|does|did|is|was|can|would|happens)\b", line):
            return "That sounds like a question, so I change nothing."
    elif intent != "query_status":
        asks = line.rstrip().endswith("?") and not _ASKS_FOR.search(line)
        if _ASKS_ABOUT.search(line) or _ASKS.search(line) or asks:
            return "That sounds like a question, so I change nothing."
        if _is_denied(line, intent):
            return "You say what not to do, so I change nothing."
        if intent == "pause_robot":
            line = re.sub(
                r"\b((un)?till?|while|so long as) (i|we|you|they|people|the \w+|somebody"
                r"|someone)( \w+){1,3}[ .!?]*$",
                " ",
                line,
            )
        if why := conditional(line):
            return why
        if _TOLD.search(_TOLD_BY_ME.sub(" ", line)):
            return "That is what somebody else says, so I change nothing."
        if _PAST.search(line) and not _excused_past(line, intent):
            return "That sounds like something that has happened already, so I change nothing."
        if _LIMITS.search(_NO_LIMIT.sub(" ", line) + " "):
            return "I cannot keep to times, repetitions or exceptions."
    return None


_UNWANTED = re.compile(
    r"\bnot (let|allow) (any\w+|them|him|her|people|somebody|someone) (tell|fool|convince|say"
    r"|persuade|talk)\b"
    r"|\bnot (believe|listen|trust|fall for)\b|"
    r"\bno (need|reason|point|use|sense|cause) (to|in|of|for) (\w+ )?(cancel|delet|remov|drop|abort"
    r"|scrap|paus|stop|resum|rais|lower|undo|halt|hold|skip|add|chang)\w*|\bnot (want|need"
    r"|ask) (<\w+>|you|me|us|him|anyone|the \w+) to\b"
)
_PASSIVE = re.compile(
    r"\b(should|must|need|needs|ought|may|can|could|will|is|are|does|do) not( to)? (be|being"
    r"|need|get|require|have to be"
    r"|need to be|want)( to be)? (\w+ly )?(paus|stop|halt|held|suspend|frozen|freez|cancel"
    r"|remov|delet|drop|"
    r"scrap|block|clos|rais|lower|add|resum|restart|releas|undone|revert|bump|prioriti"
    r"|interrupt|wait)\w*"
)
_NONE_SUCH = re.compile(
    r"\b(is|are|was|were) (not|never)( really| actually| even)? (any|a|an|one)\b|\bno such\b"
    r"|\b(not|never) (see|find|spot|notice|have|got) (any|a|an)\b|\bno <kind>|\bnothing (is"
    r"|at|between|from)\b"
)
_SOUND = re.compile(
    r"\b(is|has|did) not (been )?(broken?|dead|fail(ed)?|stuck|damaged|down|out|lost)\b"
)


def _is_denied(line: str, intent: str) -> bool:
    if intent == "obstacle_update" and re.search(
        r"\b(do not|never) (block|close|mark|add|put|draw|shut|fence|seal|wall)\b", line
    ):
        return True
    if (_UNWANTED.search(line) and intent != "resume_robot") or (
        intent == "robot_failed" and _SOUND.search(line)
    ):
        return True
    passive = _PASSIVE.search(line)
    if passive and (intent != "cancel_task" or passive[0].endswith(("cancelled", "dropped"))):
        return True
    if intent == "obstacle_update" and _NONE_SUCH.search(line):
        return True
    rest = _NOT_AFTER_ALL.sub(" ", line)
    if intent in ("remove_obstacle", "cancel_task", "change_task_priority", "robot_failed"):
        rest = re.sub(
            r"\b(no|not|has not|have not) (longer |more )?(<\w+>|need\w*|there)", " ", rest
        )
    if intent == "cancel_task":
        rest = re.sub(
            r"\bnot (\w+ ){1,2}(task |job )?<label> (any ?more|any longer|at all|after all)",
            " ",
            rest,
        )
        rest = re.sub(r"\b(not|never) (bother|waste|trouble)\b", " ", rest)
        rest = re.sub(
            r"\bno (need|point|use|reason|sense) (in|of|for|to|keeping|doing)\b", " ", rest
        )
    if intent == "obstacle_update":
        rest = re.sub(r"\b(no|not) (way|passage|access|go|entry|through\w*|there|yet)\b", " ", rest)
        if re.search(r"\bthere is no\b|\bno (<kind>|obstacle|wall|blockage)\b", rest):
            return True
    if intent == "resume_robot":
        rest = re.sub(
            r"\bno (need|reason|point) (to|in) (\w+ )?(hold|stop|keep|paus|wait)\w*", "", rest
        )
    if intent == "robot_failed":
        rest = re.sub(
            r"\bnot (\w+ )?(mov|go|driv|work|run|restart|boot|wake|charge|come|turn|start"
            r"|react|answer|plan|count|reckon|rely"
            r"|use)\w*\b",
            " ",
            rest,
        )
    if intent == "cancel_task":
        rest = re.sub(r"\bnot do (the )?(task |job |order )?<label>[ .!]*$", " ", rest)
    if intent == "pause_robot":
        rest = re.sub(
            r"\b(do|must|should|may) not (let )?(<robot> )?(move|go|drive|continue)\b", " ", rest
        )
    return bool(_NOT.search(rest))


def _excused_past(line: str, intent: str) -> bool:
    if intent == "remove_obstacle" and not re.search(r"\b(yesterday|ago|last|there was)\b", line):
        return True
    if intent == "robot_failed" and not re.search(
        r"\b(yesterday|ago|last|this morning|earlier|had been)\b", line
    ):
        return True
    return intent == "cancel_task" and bool(_STILL_PAST.search(line))


def doubtful(line: str, intent: str) -> str | None:
    """Why words may be an instruction but are too unsure to act on."""
    if _UNITS.search(line):
        return "I understand metres only. Give the points in metres, e.g. (5, 19.5)."
    if _DOUBTS.search(line):
        return "You sound unsure, so I ask before I propose anything."
    if intent != "query_status" and (_OR.search(line) or _OR_DO.search(line)):
        return "That leaves open which one is meant. Name exactly one."
    line = re.sub(r"\bas well as\b", "and", _NO_OTHER.sub(" ", line))
    if intent in ("change_task_priority", "cancel_task") and _COMPARES.search(line):
        return (
            "I cannot order two tasks against each other; I can make a task high, normal or low "
            "priority. Say which task and which priority, e.g. 'make bb high'."
        )
    return None


_AGAINST = {
    "obstacle_update": r"\b(remove\w*|delete|erase|reopen\w*|unblock\w*|get rid|gone|cleared|free"
    r"|lift|open|again|"
    r"disappeared|unmark|no (longer|more) (a |an |any )?(<kind>|obstacle|there|blocked|closed)"
    r"|passable again|clear(?! of))\b",
    "robot_failed": r"\b(repair(ed)?|fix(ed)?|alive|fine|ok|okay|recovered|works|working well"
    r"|is working"
    r"|charge|again|back|reboot)\b(?! and)",
    "resume_robot": r"(?<!off )(?<!the )\b(stop|pause|hold|halt|wait|freeze)$",
    "cancel_task": r"\b(not|never) (\w+ )?(forget|miss|lose)\b"
    r"|\b(without delay|urgent|asap|first|just normal|high|priority)\b",
    "add_task": r"\b(cancel|delete|remove|abort|undo|wall|obstacle|block(ed|s)"
    r"|parked (his|her)|toppled)\b",
}
"""Words that speak against an intent, however likely the rest makes it."""


def speaks_against(line: str, intent: str) -> bool:
    """Whether a word says the opposite of an intent."""
    if intent == "obstacle_update" and not re.search(
        r"(?<!<)\b(?!to\b|from\b|and\b|at\b)[a-z]+\b(?!>)", line
    ):
        return "<kind>" not in line
    pattern = _AGAINST.get(intent)
    if intent in ("obstacle_update", "robot_failed"):
        line = re.sub(r"\b(say|get|up|move|start|boot|work|drive|go) again\b", " ", line)
        line = re.sub(r"\b(not|no|never|cannot|no longer) (\w+ )?(\w+)\b", " ", line)
        line = re.sub(
            r"\b(needs?|must|has to|had to|out|beyond|to be|in) (\w+ )?(repair\w*|fix\w*)\b",
            " ",
            line,
        )
    return pattern is not None and bool(re.search(pattern, line.strip(" .!")))


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


def guarding() -> frozenset[str]:
    """Words that these gates look for, so that no slip is seen in them."""
    patterns = [one.pattern for one in globals().values() if isinstance(one, re.Pattern)]
    return frozenset(re.findall(r"[a-z]{3,}", re.sub(r"\\[a-z]", " ", " ".join(patterns))))
