"""What a study is, and how one is run: resumable, on all cores, with a table, a CSV and a plot."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = dict[str, Any]
"""One measurement: plain values by column."""


@dataclass(frozen=True, slots=True)
class Case:
    """One independent piece of a study's work, picklable; `key` names it for good."""

    key: str
    arguments: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A question, how it is answered, and what the paper says of it.

    Attributes
    ----------
    name, title
        For the command line and the report.
    asked, paper
        The question, and what the paper published (or that it did not), in Markdown.
    cases
        (quick, seeds) to the cases; a quick study is a sketch of the same, in about a minute.
    measure
        A case's arguments to its rows. A module-level function, so that processes can call it.
    table
        All rows to the rows of the table that people read.
    plot
        All rows to a figure like the paper's.
    finding
        All rows to what came out, in a few sentences.
    timed
        Wall clock is measured, so cases run one at a time.
    """

    name: str
    title: str
    asked: str
    paper: str
    cases: Callable[[bool, int], Sequence[Case]]
    measure: Callable[..., list[Row]]
    table: Callable[[Sequence[Row]], list[Row]]
    plot: Callable[[Sequence[Row]], Figure]
    finding: Callable[[Sequence[Row]], str]
    timed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a study left: its table, its finding, and its files."""

    study: Study
    table: list[Row]
    finding: str
    csv: Path
    png: Path


def run_study(
    study: Study,
    out: Path,
    *,
    quick: bool = False,
    seeds: int = 5,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> Outcome:
    """Run what is left of a study; write its CSV and plot into `out`.

    Every finished case is kept in ``NAME.jsonl`` at once, so an interrupted study goes on where it
    stopped. Cases are told apart by their keys; delete the file to measure anew.
    """
    out.mkdir(parents=True, exist_ok=True)
    cases = study.cases(quick, seeds)
    journal = out / f"{study.name}.jsonl"
    done = _read(journal)
    left = [case for case in cases if case.key not in done]
    on_progress(len(cases) - len(left), len(cases))
    with journal.open("a", encoding="utf-8") as file:
        for case, rows in _measure(study, left):
            done[case.key] = rows
            file.write(json.dumps({"case": case.key, "rows": rows}) + "\n")
            file.flush()
            on_progress(sum(case.key in done for case in cases), len(cases))
    rows = [row for case in cases for row in done[case.key]]
    return _write(study, rows, out)


def _measure(study: Study, cases: Sequence[Case]) -> Iterable[tuple[Case, list[Row]]]:
    cores = os.cpu_count() or 1
    if study.timed or cores == 1 or len(cases) < 2:
        for case in cases:
            yield case, study.measure(**case.arguments)
        return
    with ProcessPoolExecutor(max_workers=cores) as pool:
        futures = {pool.submit(study.measure, **case.arguments): case for case in cases}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _read(journal: Path) -> dict[str, list[Row]]:
    """Rows by case; a last line that was cut off is as good as missing."""
    done: dict[str, list[Row]] = {}
    if not journal.exists():
        return done
    whole = []
    for line in journal.read_text(encoding="utf-8").splitlines():
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        whole.append(line)
        done[entry["case"]] = entry["rows"]
    journal.write_text("".join(line + "\n" for line in whole), encoding="utf-8")
    return done


def _write(study: Study, rows: Sequence[Row], out: Path) -> Outcome:
    table = study.table(rows)
    path, png = out / f"{study.name}.csv", out / f"{study.name}.png"
    columns = list(dict.fromkeys(column for row in rows for column in row))
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    study.plot(rows).savefig(png, dpi=150, metadata={"Software": None})
    return Outcome(study=study, table=table, finding=study.finding(rows), csv=path, png=png)


def shown(value: object) -> str:
    """A table cell: numbers with as many digits as one reads."""
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "–"}[value]
    if isinstance(value, float):
        if value != value:
            return "–"
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}"
    return str(value)


def markdown(table: Sequence[Row]) -> str:
    """A table in Markdown."""
    columns = list(dict.fromkeys(column for row in table for column in row))
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    for row in table:
        lines.append("| " + " | ".join(shown(row.get(column)) for column in columns) + " |")
    return "\n".join(lines)


def report(outcomes: Sequence[Outcome], path: Path, *, command: str) -> None:
    """Write one report that a person can read top to bottom, with the plots beside it."""
    parts = [f"# The studies of OATH\n\nAll of it again: `{command}`."]
    for outcome in outcomes:
        study = outcome.study
        parts.append(
            f"## {study.title}\n\n**Asked.** {study.asked}\n\n**The paper.** {study.paper}\n\n"
            f"**Here.** {outcome.finding}\n\n{markdown(outcome.table)}\n\n"
            f"![{study.title}]({outcome.png.name})\n\nRows: `{outcome.csv.name}`. "
            f"Again: `oath bench {study.name}`."
        )
    draft = path.with_name(path.name + ".part")
    draft.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    draft.replace(path)
