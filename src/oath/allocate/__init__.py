"""Who does what, in which order.

`Problem` is what is asked, `Allocator` who answers, `checked` asks and checks the answer. The
paper's three stages are `clustering`, `auction` and `selection`; `Oath` puts them together.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from oath.allocate.cbba import Cbba
from oath.allocate.contract import Allocator, Budget, checked, reasons
from oath.allocate.exact import Exact
from oath.allocate.greedy import Greedy
from oath.allocate.kam import Kam
from oath.allocate.kan import Kan
from oath.allocate.lns import Lns
from oath.allocate.oath import Oath
from oath.allocate.priority import ByPriority
from oath.allocate.problem import WAITING, Problem
from oath.allocate.rounds import follow, plan_all, urgent
from oath.errors import BadInput, did_you_mean

__all__ = [
    "ALLOCATORS",
    "WAITING",
    "Allocator",
    "Budget",
    "ByPriority",
    "Cbba",
    "Exact",
    "Greedy",
    "Kam",
    "Kan",
    "Lns",
    "Oath",
    "Problem",
    "allocator",
    "checked",
    "follow",
    "plan_all",
    "reasons",
    "urgent",
]

ALLOCATORS: dict[str, Callable[[], Allocator]] = {
    "lns": Lns,
    "exact": Exact,
    "oath": Oath,
    "kam": Kam,
    "kan": Kan,
    "cbba": Cbba,
    "greedy": Greedy,
}
"""Every allocator by its name, with its default parameters."""


def allocator(name: str, *, makespan_weight: float | None = None) -> Allocator:
    """Return a new allocator by its name.

    Parameters
    ----------
    makespan_weight
        Weight of the makespan in what it minimises [m/s]; None = its default.

    Raises
    ------
    BadInput
        Nobody has this name, a weight for an allocator that weighs nothing, or a negative one.

    Examples
    --------
    >>> allocator("oath")
    Oath(params=Params(clusters=None, elbow=False, theta=1.0, linkage='average', method='dp'))
    >>> allocator("oaht")
    Traceback (most recent call last):
    oath.errors.BadInput: unknown allocator 'oaht'; did you mean 'oath'?
    """
    if name not in ALLOCATORS:
        raise BadInput(f"unknown allocator '{name}'", remedy=did_you_mean(name, list(ALLOCATORS)))
    chosen = ALLOCATORS[name]()
    if makespan_weight is None:
        return chosen
    if not 0 <= makespan_weight < math.inf:
        raise BadInput(f"makespan weight {makespan_weight:g} is not a finite number from 0 up")
    if isinstance(chosen, Exact):
        return Exact(replace(chosen.params, makespan_weight=makespan_weight))
    if isinstance(chosen, Lns):
        return Lns(replace(chosen.params, makespan_weight=makespan_weight))
    raise BadInput(
        f"allocator '{name}' has no makespan weight", remedy="use 'lns' or 'exact', or drop it"
    )
