"""How well an interpreter understands operators: the paper's instructions, and held-out wording."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from oath.bench.figures import COLOURS
from oath.bench.study import Case, Row, Study
from oath.bench.utterances import (
    PAPERS,
    Utterance,
    dialogues,
    heldout,
    instructions,
    judge,
    paper_right,
    validation,
    world,
)
from oath.commands import COMMANDS
from oath.instruct import Dialogue, Interpreter

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OFFLINE = "oath.instruct.offline:Offline"
"""The interpreter that is judged: where its class is, which is called without arguments."""

SETS: dict[str, Callable[[], list[Utterance]]] = {
    "paper": instructions,
    "held-out": heldout,
    "dialogues": lambda: dialogues("heldout-dialogues"),
    "validation": validation,
    "validation dialogues": lambda: dialogues("validation-dialogues"),
    "seen dialogues": dialogues,
}
TITLES = {
    "paper": "the paper's 90",
    "held-out": "held-out",
    "dialogues": "held-out dialogues",
    "validation": "validation",
    "validation dialogues": "validation dialogues",
    "seen dialogues": "seen dialogues",
}
MAIN = "held-out"
"""The set whose figures are published.

Nobody who improves an interpreter may look at it. The validation set is like it, but its scores
were looked at while the interpreter was written.
"""

PAPER_RIGHT = 83
"""So many of its ninety instructions the paper's language model took for the right intent."""

KINDS = ("full", "partial", "ambiguous", "none")
QUICK = 6
"""A quick study takes every so manieth utterance."""


def score(interpreter: Interpreter, said: Sequence[Utterance]) -> list[Row]:
    """Judge an interpreter's answers; one row per utterance, in their order."""
    worlds = {
        (paper, resumes): world(added=not paper, paused=resumes)
        for paper, resumes in {(one.paper, one.resumes) for one in said}
    }
    rows: list[Row] = []
    for one in said:
        verdict = judge(interpreter, one, worlds[one.paper, one.resumes])
        rows.append(
            {
                "family": one.family,
                "kind": one.kind,
                "meant": one.intent,
                "taken for": verdict.intent,
                "complete": verdict.complete,
                "proposed": verdict.proposed,
                "exact": verdict.exact,
                "wrong": verdict.wrong,
                "wrong reply": verdict.wrong_reply,
                "acted": verdict.acted,
                "told": verdict.told,
                "right": paper_right(verdict, one) if one.paper else verdict.right,
                "ms": 1e3 * max(verdict.seconds, default=0.0),
            }
        )
    return rows


def interpreter_of(name: str) -> Interpreter:
    """Make an interpreter of its class's name, ``module:Class``."""
    from importlib import import_module

    module, _, cls = name.partition(":")
    made: Interpreter = getattr(import_module(module), cls)()
    return made


def measure(name: str, interpreter: str, step: int) -> list[Row]:
    """Judge an interpreter on every `step`-th utterance of a set."""
    if name == "first call":
        loading, first = _first_call_elsewhere(interpreter)
        return [{"set": name, "ms": 1e3 * first, "loading ms": 1e3 * loading}]
    made = interpreter_of(interpreter)
    return [{"set": name, **row} for row in score(made, SETS[name]()[::step])]


def first_call(interpreter: str) -> tuple[float, float]:
    """Time making an interpreter, with all it imports, and its first interpretation [s]."""
    import time

    live = world(added=False)
    begin = time.perf_counter()
    made = interpreter_of(interpreter)
    loaded = time.perf_counter()
    made.interpret(Dialogue(said=("Make task bb urgent.",)), live)
    return loaded - begin, time.perf_counter() - loaded


def _first_call_elsewhere(interpreter: str) -> tuple[float, float]:
    code = "import sys; from oath.bench.language import first_call as f; print(*f(sys.argv[1]))"
    command = [sys.executable, "-c", code, interpreter]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    loading, first = map(float, done.stdout.split())
    return loading, first


def cases(quick: bool, seeds: int, interpreter: str = OFFLINE) -> list[Case]:
    """One case per set of utterances, and one for every new process."""
    step = QUICK if quick else 1
    tag = "-quick" if quick else ""
    sets = [
        Case(f"{name}{tag}", {"name": name, "interpreter": interpreter, "step": step})
        for name in SETS
    ]
    first = {"name": "first call", "interpreter": interpreter, "step": 1}
    return [*sets, *(Case(f"first-{i}", first) for i in range(1 if quick else seeds))]


# -- what people read


