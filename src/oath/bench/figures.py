"""How the figures of the studies look: colours that all can tell apart, and never colour alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
"""Okabe and Ito, "Color universal design", 2008."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
LINES = ("-", "--", "-.", ":")


def sheet(
    rows: int, columns: int, *, width: float = 4.6, height: float = 3.6
) -> tuple[Figure, list[Axes]]:
    """Return a new figure and its axes, row by row; sizes of one axes in inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for one in axes:
        one.grid(True, color="#dddddd", linewidth=0.6)
        one.set_axisbelow(True)
        one.spines[["top", "right"]].set_visible(False)
    return figure, axes


def style(index: int, line: int | None = None) -> dict[str, Any]:
    """Colour, marker and line style number `index`, or another line style."""
    return {
        "color": COLOURS[index % len(COLOURS)],
        "marker": MARKERS[index % len(MARKERS)],
        "linestyle": LINES[(index if line is None else line) % len(LINES)],
        "markersize": 5.0,
        "linewidth": 1.5,
    }


def plain_ticks(axes: Axes, values: Sequence[float], *, axis: str = "x") -> None:
    """Label an axis at these values, as plain numbers even where it is logarithmic."""
    one = axes.xaxis if axis == "x" else axes.yaxis
    one.set_major_locator(_fixed(values))
    one.set_minor_locator(_fixed([]))
    one.set_major_formatter(lambda value, _: f"{value:g}")


def _fixed(values: Iterable[float]) -> Any:
    from matplotlib.ticker import FixedLocator

    return FixedLocator(list(values))
