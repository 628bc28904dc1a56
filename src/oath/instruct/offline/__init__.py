"""The interpreter that needs no network: rules for values, a small trained model for the intent."""

from __future__ import annotations

from dataclasses import replace

from oath.commands import Live
from oath.instruct import Dialogue, Reply
from oath.instruct.offline.asides import without_asides
from oath.instruct.offline.dialogue import follow_up
from oath.instruct.offline.heard import Heard
from oath.instruct.offline.model import models
from oath.instruct.offline.names import Names, tag
from oath.instruct.offline.tokens import LONGEST
from oath.instruct.offline.understand import nothing, understand


class Offline:
    """Makes commands of words with what is shipped in the package; see `Interpreter`.

    A proposal is made only if all words of an instruction are accounted for; else it asks.
    """

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        """Interpret the newest words in the light of what is open."""
        text = dialogue.said[-1] if dialogue.said else ""
        trained = models()
        names = Names.of(live, trained.words)
        heard = Heard(tuple(tag(text, names)), live, names, trained)
        if len(text) > LONGEST:
            say = f"That is too long to be an instruction; say it in {LONGEST} characters."
            return Reply(status="clarification", message=say)
        if not heard.tokens:
            return nothing(heard)
        reply = _reply(heard, dialogue)
        if reply.status == "complete":
            return reply
        tokens = without_asides(heard.tokens, trained.words)
        if tokens and len(tokens) < len(heard.tokens):
            again = _reply(replace(heard, tokens=tokens), dialogue)
            if again.status == "complete" or (again.missing and not reply.missing):
                return again
        return reply


def _reply(heard: Heard, dialogue: Dialogue) -> Reply:
    if dialogue.draft is not None:
        return follow_up(heard, dialogue.draft)
    return understand(heard)
