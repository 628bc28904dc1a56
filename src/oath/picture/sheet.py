"""A sheet of paper in the making: its size, title, legend and labels.

All that depends on the room there is gets its place only when everything else is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import ceil
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oath.model import Mission, Point

DPI = 160
MAP_SIZE = 7.5
"""Length of the longer side of the map on paper [in]."""

Style = dict[str, Any]
Floats = NDArray[np.float64]
Box = tuple[float, float, float, float]


@dataclass(slots=True)
class Label:
    """A text beside a point [m]; one without a gap is written over its point if it can be."""

    text: str
    at: Point
    style: Style
    gap: float
    """Free space between the point and the text [pt]."""
    needed: bool = True


@dataclass(slots=True)
class Sheet:
    """A figure in the making: the legend and the labels are placed when all else is drawn."""

    figure: Any
    axes: Any
    bounds: tuple[float, float, float, float]
    handles: dict[str, tuple[int, Any]] = field(default_factory=dict)
    """Legend entries: text to rank and artist."""
    scale: Any = None
    """Artist that a colour bar explains, if any."""
    labels: list[Label] = field(default_factory=list)
    ink: list[Floats] = field(default_factory=list)
    """Points [m] that a label should rather not cover: walls and routes."""

    def legend(self, rank: int, text: str, handle: Any) -> None:
        """Put an entry into the legend, once for each text; lower ranks stand first."""
        # Labels that start with an underscore would be left out.
        text = _short(f" {text}" if text.startswith("_") else text, 40)
        self.handles.setdefault(text, (rank, handle))


def begin(mission: Mission) -> Sheet:
    """Return an empty sheet for a mission's map; draw on its axes in metres, then `finish` it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    x_min, y_min, x_max, y_max = mission.map.bounds
    margin = max(0.015 * max(x_max - x_min, y_max - y_min), mission.map.wall_thickness / 2)
    bounds = (x_min - margin, y_min - margin, x_max + margin, y_max + margin)
    axes.set(xlim=bounds[::2], ylim=bounds[1::2], aspect="equal")
    return Sheet(figure=figure, axes=axes, bounds=bounds)


def finish(sheet: Sheet, title: tuple[str, str], path: str | PathLike[str]) -> None:
    """Give the sheet its size, place what depends on it (title, legend, labels), write it."""
    x_min, y_min, x_max, y_max = sheet.bounds
    scale = MAP_SIZE / max(x_max - x_min, y_max - y_min)
    wide, high = max((x_max - x_min) * scale, 2.0), max((y_max - y_min) * scale, 2.0)
    columns = max(1, ceil(len(sheet.handles) * 0.215 / max(high, 3.5)))
    legend = columns * (0.75 + 0.072 * max((len(text) for text in sheet.handles), default=0))
    legend = max(legend, 2.2 if sheet.scale is not None else 0.0)
    left, bottom, top = 0.95, 0.65, 0.75
    width = max(left + wide + 0.2 + legend, left + 0.1 * max(map(len, title)))
    height = bottom + max(high, 0.215 * ceil(len(sheet.handles) / columns)) + top
    sheet.figure.set_size_inches(width, height)
    box = (left / width, (height - top - high) / height, wide / width, high / height)
    _draw_axes(sheet, box)
    for text, drop, weight in zip(title, (0.22, 0.48), ("bold", "normal"), strict=True):
        place = left / width, 1 - drop / height
        sheet.figure.text(*place, text, fontsize=12, weight=weight, va="center", parse_math=False)
    right = (left + wide + 0.1) / width
    _draw_legend(sheet, (right, 1 - top / height), columns)
    if sheet.scale is not None:
        _draw_bar(sheet, (right + 0.1 / width, bottom / height, 1.8 / width, 0.12 / height))
    _place_labels(sheet)
    sheet.figure.savefig(path, format="png", dpi=DPI, metadata={"Software": None})


def _draw_axes(sheet: Sheet, box: Box) -> None:
    sheet.axes.set_position(box)
    sheet.axes.set_xlabel("x [m]", fontsize=11)
    sheet.axes.set_ylabel("y [m]", fontsize=11)
    sheet.axes.locator_params(steps=[1, 2, 5, 10])
    sheet.axes.tick_params(labelsize=10)
    sheet.axes.spines[:].set_visible(False)


