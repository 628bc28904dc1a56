"""The interpreter that needs no network: rules for values, small trained models for the rest."""

from __future__ import annotations

from oath.commands import Live
from oath.instruct import Dialogue, Reply
from oath.instruct.offline.dialogue import follow_up
from oath.instruct.offline.heard import Heard
from oath.instruct.offline.model import Models, models
from oath.instruct.offline.names import Names, tag
from oath.instruct.offline.tokens import LONGEST
from oath.instruct.offline.understand import nothing, understand


class Offline:
    """Makes commands of words with what is shipped in the package; see `Interpreter`."""

    def __init__(self, trained: Models | None = None) -> None:
        self._trained = trained or models()

    def interpret(self, dialogue: Dialogue, live: Live) -> Reply:
        """Interpret the newest words in the light of what is open."""
        text = dialogue.said[-1] if dialogue.said else ""
        trained = self._trained
        names = Names.of(live, trained)
        heard = Heard(tuple(tag(text, names)), live, names, trained)
        if len(text) > LONGEST:
            say = f"That is too long to be an instruction; say it in {LONGEST} characters."
            return Reply(status="clarification", message=say)
        if not heard.tokens:
            return nothing(heard)
        if dialogue.draft is not None:
            return follow_up(heard, dialogue.draft)
        return understand(heard)