def table(rows: Sequence[Row]) -> list[Row]:
    """Shares of each set, and of the main one by kind, intent and family."""
    said = [row for row in rows if row["set"] in SETS]
    out = [_shares(TITLES[name], [row for row in said if row["set"] == name]) for name in SETS]
    main = [row for row in said if row["set"] == MAIN]
    title = TITLES[MAIN]
    papers = [row for row in main if row["meant"] in PAPERS]
    out.append(_shares(f"{title}: the paper's three intents", papers))
    for kind in KINDS:
        out.append(_shares(f"{title}: {kind}", [row for row in main if row["kind"] == kind]))
    for intent in COMMANDS:
        out.append(_shares(f"{title}: {intent}", [row for row in main if row["meant"] == intent]))
    for family in dict.fromkeys(row["family"] for row in main):
        some = [row for row in main if row["family"] == family]
        out.append(_shares(f"{title}: family {family}", some))
    return [row for row in out if row["utterances"]]


def _shares(what: str, rows: Sequence[Row]) -> Row:
    """Figures of some utterances [%]; None where there is nothing to divide by."""
    clear = [row for row in rows if row["kind"] in ("full", "partial")]
    full = [row for row in rows if row["kind"] == "full"]
    unclear = [row for row in rows if row["kind"] == "ambiguous"]
    return {
        "what": what,
        "utterances": len(rows),
        "right [%]": _percent(rows, lambda row: row["right"]),
        "intent right [%]": _percent(clear, lambda row: row["taken for"] == row["meant"]),
        "slots exact [%]": _percent(full, lambda row: row["exact"]),
        "wrong proposals [%]": _percent(rows, lambda row: row["wrong"]),
        "needless questions [%]": _percent(full, lambda row: not row["proposed"]),
        "ambiguous asked about [%]": _percent(unclear, lambda row: not row["proposed"]),
    }


def _percent(rows: Sequence[Row], true: Callable[[Row], bool]) -> float | None:
    return 100 * sum(map(true, rows)) / len(rows) if rows else None


def confusion(rows: Sequence[Row]) -> tuple[list[str], list[str], np.ndarray]:
    """What was meant (rows) against what it was taken for (columns) in the main set.

    Where an intent is clear, the reply's counts, be it a question or a proposal; where none is,
    only proposals do.

    Returns
    -------
    tuple
        Names of the rows, names of the columns, counts of shape (rows, columns).
    """
    counts: Counter[tuple[str, str]] = Counter()
    for row in rows:
        if row["set"] == MAIN:
            clear = row["kind"] in ("full", "partial")
            meant = row["meant"] if clear else {"ambiguous": "(to be asked)"}.get(row["kind"])
            taken = row["taken for"] if clear or row["proposed"] else ""
            counts[meant or "(no command)", taken or "(none)"] += 1
    meant_names = [*COMMANDS, "(to be asked)", "(no command)"]
    taken_names = [*COMMANDS, "(none)"]
    matrix = np.array([[counts[one, other] for other in taken_names] for one in meant_names])
    return meant_names, taken_names, matrix


