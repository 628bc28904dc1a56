"""Adaptive Halton sampling against uniform Halton, a grid and random points."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from statistics import fmean
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from oath.bench import paper
from oath.bench.figures import plain_ticks, sheet, style
from oath.bench.shortest import exact_lengths, quality, stop_points
from oath.bench.study import Case, Row, Study
from oath.world.halton import Sampling
from oath.world.roadmap import Params, World, build

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WAYS: dict[Sampling, str] = {
    "adaptive": "adaptive Halton",
    "uniform": "uniform Halton",
    "grid": "grid",
    "random": "random (PRM)",
}
POINTS = (200, 500, 1000, 2000)
STOPS = 4
"""Stops of the route whose product with the roadmap is counted."""


def cases(quick: bool, seeds: int) -> list[Case]:
    """Every sampling, number of points and seed, with and without corner nodes."""
    return [
        Case(
            f"{sampling}-{points}-{'corners' if corners else 'plain'}-{seed}",
            {"sampling": sampling, "points": points, "corners": corners, "seed": seed},
        )
        for seed in range(seeds if quick else 4 * seeds)
        for points in POINTS
        for corners in (False, True)
        for sampling in WAYS
    ]


@cache
def reference() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The maze's stops (n, 2) [m] and the shortest lengths (n, n) [m] between them."""
    mission = paper.maze()
    world = build(mission, Params(points=10), 0, relevant=frozenset())
    stops = stop_points(mission)
    return stops, exact_lengths(mission.map, stops, world.roadmap.modes[0])


def measure(sampling: Sampling, points: int, corners: bool, seed: int) -> list[Row]:
    """Build one roadmap, look at it, then let it bridge what is apart and look again."""
    stops, exact = reference()
    params = Params(points=points, sampling=sampling, corners=corners, bridges=False)
    world = build(paper.maze(), params, seed, relevant=frozenset())
    _, before = quality(world, stops, exact)
    world.roadmap.connect({0: sorted(world.stops.values())})
    excess, after = quality(world, stops, exact)
    return [
        {
            "sampling": sampling,
            "points": points,
            "corners": corners,
            "seed": seed,
            "excess_percent": excess,
            "connected_before_percent": before,
            "connected_percent": after,
            "build_seconds": world.roadmap.seconds.total,
            **product_size(world, STOPS),
        }
    ]


def product_size(world: World, stops: int) -> Row:
    """Nodes and directed edges of the roadmap times the automaton of a route; it is never built."""
    graph, states = world.roadmap.graph, stops + 1
    open_edges = len(world.roadmap.edges(0))
    return {
        "nodes": graph.size,
        "edges": open_edges,
        "product_nodes": graph.size * states,
        "product_edges": 2 * open_edges * states + stops,
    }


def table(rows: Sequence[Row]) -> list[Row]:
    """Means over the seeds."""
    out = []
    for key, group in grouped(rows, "points", "corners", "sampling").items():
        mean = {column: fmean(row[column] for row in group) for column in _MEASURED}
        out.append(
            {
                "points": key[0],
                "corner nodes": key[1],
                "sampling": WAYS[key[2]],
                "path excess [%]": mean["excess_percent"],
                "pairs connected at first [%]": mean["connected_before_percent"],
                "bridged [%]": mean["connected_percent"],
                "product nodes": round(mean["product_nodes"]),
                "product edges": round(mean["product_edges"]),
                "build [ms]": 1e3 * mean["build_seconds"],
            }
        )
    return sorted(out, key=lambda row: (row["corner nodes"], row["points"]))


_MEASURED = (
    "excess_percent",
    "connected_before_percent",
    "connected_percent",
    "product_nodes",
    "product_edges",
    "build_seconds",
)


