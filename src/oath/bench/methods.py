"""What the studies of allocators share: methods and how they are drawn, problems, and figures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import TYPE_CHECKING, Any

from oath.allocate import ALLOCATORS, Problem, follow
from oath.bench.study import Row
from oath.model import Assignment, Mission
from oath.scene import pose, prepare
from oath.state import State
from oath.world.roadmap import Params

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OURS = "lns"
"""The method that the studies' claims are about."""

POINTS = 2000
"""Sampled points of the roadmap of an allocation study."""


@dataclass(frozen=True, slots=True)
class Look:
    """How a method is named and drawn: it can be told apart by colour and by marker."""

    label: str
    colour: str
    marker: str


LOOKS: dict[str, Look] = {
    "cbba": Look("CBBA", "#E69F00", "s"),
    "kan": Look("KAN", "#56B4E9", "^"),
    "kam": Look("KAM", "#009E73", "D"),
    "oath": Look("OATH", "#0072B2", "o"),
    "lns": Look("LNS", "#D55E00", "*"),
    "exact": Look("exact", "#CC79A7", "X"),
}
"""Okabe and Ito's palette, safe for the colour-blind."""

INK = "#1A1A1A"


def available(*names: str) -> list[str]:
    """Those of the names that an allocator has."""
    return [name for name in names if name in ALLOCATORS]


def posed(mission: Mission, *, seed: int, points: int = POINTS) -> Problem:
    """The allocation problem of a mission's start, with costs along a roadmap of this seed."""
    return pose(prepare(mission, Params(points=points), seed), State.of(mission))


def figures(problem: Problem, assignment: Assignment) -> tuple[float, float]:
    """Sum of all lengths [m], and the makespan [s] with the times at the stops."""
    lengths, times = [0.0], [0.0]
    for r, robot in enumerate(problem.robots):
        length, service, _ = follow(problem, r, assignment.routes[robot])
        lengths.append(length)
        times.append(length / float(problem.speed[r]) + service)
    return sum(lengths), max(times)


def grouped(rows: Iterable[Row], key: Callable[[Row], Hashable]) -> dict[Any, list[Row]]:
    """Rows by key, in the order in which the keys first appear."""
    groups: dict[Any, list[Row]] = defaultdict(list)
    for row in rows:
        groups[key(row)].append(row)
    return dict(groups)


def mean(rows: Sequence[Row], column: str) -> float:
    """Mean of a column over the rows that have it; nan without any."""
    values = [float(row[column]) for row in rows if row.get(column) is not None]
    return fmean(values) if values else float("nan")


def present(rows: Sequence[Row]) -> list[str]:
    """The methods in the rows, in the order of `LOOKS`."""
    found = dict.fromkeys(row["method"] for row in rows)
    return [name for name in LOOKS if name in found]


def listed(words: Sequence[str]) -> str:
    """``a, b and c``.

    Examples
    --------
    >>> listed(["a", "b", "c"]), listed(["a"]), listed([])
    ('a, b and c', 'a', 'none')
    """
    if len(words) < 2:
        return words[0] if words else "none"
    return ", ".join(words[:-1]) + " and " + words[-1]


def sheet(width: float, height: float) -> Figure:
    """An empty figure [inches] that belongs to nobody but its caller."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def tidy(axes: Any, x: str, y: str, title: str = "") -> None:
    """Label axes, with a faint horizontal grid and no box around them."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, fontsize=11)
    axes.grid(axis="y", color="#DDDDDD", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