def plot(rows: Sequence[Row]) -> Figure:
    """The confusion matrix of the held-out set, and what came of each kind."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.7, 1))
    _draw_confusion(left, rows)
    _draw_kinds(right, rows)
    return figure


def _draw_confusion(axes: Axes, rows: Sequence[Row]) -> None:
    meant, taken, counts = confusion(rows)
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (i, j), count in np.ndenumerate(counts):
        if count:
            colour = "white" if shares[i, j] > 0.5 else "black"
            axes.text(j, i, str(count), ha="center", va="center", color=colour, fontsize=9)
    axes.set_xticks(range(len(taken)), taken, rotation=40, ha="right")
    axes.set_yticks(range(len(meant)), meant)
    axes.set_xlabel("taken for (below the line: proposed)")
    axes.set_ylabel("meant")
    axes.axhline(len(COMMANDS) - 0.5, color="black", linewidth=1)
    axes.set_title(f"Intents, {TITLES[MAIN]} utterances")


OUTCOMES = (
    ("right", COLOURS[0], ""),
    ("asked or refused instead", COLOURS[5], "//"),
    ("an obstacle's kind lost", COLOURS[4], ".."),
    ("wrong proposal", COLOURS[1], "xx"),
)


def _outcome(row: Row) -> str:
    if row["wrong"]:
        return "wrong proposal"
    if row["right"]:
        return "right"
    return "an obstacle's kind lost" if row["proposed"] else "asked or refused instead"


def _draw_kinds(axes: Axes, rows: Sequence[Row]) -> None:
    said = [row for row in rows if row["set"] in SETS]
    bars = [(TITLES[name], [r for r in said if r["set"] == name]) for name in SETS]
    main = [row for row in said if row["set"] == MAIN]
    bars += [(f"{TITLES[MAIN]}: {kind}", [r for r in main if r["kind"] == kind]) for kind in KINDS]
    start = np.zeros(len(bars))
    for name, colour, hatch in OUTCOMES:
        counts = [sum(_outcome(row) == name for row in some) for _, some in bars]
        width = 100 * np.array(counts) / [max(len(some), 1) for _, some in bars]
        axes.barh(
            range(len(bars)),
            width,
            left=start,
            color=colour,
            hatch=hatch,
            edgecolor="white",
            label=name,
        )
        start += width
    axes.set_yticks(range(len(bars)), [f"{title} ({len(some)})" for title, some in bars])
    axes.invert_yaxis()
    axes.set_xlim(0, 100)
    axes.set_xlabel("utterances [%]")
    axes.set_title("What came of them")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, frameon=False)


def finding(rows: Sequence[Row]) -> str:
    """The figures that matter, of all utterances and of the published set."""
    shares = {row["what"]: row for row in table(rows)}
    said = [row for row in rows if row["set"] in SETS]
    paper = [row for row in said if row["set"] == "paper"]
    acts = [row for row in paper if row["kind"] == "full"]
    main = shares[TITLES[MAIN]]
    three = shares[f"{TITLES[MAIN]}: the paper's three intents"]
    times = [row["ms"] for row in said]
    first = [row for row in rows if row["set"] == "first call"]
    held = [row for row in said if row["set"] in (MAIN, "dialogues")]
    return (
        f"Of the paper's instructions, {sum(r['right'] for r in paper)} of {len(paper)} get the "
        f"right intent or the right question (the paper: {PAPER_RIGHT} of 90), and "
        f"{sum(r['exact'] and r['proposed'] for r in acts)} of the {len(acts)} that one can act on "
        f"an exact proposal. Of {main['utterances']} held-out utterances the intent is right in "
        f"{_shown(three['intent right [%]'])} for the paper's three intents and in "
        f"{_shown(main['intent right [%]'])} for all ten, the slots are exact in "
        f"{_shown(main['slots exact [%]'])} of what is said in full, "
        f"{_shown(main['needless questions [%]'])} of it is asked about needlessly, and "
        f"{_shown(main['ambiguous asked about [%]'])} of what is ambiguous is asked about. Of the "
        f"dialogues {_shown(shares[TITLES['dialogues']]['right [%]'])} end as they should. "
        f"({_validated(shares)}) "
        f"Wrong proposals: {sum(row['wrong'] for row in paper)} to the paper's instructions, "
        f"{sum(row['wrong'] for row in held)} to the {len(held)} held-out utterances and dialogues "
        f"({_shown(_percent(held, lambda row: row['wrong']))}; "
        f"{sum(row['wrong reply'] for row in held)} with those that the gate refuses), "
        f"{sum(row['acted'] for row in held)} of them carried out at once, as plain pauses are, "
        f"and {sum(row['told'] for row in held)} of them only told the status. An "
        f"interpretation takes {np.median(times):.2f} ms (p50) and {np.percentile(times, 95):.2f} "
        f"ms (p95), the first of a process {max(row['ms'] for row in first):.1f} ms, after "
        f"{max(row['loading ms'] for row in first):.0f} ms to load the interpreter."
    )


def _validated(shares: dict[str, Row]) -> str:
    row = shares[TITLES["validation"]]
    return (
        f"Validation set: intents {_shown(row['intent right [%]'])}, slots "
        f"{_shown(row['slots exact [%]'])}, needless questions "
        f"{_shown(row['needless questions [%]'])}, wrong {_shown(row['wrong proposals [%]'])}, "
        f"ambiguous asked about {_shown(row['ambiguous asked about [%]'])}."
    )


def _shown(percent: float | None) -> str:
    return "–" if percent is None else f"{percent:.1f} %"


STUDY = Study(
    name="language",
    title="Understanding operators",
    asked="Does the interpreter take an operator's words for what was meant, ask about what is "
    "missing or ambiguous, and never propose what was not said? The paper's ninety instructions, "
    "and utterances and dialogues in families of wording that nobody who wrote rules or training "
    "data had seen; of the validation set only the scores were seen while the interpreter was "
    "written. "
    "*Right* is: what is said in full is proposed exactly; exactly what is missing "
    "is asked for; what is ambiguous is not acted on; what is no command leads to nothing. For the "
    "paper's instructions *right* is: the intent is, and nothing but what was said is proposed; "
    "what one cannot act on in this maze leads to a question about the right intent, and to one "
    "without an intent only where the words alone do not tell it.",
    paper="A large language model takes 83 of the 90 instructions (92.2 %) for the right intent. "
    "Nothing is published about values, wrong actions or questions.",
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
    timed=True,
)