def grouped(rows: Sequence[Row], *columns: str) -> dict[tuple[Any, ...], list[Row]]:
    """Rows by the values of some columns, in the order they occur."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[column] for column in columns), []).append(row)
    return groups


def plot(rows: Sequence[Row]) -> Figure:
    """Excess and connectivity without corner nodes, excess with them, and build time."""
    figure, axes = sheet(2, 2)
    panels = (
        ("Without corner nodes", "mean path excess [%]", "excess_percent", False),
        ("Without corner nodes", "stop pairs connected, no bridges [%]", _BEFORE, False),
        ("With corner nodes", "mean path excess [%]", "excess_percent", True),
        ("With corner nodes", "build time [ms]", "build_seconds", True),
    )
    for one, (title, label, column, corners) in zip(axes, panels, strict=True):
        scale = 1e3 if column == "build_seconds" else 1.0
        _lines(one, [row for row in rows if row["corners"] == corners], column, scale)
        one.set(title=title, xlabel="sampled points", ylabel=label, xscale="log")
        plain_ticks(one, sorted({row["points"] for row in rows}))
        if column != _BEFORE:
            one.set_ylim(0, 1.08 * one.get_ylim()[1])
    axes[0].legend(frameon=False)
    return figure


_BEFORE = "connected_before_percent"


def _lines(axes: Axes, rows: Sequence[Row], column: str, scale: float) -> None:
    for index, (way, name) in enumerate(WAYS.items()):
        groups = grouped([row for row in rows if row["sampling"] == way], "points")
        points = sorted(groups)
        means = [scale * fmean(row[column] for row in groups[at]) for at in points]
        axes.plot([at for (at,) in points], means, label=name, **style(index))


def finding(rows: Sequence[Row]) -> str:
    """Name the best way to sample without corners, and what corners change."""
    groups = grouped(rows, "points", "corners", "sampling")

    def mean(points: int, corners: bool, way: str, column: str = "excess_percent") -> float:
        return fmean(row[column] for row in groups.get((points, corners, way), ()))

    at = 1000 if any(row["points"] == 1000 for row in rows) else rows[-1]["points"]
    ways = [way for way in WAYS if (at, False, way) in groups and (at, True, way) in groups]
    if not ways:
        return "Not enough was measured for a finding."
    excess = ", ".join(f"{WAYS[way]} {mean(at, False, way):.1f} %" for way in ways)
    few = min(row["points"] for row in rows)
    joined = ", ".join(
        f"{WAYS[way]} {mean(few, False, way, _BEFORE):.1f} %"
        for way in ways
        if (few, False, way) in groups
    )
    best = min(ways, key=lambda way: mean(at, False, way))
    with_corners = [mean(at, True, way) for way in ways]
    bridged = min(row["connected_percent"] for row in rows)
    return (
        f"At {at} points without corner nodes the mean excess over the shortest path is {excess}: "
        f"least for {WAYS[best]}. At {few} points and before any bridge, so many stop pairs are "
        f"connected: {joined}. "
        f"With corner nodes the excess is {min(with_corners):.2f} to {max(with_corners):.2f} %, "
        f"so how one samples matters {_fewer(ways, mean, at)}. After bridging, "
        f"{'all' if bridged > 99.999 else f'at least {bridged:.1f} % of the'} pairs are connected."
    )


def _fewer(ways: Sequence[str], mean: Any, at: int) -> str:
    spread = [
        max(mean(at, corners, way) for way in ways) - min(mean(at, corners, way) for way in ways)
        for corners in (False, True)
    ]
    return (
        f"{'less' if spread[1] < spread[0] else 'no less'} "
        f"(spread {spread[1]:.2f} instead of {spread[0]:.2f} percentage points)"
    )


STUDY = Study(
    name="sampling",
    title="Adaptive sampling",
    asked=(
        "Does adaptive Halton sampling give better and better connected roadmaps than uniform "
        "Halton points, a grid or the random points of a PRM, and is that so with corner nodes?"
    ),
    paper=(
        "The paper proposes adaptive Halton sampling with Delaunay edges. No published number of "
        "its path lengths or connectivity is at hand, so none is compared. Corner nodes are ours."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
    timed=True,
)
