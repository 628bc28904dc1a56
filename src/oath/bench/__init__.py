"""The studies of the paper and our own, behind ``oath bench``.

A study is one file here and one row in `STUDIES`.
"""

from __future__ import annotations

from collections.abc import Callable

from oath.bench.study import Case, Row, Study, markdown, report, run_study
from oath.errors import BadInput, did_you_mean

__all__ = ["STUDIES", "Case", "Row", "Study", "markdown", "report", "run_study", "study"]


def _lazy(name: str) -> Callable[[], Study]:
    def load() -> Study:
        from importlib import import_module

        chosen: Study = import_module(f"oath.bench.{name}").STUDY
        return chosen

    return load


STUDIES: dict[str, Callable[[], Study]] = {
    name: _lazy(name)
    for name in (
        "sampling",
        "tuning",
        "clusters",
        "types",
        "selection",
        "efficiency",
        "endtoend",
        "optimality",
        "scaling",
        "automaton",
        "churn",
        "language",
        "instructions",
        "latency",
    )
}
"""Every study by its name, in the order of the report."""


def study(name: str) -> Study:
    """Return a study by its name.

    Raises
    ------
    BadInput
        Nobody has this name.
    """
    if name not in STUDIES:
        known = [*STUDIES, "all"]
        raise BadInput(f"unknown study '{name}'", remedy=did_you_mean(name, known))
    return STUDIES[name]()
