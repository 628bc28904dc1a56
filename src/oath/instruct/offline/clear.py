"""What an instruction must say to be acted on: words that mean it, and none that take it back.

The model tells which command is the most likely; here its words are held against the classes of
English that change what is meant: verbs, auxiliaries, adverbs of degree and frequency, quantifiers.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

_SAYS: Mapping[str, str] = {
    "cancel_task": (
        r"cancel\w*|drop\w*|delet\w*|remov\w*|abort\w*|scrap\w*|scrub\w*|discard\w*|kill\w*"
        r"|scratch\w*|call\w* (\w+ |<\w+> ){0,3}off|withdr\w+|void\w*|bin|dismiss\w*|terminat\w*"
        r"|revok\w*|eras\w*|abandon\w*|annul\w*|ditch\w*|rid|tak(e|en|ing) (task |job |order )?"
        r"(\w+ |<\w+> )?(out|off|away|back)|str(ike|uck)|forget|retract\w*|no longer"
        r"|any ?(more|longer)|not (\w+ ){0,2}(need\w*|do|bother|doing|required|wanted|want|worry"
        r"|happen\w*)|no (need|use|point)|unneeded|unnecessary|needless|redundant|superfluous"
        r"|obsolete|pointless|skip\w*|nix|axe[d]?|exclud\w*|leave (\w+ |<\w+> ){0,2}(out|undone"
        r"|alone)|cut|rm|dump\w*|pull\w*|purg\w*|off the (\w+ )?(list|table|plan|books|board|menu"
        r"|schedule)|moot|out of the (plan|list|queue|schedule)|shelv\w*|stand down|chuck|toss"
        r"|eliminat\w*|disregard|ignor\w*|rescind\w*|decided against|short-ship|belay|wave off"
        r"|(is|are) off|without|after all|lose|gone|dead|wipe\w*"
        r"|thr[eo]w\w* (\w+ |<\w+> ){0,3}(out|away)|eighty-six|eighty - six|86"
        r"|decided against|against|binn\w+|binned"
        r"|chop\w*|give up on|let <label> go|<label> (can|may|must|should|has to|is to) go"
        r"|scupper\w*|quash\w*"
        r"|<label> (is|was) a (mistake|typo|duplicate|error)|wash\w* out|out with|do away"
        r"|see the back of"
        r"|repeal\w*|invalid\w*|negate\w*|fell through|fallen through|by mistake|in error"
        r"|duplicate|trash\w*|junk\w*"
        r"|back(ed|ing)? out|reject\w*|refus\w*|decline\w*|suspended|closed|unlist\w*|kibosh"
        r"|finish\w* with"
    ),
    "robot_failed": (
        r"fail\w*|brok\w*|break\w* down|breakdown|dead|di(ed|es)|defect\w*|kaput\w*|crash\w*"
        r"|out of (order|service|action|commission|operation|use|the game|play|the mission)"
        r"|lost(?= (all|power|contact|connection|signal|its (wheel|drive|motor|power)|for good"
        r"|<robot>)| ?[^\w ]|$)"
        r"|toast|malfunction\w*|wreck\w*|tipped|overturned|toppled|f(e|a)ll(en)? over"
        r"|(write|wrote|written|writing|count|rule|take|taken|knocked|strike|struck|leave) .*"
        r"(off|out)|(not|no longer|stopped|never|without|cannot) (\w+ ){0,3}(work\w*|function\w*"
        r"|operat\w*|mov\w*|run\w*|driv\w*|boot\w*|start\w*|go\w*|us\w+|count\w*|get up|rely"
        r"|available|continue|usable|power)|burn\w*|brick\w*|conked|g(i|a)ven? up|smok\w*|fire"
        r"|useless|unusable|unserviceable|unavailable|inoper\w*|incapacitated|disabled|damag\w*"
        r"|casualt\w*|finished|done for|crapped|bust\w*|ruined|(is|went|has gone"
        r"|gone) down(?! (the|at|by|to))|down(?! (the|at|by|to))"
        r"|(is|are|s) out|offline|off-line|gone|collaps\w*|defunct|unresponsive|stuck|wrong with"
        r"|shot|fried|jammed|written|lifeless|(lost|no|out of) (power|battery|wheel)"
        r"|aog|beyond (repair|help|saving|rescue)|drown\w*|bl[eo]w\w*|blown|snapp\w*|sank"
        r"|sunk|melt\w*|explod\w*"
        r"|seiz\w*|crack\w*|(packed|pack) (\w+ )?(in|up)|bit(ten)? the dust|kicked the bucket"
        r"|had it|had its day"
        r"|no good|on fire|smash\w*|shatter\w*|torn|flipp\w*|tipp\w*|roll\w* over|retire\w*"
        r"|scrap\w*|ghost|knackered"
        r"|f[ao]ll(en)? (off|apart|down|into|to)|fell|short ?-?circuit\w*|dropped dead"
        r"|in pieces|to pieces|wrecked"
        r"|rip|r\.i\.p|pass(ed)? away|expired|perished|snuffed|croaked|borked|busted|hosed"
        r"|bust|write-off|demolished"
        r"|destroyed|crushed|run over|hit by|remov\w* .*service|take .*(service|roster|lineup"
        r"|line-up)|mia|missing"
        r"|non-?operational|non-?functional|disintegrat\w*|immobile|catch\w* fire|caught fire"
        r"|flames|catastroph\w*"
    ),
    "undo": (
        r"und[oi]\w*|revers\w*|revert\w*|roll\w*( \w+){0,3} back|rollback|unmake|rewind\w*"
        r"|restor\w*|ctrl.*|(take|taking|put|set|go|turn|switch|chang\w*|step|back)( \w+){0,6} back"
        r"|back out|as (it|they|things) (was|were)|(way|how|like) (it|they|things) (was|were)"
        r"|previous state"
        r"|last (change|command|instruction|action|edit|order|step)"
    ),
    "remove_obstacle": (
        r"remov\w*|delet\w*|clear\w*|eras\w*|tak(e|en|ing) (\w+ |<\w+> ){0,3}(away|off|out|down"
        r"|back)|took|drop\w*|rid|unmark\w*|wip\w*|discard\w*|gone|no (longer|more)"
        r"|any ?(more|longer)|away|dismantl\w*|lift\w*|clean\w*|open\w*|free\w*|disappear\w*"
        r"|vanish\w*|torn|tore|demolish\w*|pulled|unblock\w*|moved (it |them )?(away|out|aside|off"
        r"|elsewhere|to the side)|rm|strike|scratch|cancel\w*|passable"
        r"|pass|picked up|forget|carried|collected|out of the way|outta|out there|disregard"
        r"|undone|left|fixed|down|off the|mopped|swept|towed|scrap|history|ignore"
        r"|shift\w*|c(a|o)me down|haul\w*|dragg\w*|roll\w*|cart\w* off|melt\w*|dried|drop"
        r"|evaporat\w*|stow\w*|repair\w*"
        r"|knock\w* down|push\w* (aside|away)|got rid|scrub\w*|sort\w*|unlock\w*|reopen\w*"
        r"|moved on|relocat\w*|disassembl\w*"
    ),
    "obstacle_update": (
        r"block\w*|clos\w*|impass\w*|obstruct\w*|shut|cut off|cordon\w*|passable|off ?-?limits"
        r"|out of bounds|inaccessible|unusable|barred|sealed|(there|here|this|that|it|now|way"
        r"|which) "
        r"(is|are|stands?|lies|sits)|now|appear\w*|mark\w*|add|put|draw|register|report\w*|new"
        r"|found|detect\w*|discover\w*|identif\w*|spott\w*|see|seen|saw|sight\w*|sens\w*|notic\w*"
        r"|stand(s|ing)|ly?ing|lies|laid|left|plac\w*|buil[dt]|erect\w*|install\w*|f[ea]ll\w*"
        r"|spill\w*|tipped|collaps\w*|no (\w+ )?(entry|access|way|through\w*|passage|go|driving"
        r"|entering)"
        r"|forbidden|prohibited|keep (out|clear|away)|avoid|in the way|reach(es|ing)|stretch\w*"
        r"|span\w*|occup\w*|cover\w*|head\w* up|beware|careful|watch|caution|warning|got|have|has"
        r"|corners?|polygon|dump\w*|dropp\w*|park\w*|jamm\w*|denied|stuck|creat\w*|enter|log"
        r"|set|includ\w*|insert|map|(not|cannot|no longer|nobody|no one|no robot|nothing|none) "
        r"(\w+ ){0,3}(pass\w*|cross\w*|us\w+|driv\w*|go|get\w*|through|enter\w*|travers\w*"
        r"|accessible|free|clear|open|available|navigable|reachable)|going up|gone up|set up"
        r"|came up"
        r"|come up|pop\w*|note|ends?|finish\w*|across|starts?|begin\w*|consider"
        r"|treat|declare|place|record|went up|sprung|emerged|turned up|hang\w*|lean\w*"
        r"|protrud\w*|dangl\w*|planted|tak\w+ up|fill\w*|gr[eo]w\w*|locate\w*|crosses|runs"
        r"|roadblock|tape\w*|dug|dig\w*|occupies|existence|account|kept|footprint|bar\w*"
        r"|stretches|sit(s|ting)|rest\w*"
        r"|snow\w*|flood\w*|leak\w*|parked|stack\w*|pile\w*|heap\w*|stor\w*|hazard\w*"
        r"|danger\w*|work in progress|locked"
        r"|constru\w*|mounted|hung|hang\w*|abandon\w*|forgot\w*|swing|swung|crash\w*"
        r"|separat\w*|divid\w*|fenc\w*|wall\w*"
        r"|taken up|filled|rerout\w*|detour\w*|go around|stay (out|away|clear)|exists?"
        r"|goes from|extend\w*|arriv\w*|deliver\w*"
    ),
    "pause_robot": (
        r"stop\w*|paus\w*|hold\w*|halt\w*|freez\w*|frozen|wait\w*|park\w*|stay\w*|stand\w*|still"
        r"|suspend\w*|brak\w*|whoa|not (let )?(\w+ |<robot> )?(mov\w*|go|driv\w*|budge|continue"
        r"|proceed|leave|do anything)|hang|rest|immobili\w*|stall\w*|keep|remain\w*|ceas\w*|tight"
        r"|break|pull over|pin|put|a moment|a second|a minute|stationary|e-stop|pull|quit"
        r"|hang fire|hold fire|stand by|standby|easy|anchor\w*|idle|knock it off|enough"
        r"|put (\w+ |<\w+> ){0,2}on hold|kill|cut|lock|down tools|time out|timeout|breather"
        r"|rein|slam|hands off|as you are|stick"
    ),
    "resume_robot": (
        r"resum\w*|restart\w*|continu\w*|unpaus\w*|releas\w*|unfreez\w*|unhold|wak\w*|reactivat\w*"
        r"|start\w*|un-\w+|unblock\w*|unpark\w*|let|go\w*|proceed\w*|carry|free\w*|mov\w*|driv\w*"
        r"|roll\w*|again|back|green|work\w*|on|off|up|may|can|clear\w*|unlock\w*|set|activ\w*"
        r"|crack on|back|get (\w+ |<\w+> ){0,3}(moving|going|rolling|started|cracking|on)"
        r"|hit the road|run\w*|kick|ahead|about"
        r"|fire up|chop|hop|march|march on|press on|push on|keep going|as before|on (your|its"
        r"|his|her|their) way|dismissed|return\w*"
    ),
}
_EVIDENCE = {
    intent: re.compile(rf"(?<![\w<])(?:{words})(?![\w>])") for intent, words in _SAYS.items()
}

_NEGATED = re.compile(
    r"\b(not|never|hardly|barely|nearly|almost|scarcely|half|partly|partially|without|neither|nor"
    r"|far from|close to|about to)( been| being| quite| yet| really| actually| all| entirely"
    r"| completely| fully| to| have| has| a| the| be)*$"
)
"""Just before what an instruction means, it takes it back."""

_STATES = ("robot_failed", "remove_obstacle")
"""Intents that tell how things are."""

_ATTITUDE = re.compile(
    r"\b(regret\w*|remind\w*|remember\w*|talk\w* (about|of)|discuss\w*|speak\w* (about|of)|debat\w*"
    r"|recall\w*|warned|convinc\w*|promis\w*|threaten\w*|discourag\w*|explain\w*|describ\w*"
    r"|advis(e|es) (against|me|us)|persuad\w*|prevent\w*|imagin\w*|(let|keep) (me|us) (know|posted"
    r"|informed)|tell (me|us) (how|when|if|what|which|who|about|of)|notify|alert (me|us)"
    r"|ask (?!you\b"
    r"|for\b|that\b|to\b)\w+|apologi[sz]e\w*|joking|kidding|just testing|hypothetical\w*|in theory"
    r"|theoretically|on paper|for example|for instance|e\.g|such as)\b"
)
"""Verbs that speak of an instruction, or of its wording, instead of giving it."""
_TAG = re.compile(
    r", ?(is|are|was|were|has|have|does|do|did|will|would|can|should) (not )?(it|they|he|she|that"
    r"|there|<\w+>)( not)?\W*$"
)
_WOULD_BE = re.compile(
    r"(?<!it )(?<!that )(?<!which )\bwould (be (?!\w+ed\b|for\b|to\b|at\b|going\b|<)|make|cost|help"
    r"|take|mean|annoy|upset|suit)"
)

_NOBODY = re.compile(
    r"\b(nobody|no one|noone|nothing|none|neither)( has| have| had| is| are| was| should| must| may"
    r"| will| can| could| would| ever| yet| really| to| be| dare| needs?)* (cancel|stop|paus|block"
    r"|remov|delet|fail|broke|resum|releas|undo|rais|lower|prioriti|add|deliver|bring|halt|hold"
    r"|clear|drop|obstruct|touch|wants?)\w*"
)
_GERUND = re.compile(
    r"^\W*(cancell?|paus|stopp|hold|add|rais|lower|remov|delet|resum|clos|block|bring|tak|mov|undo"
    r"|mark|deliver|prioriti[sz]|dropp|halt|abort|restart|chang|revert|do|put|mak"
    r"|giv)ing [^.!;]*\b(would|could|might|will|may|is|was|costs?|takes?|took|means?"
    r"|seems?|annoys?|hurts?|helps?|makes?|makes no|had|has)\b"
)
_REPORTS = re.compile(
    r"<robot> (\w+ly |just |already |also |now )?(stops|stopped|waits|waited|holds|held|pauses"
    r"|paused"
    r"|halts|halted|stood|keeps|stays|stayed|parks|parked|rests|freezes|froze|resumed|resumes"
    r"|continues|continued|went|drives|drove|moves|moved|(is|was|got|has been|had been|are|were) "
    r"(\w+ )?(stopped|stopping|waiting|paused|standing|parked|halted|held|on hold|still|moving"
    r"|driving|running|released|resumed))\b|\bdid <robot>"
)
_NOT_THIS = re.compile(r"\b(not|never) <(label|robot|obstacle|point|place)>")
_TELLS_OF = re.compile(
    r"^\W*(the|this|that|our|my|a|an) (\w+ )?<kind> (from|between|at|along)\b.*<point>.*?"
    r"\b(was|were|could|might|may|should|would|needs?|has been (painted|checked|repaired"
    r"|inspected))"
    r"\b|(?<!<kind> )(?<!it )(?<!obstacle )(?<!that )(?<!which )(?<!thing )(?<!line )(?<!and"
    r" )(?<!not )(?<!cannot )(?<!nobody )(?<!can )\b(drove|walked|went|drives|drive|goes"
    r"|moved|ran) (along|past|by|around|over|from|through)\b"
)

_META = re.compile(
    r"^(?:\W|please |kindly |now |can you |could you |would you |ok |hey )*(?:write|repeat|print"
    r"|translate|sing|spell|recite|compose|pronounce|rephrase|paraphrase|echo|output|rhyme"
    r"|tell me a"
    r"|tell a|say (?:that|after|the|aloud|to|:|\")|read|rewrite|reply|respond|answer|guess|define"
    r"|quote|invent|make up|joke|dream)\b(?! (?:off|out)\b)|\bafter me\b"
    r"|\b(?:poem|song|joke|story|haiku|rhyme|essay|french|german|spanish|english|latin)\b"
)
_SAID = re.compile(
    r"\b(they|people|some|folks|everybody|everyone|somebody|someone|he|she|one|colleagues?|<robot>"
    r"|(?:the|my|our|your|a|an|this|that|his|her) \w+(?: \w+)?) (?:always |also |just |still |now |"
    r"all )?(say|says|think|thinks|believes?|claims?|suggest\w*|recommend\w*|propos\w+|hopes?"
    r"|hoped|wish\w*|feels?|felt|guess\w*|argue\w*|warn\w*|complain\w*|assum\w+|expects?|expected"
    r"|predict\w*|fears?|feared|doubts?|denie[sd]|deny|swears?|swore|thought|knew|dream\w*)\b"
)
_PLANNED = re.compile(
    r"(?<!would )(?<!should )(?<!'d )\b(likes?|loves?|prefers?|enjoys?|hates?|refuses?) (to"
    r"|\w+ing)\b|\bkee?p(s|t) "
    r"(on )?\w+ing\b|\b(is|are|am|was|were|be) (also |just |now |all )?(going|about|planning"
    r"|meant|hoping"
    r"|intending|supposed|due|scheduled|expected|bound|likely|set(?! to (high|low|normal|top"
    r"|urgent|the|maximum|minimum|<\w+>))|tempted|inclined) to "
    r"(?!be (brought|taken|carried|delivered|moved|picked|fetched|collected)\b)(?!need\b)"
    r"(?!the\b)(?!move\b)[a-z]+\b"
    r"|(?<!not )(?<!n't )\b(plan|plans|planned|intend\w*|mean|meant|hope|hoped|aim|wanted"
    r"|tried|try|tend|used)"
    r" (for \w+ )?to\b|\bought to\b(?! (really )?(be (done|first|served|handled|next"
    r"|finished)|come|go|jump) )|\b(some|one|any) day\b|\beventually\b|\bin (the )?future\b"
    r"|\bnext (week|month|year|time|monday|tuesday|wednesday|thursday|friday|shift)\b"
    r"|\b(i|we) (would|could|might) (?!like|love|prefer|appreciate|be (grateful|glad|happy|obliged"
    r"|delighted)|need|want|rather|ask|please|also|really|not|use|have|just)\b"
    r"|\b(would|could|should|might|must|may|ought to) have (\w+ )?(been|gone|done|made|taken|broken"
    r"|put|left|built|stood|\w+[^e]ed)\b"
    r"|\bif (only|i were|it were|we were)\b|\bwere (it|i|we)\b|\bwish\b|\bdreamt?\b|\b(later today"
    r"|later on|this (afternoon|evening)|overnight)\b"
)
_WILL_BE = re.compile(
    r"\b(there|they|it|that|<\w+>|someone|somebody|we|he|she|\w+s) (will|would|shall|may|might"
    r"|could|should) (\w+ )?(be|build|put|have|fail|break|die|need|go|stand|appear|come|arrive"
    r"|install|erect|close|block|remove|clear|take|mount|place|park|set)\b"
    r"|\b(somebody|someone|they|we|you|one|anyone|nobody) (ought to|should|could|needs? to|must"
    r"|has to|have to|had to) \w+"
)
_PASSABLE = re.compile(
    r"\b(\w+ )(will|would|shall|may|might|could|should|must|needs?|have|has)( to)? (not|have to"
    r"|need to|drive|go|get|find|take a|use|avoid|detour|route|stay|be (marked|added|avoided"
    r"|entered|treated|considered|able|closed off|removed|deleted|taken|cleared|erased|wiped))\b"
)
_WRITE_OFF = re.compile(
    r"\b(we|you|they|i) (will |would |shall )?(have to|must|need to|should|can|had to|has to"
    r"|ought to) "
    r"(write|count|scrap|replace|mark|declare|take|retire|bury|do without|manage without|forget)\b"
)
_OFTEN = re.compile(
    r"\b(always|usually|often|sometimes|generally|typically|rarely|seldom|occasionally|mostly"
    r"|frequently|ever since|every now and then|now and then|from time to time|on occasion"
    r"|regularly|weekdays|weekends|\w+days(?<!nowadays)|mornings|evenings|nights|holidays)\b"
)
_DEGREE = re.compile(
    r"\b(nearly|almost|hardly|barely|scarcely|partly|partially|half-?way|practically"
    r"|virtually|semi-?\w*|just about|more or less|sort of|kind of)\b"
)
_BITS = re.compile(
    r"\b(a (little|tiny|wee|small)?( bit)?|slightly|somewhat|a tad|a touch|(a|one|two) (notch\w*"
    r"|levels?|steps?|places?|positions?|slots?|points?)|by one|by two|by \d+)(?= ?[.,!;]?$| (more|"
    r"less|higher|lower|up|down|later|earlier|sooner|faster|please|only|bit)\b)"
    r"|\b(a bit|a little|slightly|somewhat|a tad|a notch)\b"
)
_BIGGER = re.compile(
    r"\b(\w{2,}er|more \w+|less \w+|worse|further|farther) than (we|i|it|they|you|expected|thought"
    r"|before|usual|planned|that|this|the)\b|\b(move|moved|shift|shifted|extend|extends|extended"
    r"|grow|grown|shrink|shrunk|turn|rotate|resize|enlarge|lengthen|shorten)\b (the|that|this|our"
    r"|<\w+>)"
)
_ALL = re.compile(
    r"\b(everything|anything|all|every|each|others?|rest|both|some|most|many|several|few|half"
    r"|any|none|either|two|three|four)\b(?! (?:right|set|done|good|the same|of a sudden))"
)
_WHERE = re.compile(
    r"^[^,.;]*<robot> (right |just )?(at|in front of|near|behind|before|after|by|next to|outside)"
    r" (?!once|the moment|the spot|its|the time|least|all|this point)|"
    r"\b(at|in|near|before|after|behind|by|beside|until|on reaching|in front of|next to|outside"
    r"|inside|close to|towards|to) (the |your |its |room |point |station |place )*<(place|point)>"
)
_LESS = re.compile(
    r"\b(low|slow\w*|weak|acting|strange|odd|oddly|weird\w*|funny|soon|late|lagging|wobbl\w*|noisy"
    r"|behaving|behaves|misbehav\w*|tired|sluggish|squeak\w*|charging|recharg\w*|warm|hot|dirty"
    r"|failed (its|his|her|the|at|on|<\w+>|to (?!start|boot|move|restart|come|power))"
    r"|favou?rite|struggl\w*"
    r"|flickers?|hesitat\w*|shak\w+|delay\w*|battery is)\b"
)
_VITAL = (
    r"wheels?|battery|batteries|motors?|engine|drive|axles?|computer|electronics|controller|power"
    r"|gearbox|gears?|chassis|transmission|brain|cpu|left|right|front|rear|main|tracks?|mainboard"
)
_PART = re.compile(
    rf"<robot> (?!(?:{_VITAL}|just|now|also|really|again|too|and|so|but|he|it|she|that|which"
    rf"|\w+ly|all|"
    r"has|have|had|is|was|went|got|who|broke|fell|died|gave|seems|there|then|please|i|we|over"
    r"|unit|as|for|from|off|out|of|from|with|to|not)"
    r"\b)\w+ (is|are|was|were|has|have|died|broke|failed|burnt|burned|went|got|fell|came|does|do)\b"
    rf"|\b(?!(?:{_VITAL}|out|instead|loss|failure|breakdown|rid|because|death|end|work|tasks|jobs"
    r"|case|part|all|both|hold|sight|off|signal|sign|life|one|death)\b)\w+ of (the )?<robot>"
    r"|\b(into|with|against|by|than|like|for|from|after|before|behind) <robot>.*<robot>"
    r"|<robot>.*\b(into|with|against|by|than|like|for|from|after|before|behind) (the )?<robot>"
)
"""A part of a robot, or another one, is what is spoken of."""
_FOR = re.compile(r"\b(for|behind|after|until|with|from|by|before) (the |task )*<(robot|label)>")
_TAKEN_BACK = re.compile(
    r"\b(better not|rather not|(on|having) second thoughts?|no ,? ?wait|wait ,? ?no"
    r"|or (rather )?wait"
    r"|or not|actually ,? ?(no|not)|maybe not|hang on|strike that|nah|no ,? do not"
    r"|please do not(?! (drive|go|enter|cross|use|pass|let|move))|or no)\b"
)
_BUT = re.compile(r"\bbut (?!(?:please|now|first|thanks|thank|quickly|fast|hurry|quick)\b)[^<]*$")
_CAME = re.compile(
    r"\b(came|comes|arrived|arrives|stems|originates?|originated|was (taken|brought|carried|moved"
    r"|delivered|bought)|(i|we|he|she|they) (\w+ly |just |have |had )?(walked|drove|driven|ran|took"
    r"|taken|brought|carried|delivered|moved|went|transported|dropped|strolled|hiked|cycled)"
    r"|got here|is (about )?<number>|it is <number>|it takes|it took|measures)\b"
    r"(?! (in|up|at|now)\b)"
)

_SWITCHED = re.compile(
    r"\b(shut|switch|turn|power|wind|stand|slow|calm|settle|sit)(ing|ting)? (<\w+> )?(down"
    r"|off)\b"
)
_GONE_OFF = re.compile(
    r"\b(dead|died|dies|broke\w*|fail(ed)?(?! (to|its|his|her|the|at|on|<\w+>)\b)|crash\w*"
    r"|burn\w*|wreck\w*|out of (order|service"
    r"|action)|write|written|count|consider|kaput\w*|toast|finished|bust\w*|empty|flat)\b"
)

_ASKED = re.compile(
    r"\?|^(?:\W|so |and |hey |hi |hello |please |well |ok |okay |now |just |sorry "
    r"|then )*(?:how|what"
    r"|where|which|who|when|is|are|do|does|did|has|have|can|could|would|will|may|show|tell|give"
    r"|list"
    r"|report|status|let|check|read|describe|summari[sz]e|explain|i)\b"
    r"|\b(status|progress|report|update|summary|overview|sitrep|state|tell|show|news|list|know"
    r"|brief|rundown|recap|inform|see|stand|eta|situation)\b"
)
_OF_MISSION = re.compile(
    r"<(robot|label|place|point|obstacle|unknown_\w+)>|\b(status|progress\w*|robots?|tasks?|jobs?"
    r"|orders?|deliver\w*|far|things|going(?! to)|doing|done|left|remain\w*|report\w*|updates?"
    r"|summary|overview|state|situation|sitrep|finish\w*|busy|eta|scoop|rundown|plan|schedule"
    r"|happen\w*|news|mission|fleet|everyone|everybody|everything|we|obstacles?|blocked|idle|open"
    r"|outstanding|pending|waiting|queue|complete\w*|paused|brief\w*|recap|walls?|units?"
    r"|bots?|stopped|shape"
    r"|latest|coming along|it go|up to|board|working)\b"
)
_MEANING = re.compile(
    r"\b(mean|means|meaning|definition|called|define|spell\w*|rain\w*|weather|heavy|weigh\w*|cost"
    r"|costs|price|old|tall|wide|how (do|can|could|would|should|to)( i| we| one| you)?|why"
    r"|what (happens|would|will|can|could|if)|who|whose|colou?r|favou?rite|lunch|coffee|ceo|made of"
    r"|invented|built|kind of|sort of|name|time is|date|day is)\b(?! (are|is) we\b)"
)


_TERSE = re.compile(
    r"(?:\W|\d|please |over |ok |obstacle |obstruction |barrier |blockage |object |thing |a "
    r"|an |the "
    r"|from |to |between |and |at |along |through |until |til |till |up |down |of |with |points? "
    r"|line |id |type |kind |control |team |attention |copy |hey |hi |also |plus |then "
    r"|be advised |there |here |passage |aisle |corridor |route |way |path |long "
    r"|area |zone |line |segment |running |runs |go(?:es|ing) |<\w+> ?)*"
    r"(?:over|please|thanks|obstacle|out|copy)?\W*"
)
"""Says no more than what and where."""


_FIRST = re.compile(
    r"\b(first|last|next|before|after|priority|urgen\w*|later|sooner|front|back|top|bottom"
    r"|normal)\b"
)


def means(line: str, intent: str) -> bool:
    """Whether words say by themselves that an intent is meant."""
    found = _EVIDENCE.get(intent, _FIRST).search(line)
    return bool(found)


def is_evidence(line: str) -> bool:
    """Whether words may say by themselves what is to be done."""
    return any(one.search(line) for one in _EVIDENCE.values())


def unclear(line: str, intent: str) -> str | None:
    """Why the words of a likely instruction do not say clearly what is to be done."""
    if _META.search(line) and intent != "query_status":
        return "I take instructions about the mission only, so I change nothing."
    if intent == "query_status":
        later = re.search(
            r"\b(know|tell me|notify|warn|alert|inform) (\w+ )?(as soon|once|when <)", line
        )
        fair = (
            not later
            and _ASKED.search(line)
            and _OF_MISSION.search(line)
            and not _MEANING.search(line)
        )
        return None if fair else "I can tell how the mission stands, and nothing else."
    if _SAID.search(line):
        return "That is what somebody else says, so I change nothing."
    if _PLANNED.search(line):
        return "That is not so now, so I change nothing yet."
    if _OFTEN.search(line):
        return "That is how it often is, so I change nothing."
    if intent in (*_STATES, "obstacle_update") and _WILL_BE.search(
        _WRITE_OFF.sub(" ", _PASSABLE.sub(" ", line))
    ):
        return "That is not so yet, so I change nothing."
    wanted = re.compile(
        r"\b(nobody|no one|none)( \w+)? (wants|needs|ordered|asked for|uses) <label>"
    )
    if intent == "cancel_task" and wanted.search(line):
        line = wanted.sub(" no longer needed <label> ", line)
    if _NOBODY.search(line) or _GERUND.search(line):
        return "You say what not to do, or what it would be like, so I change nothing."
    if len(re.findall(r"<(label|robot|obstacle|point|place)>", line)) > 1 and _NOT_THIS.search(
        line
    ):
        return "One at a time, please; I change nothing yet."
    if _DEGREE.search(line):
        return "You say that it is not quite so, so I change nothing."
    if _ATTITUDE.search(line) or _TAG.search(line):
        return "You speak of it, and do not say plainly that it is so."
    if intent in ("add_task", "obstacle_update") and _WOULD_BE.search(line):
        return "That is not so now, so I change nothing yet."
    if _TAKEN_BACK.search(line) and intent not in ("undo", "pause_robot"):
        return "You take that back, so I change nothing."
    if intent != "obstacle_update" and (found := _BUT.search(line)):
        means = _EVIDENCE.get(intent)
        if means is None or not means.search(found[0]) or intent == "resume_robot":
            return "I can do only what you say before 'but'."
    return _of_one(line, intent)


def _of_one(line: str, intent: str) -> str | None:
    """What is unclear about one intent in particular."""
    if intent in _EVIDENCE:
        found = list(_EVIDENCE[intent].finditer(line))
        if not found and not _TERSE.fullmatch(line):
            return "I am not sure what is to be done."
        if intent in _STATES and all(
            _NEGATED.search(line[: one.start()].rstrip()) for one in found
        ):
            return "You say that it is not so, so I change nothing."
    match intent:
        case "undo" if re.search(
            r"^\W*(can|could|may|is|does|do|will|might) (one|i|it|anyone|everybody|people|somebody"
            r"|users?|this|that)\b|\bwhat (?!i\b|you\b|we\b|was\b|is\b|has\b)\w+ \w+",
            line,
        ):
            return "Say 'undo the last change' if that is meant."
        case "undo" if re.search(r"\bbut\b|<(?!number)\w+>", line):
            return "I undo the last change only. Say 'undo the last change' if that is meant."
        case "undo" if re.search(r"\b(status|update|progress|report|news)\b", line):
            return "Do you want to know the status?"
        case "undo" if _ALL.search(
            re.sub(r"\bmost (recent|recently)\b", "last", line)
        ) or re.search(r"\b(since|first|from|last \w+s)\b", line):
            return "I undo the last change only. Say 'undo the last change' if that is meant."
        case "cancel_task" if re.search(r"\b(everything|anything|others?|rest)\b", line):
            return "I cancel tasks by their labels only."
        case "cancel_task" if re.search(r"\b(not|no longer) (\w+ )?wait\b", line):
            return "Is it to be cancelled or to be done first?"
        case "change_task_priority" if _BITS.search(line):
            return "I know low, normal and high priority only."
        case "obstacle_update" if _TELLS_OF.search(line):
            return "Is it in the way now? Say 'there is a wall from (7, 5) to (8, 5)' if it is."
        case "pause_robot" | "resume_robot" if _REPORTS.search(line):
            return "You say what a robot does or did, so I change nothing."
        case "remove_obstacle" if _BITS.search(line):
            return "I can take an obstacle off the map, and not move it."
        case "obstacle_update" if _BIGGER.search(line):
            return "I cannot change an obstacle; remove it and add it anew."
        case "pause_robot" if _WHERE.search(line):
            return "I can stop a robot where it is now, not at a place."
        case "pause_robot" if _FOR.search(line):
            return "I can stop a robot where it is now, and not for another."
        case "robot_failed" if _PART.search(line):
            return "Is the robot itself out of service? Say 'robot1 has failed' if it is."
        case "remove_obstacle" if re.search(
            r"\b(and|then) (re)?(build|move|put|place|set|bring|install|add|draw)\w* (it|them)",
            line,
        ):
            return "One after the other: I take the obstacle off the map, or add one."
        case "add_task" if _CAME.search(line):
            return "Is that a task? Say 'new task at (5, 19.5), take it to b' if it is."
        case "robot_failed" if _SWITCHED.search(line):
            return "Is it broken? Say 'robot1 has failed' or 'pause robot1'."
        case "robot_failed" if _LESS.search(line) and not _GONE_OFF.search(line):
            return "Is it out of service? Say 'robot1 has failed' if it is."
    return None


def guarding() -> frozenset[str]:
    """Words that these gates look for, so that no slip is seen in them."""
    patterns = [one.pattern for one in globals().values() if isinstance(one, re.Pattern)]
    patterns += _SAYS.values()
    return frozenset(re.findall(r"[a-z]{3,}", re.sub(r"\\[a-z]", " ", " ".join(patterns))))