def _draw_bar(sheet: Sheet, box: Box) -> None:
    bar = sheet.figure.add_axes(box)
    sheet.figure.colorbar(sheet.scale, cax=bar, orientation="horizontal")
    bar.set_title("clearance [m]", fontsize=9.5, loc="left")
    bar.tick_params(labelsize=9)


def _draw_legend(sheet: Sheet, corner: Point, columns: int) -> None:
    entries = sorted(sheet.handles.items(), key=lambda entry: entry[1][0])
    if not entries:
        return
    box = sheet.figure.legend(
        [handle for _, (_, handle) in entries],
        [text for text, _ in entries],
        ncols=columns,
        loc="upper left",
        bbox_to_anchor=corner,
        frameon=False,
        fontsize=9.5,
        borderaxespad=0,
        handlelength=2.8,
        labelspacing=0.45,
        columnspacing=1.2,
    )
    for entry in box.get_texts():
        entry.set_parse_math(False)


COVERS_LABEL = 1000.0
"""Price of a spot for a label that is on another one or on another's point."""


def _short(text: str, limit: int = 40) -> str:
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


def _place_labels(sheet: Sheet) -> None:
    """Put each label where it hides least: on no other label, and on few walls and routes.

    Labels that are not needed are left out where there is no room.
    """
    if not sheet.labels:
        return
    renderer = sheet.figure.canvas.get_renderer()
    # The axes take their final shape only when drawn.
    sheet.axes.apply_aspect()
    to_page = sheet.axes.transData.transform
    ink = to_page(np.concatenate([np.empty((0, 2)), *sheet.ink]))
    frame = sheet.axes.get_window_extent(renderer)
    anchors = to_page(np.array([label.at for label in sheet.labels]))
    taken = [(x - 11, y - 11, x + 11, y + 11) for x, y in anchors]
    for label, (x, y), own in sorted(
        zip(sheet.labels, anchors, [*taken], strict=True), key=lambda one: not one[0].needed
    ):
        text = _write(sheet, label)
        size = text.get_window_extent(renderer)
        others = [box for box in taken if box != own]
        spots = []
        for rank, (dx, dy) in enumerate(_spots(label.gap * DPI / 72, size.width, size.height)):
            box = (x + dx, y + dy, x + dx + size.width, y + dy + size.height)
            spots.append((_cost(box, others, ink, frame) + 0.2 * rank, box))
        cost, box = min(spots)
        if cost >= COVERS_LABEL and not label.needed:
            text.remove()
            continue
        text.set_position(box[:2])
        taken.append(box)


def _write(sheet: Sheet, label: Label) -> Any:
    from matplotlib.patheffects import withStroke

    return sheet.axes.text(
        0,
        0,
        _short(label.text, 16),
        va="bottom",
        zorder=12,
        parse_math=False,
        transform=None,
        path_effects=[withStroke(linewidth=2.2, foreground="white")],
        **{"fontsize": 9.5, **label.style},
    )


def _spots(gap: float, width: float, height: float) -> Iterator[tuple[float, float]]:
    """Yield where the lower left corner of a text may lie, relative to its point [px]."""
    if gap == 0:
        yield -width / 2, -height / 2
        gap = 4.0
    for reach in (gap, 2 * gap):
        right, left, up, down = reach, -reach - width, reach, -reach - height
        yield from [(right, -height / 2), (-width / 2, up), (left, -height / 2), (-width / 2, down)]
        slant = 0.6
        for dx in (right - reach * (1 - slant), left + reach * (1 - slant)):
            for dy in (up - reach * (1 - slant), down + reach * (1 - slant)):
                yield dx, dy


def _cost(box: Box, taken: Sequence[Box], ink: Floats, frame: Any) -> float:
    x0, y0, x1, y1 = box
    cost = 0.0
    for a0, b0, a1, b1 in taken:
        if x0 < a1 and a0 < x1 and y0 < b1 and b0 < y1:
            cost += COVERS_LABEL
    if x0 < frame.x0 or y0 < frame.y0 or x1 > frame.x1 or y1 > frame.y1:
        cost += 300.0
    inside = (ink[:, 0] > x0) & (ink[:, 0] < x1) & (ink[:, 1] > y0) & (ink[:, 1] < y1)
    return cost + float(inside.sum())
