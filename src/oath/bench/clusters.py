"""How many clusters: the elbow, and what the number of clusters does to the routes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np

from oath.allocate import Budget, Oath, Problem
from oath.allocate.clustering import cluster, distances
from oath.allocate.oath import Params as OathParams
from oath.bench import paper
from oath.bench.figures import plain_ticks, sheet, style
from oath.bench.sampling import grouped
from oath.bench.study import Case, Row, Study
from oath.scene import Scene, assign, pose, prepare
from oath.state import State
from oath.world.roadmap import Params

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COUNTS = (4, 5, 6, 7, 8)
ELBOW = range(1, 13)
PAPER_SETS = (9, 10, 12, 15, 18, 20, 25)


def cases(quick: bool, seeds: int) -> list[Case]:
    """The paper's task sets and random ones; each case does all K of one mission."""
    sizes = ((25, 4),) if quick else ((25, 4), (50, 4), (50, 8), (100, 8))
    found = [Case(f"maze-{n}", {"tasks": n, "robots": 4, "seed": -1}) for n in PAPER_SETS]
    return found + [
        Case(f"random-{n}-{r}-{seed}", {"tasks": n, "robots": r, "seed": seed})
        for n, r in sizes
        for seed in range(seeds if quick else 2 * seeds)
    ]


@cache
def scene(tasks: int, robots: int, seed: int) -> Scene:
    """A mission made ready; seed -1 is the paper's own task set."""
    if seed < 0:
        mission = paper.maze(paper.TASK_SETS[tasks])
    else:
        mission = paper.random_maze(tasks, robots, seed=seed)
    return prepare(mission, Params(points=2000), max(seed, 0))


def measure(tasks: int, robots: int, seed: int) -> list[Row]:
    """The spread of the clusters for every K, and the routes for some."""
    ready = scene(tasks, robots, seed)
    asked = pose(ready, State.of(ready.mission))
    all_tasks = np.arange(tasks)
    chosen = len(cluster(asked, all_tasks, elbow=True))
    rows = []
    for k in (k for k in ELBOW if k <= tasks):
        row: Row = {
            "mission": "paper" if seed < 0 else "random",
            "tasks": tasks,
            "robots": robots,
            "seed": seed,
            "K": k,
            "spread_m2": spread(asked, k),
            "elbow": chosen,
        }
        if k in COUNTS:
            row |= routes(ready, k)
        rows.append(row)
    return rows


def spread(asked: Problem, clusters: int) -> float:
    """Within-cluster sum of squares [m2]: travel distances from each task to its medoid."""
    everything = np.arange(len(asked.tasks))
    distance = distances(asked, everything)
    groups = cluster(asked, everything, clusters=clusters)
    return sum(float((distance[group.tasks, group.medoid] ** 2).sum()) for group in groups)


def routes(ready: Scene, clusters: int) -> Row:
    """Total distance [m] and makespan [s] of all rounds with this many clusters."""
    found = assign(ready, Oath(OathParams(clusters=clusters)), Budget(), 0)
    return {
        "distance_m": found.total_distance,
        "makespan_s": float(found.makespan),
        "unassigned": len(found.assignment.unassigned),
    }


def relative(rows: Sequence[Row], column: str) -> list[Row]:
    """Each row that has the column, with its value [%] over the mission's mean over all K."""
    out = []
    for group in grouped(rows, "mission", "tasks", "robots", "seed").values():
        with_value = [row for row in group if row.get(column) is not None]
        if with_value:
            mean = fmean(row[column] for row in with_value)
            out += [row | {"relative": 100.0 * (row[column] / mean - 1.0)} for row in with_value]
    return out


def table(rows: Sequence[Row]) -> list[Row]:
    """Means over the seeds, one row per kind of mission, size and K."""
    routed = [row for row in rows if row["K"] in COUNTS]
    out = []
    for key, group in grouped(routed, "mission", "tasks", "robots", "K").items():
        done = [row for row in group if row.get("distance_m") is not None]
        out.append(
            {
                "mission": key[0],
                "tasks": key[1],
                "robots": key[2],
                "K": key[3],
                "spread [m2]": fmean(row["spread_m2"] for row in group),
                "K at elbow": fmean(row["elbow"] for row in group),
                "distance [m]": fmean(row["distance_m"] for row in done),
                "makespan [s]": fmean(row["makespan_s"] for row in done),
            }
        )
    return out


def plot(rows: Sequence[Row]) -> Figure:
    """The elbow, then distance and makespan over K relative to each mission's mean."""
    figure, axes = sheet(1, 3)
    kinds = list(grouped(rows, "mission", "tasks", "robots"))
    largest = [key for key in kinds if key[0] == "random" or key[1] >= 15]
    for index, key in enumerate(largest):
        name = f"{key[0]}, {key[1]} tasks, {key[2]} robots"
        part = grouped(rows, "mission", "tasks", "robots")[key]
        one_cluster = fmean(row["spread_m2"] for row in part if row["K"] == 1)
        means = {k: fmean(r["spread_m2"] for r in g) for (k,), g in grouped(part, "K").items()}
        shares = [100.0 * mean / one_cluster for mean in means.values()]
        axes[0].plot(list(means), shares, label=name, **style(index))
        for one, column in ((axes[1], "distance_m"), (axes[2], "makespan_s")):
            by_k = grouped(relative(part, column), "K")
            mean = [fmean(row["relative"] for row in group) for group in by_k.values()]
            one.plot([k for (k,) in by_k], mean, **style(index))
    axes[0].set(ylabel="within-cluster sum of squares [% of K = 1]", xlabel="clusters K")
    axes[0].set_ylim(0, 105)
    plain_ticks(axes[0], [1, 2, 4, 6, 8, 10, 12])
    axes[0].legend(frameon=False, fontsize=8)
    for one, what in ((axes[1], "total distance"), (axes[2], "makespan")):
        one.axhline(0, color="black", linewidth=0.8)
        one.set(xlabel="clusters K", ylabel=f"{what}, over the mission's mean [%]")
        plain_ticks(one, COUNTS)
    return figure


def finding(rows: Sequence[Row]) -> str:
    """Say where the elbows lie and how much K changes the routes."""
    elbows = [group[0]["elbow"] for group in grouped(rows, "mission", "tasks", "seed").values()]
    parts = [
        f"The elbow of the merge distances lies at K = {min(elbows)} to {max(elbows)}, "
        f"{fmean(elbows):.1f} on average."
    ]
    for column, what in (("distance_m", "total distance"), ("makespan_s", "makespan")):
        over = grouped(relative(rows, column), "K")
        means = {k: fmean(row["relative"] for row in group) for (k,), group in over.items()}
        spans = [
            np.ptp([row["relative"] for row in group])
            for group in grouped(
                relative(rows, column), "mission", "tasks", "robots", "seed"
            ).values()
        ]
        best = min(means, key=lambda k: means[k])
        parts.append(
            f"On average over all missions the {what} changes by "
            f"{np.ptp(list(means.values())):.1f} percentage points from K = {min(means)} to "
            f"{max(means)} (least at K = {best}); in one mission by {fmean(spans):.1f} on average "
            f"and {max(spans):.1f} at most."
        )
    return " ".join(parts)


STUDY = Study(
    name="clusters",
    title="Number of clusters",
    asked=(
        "Where is the elbow of the within-cluster sum of squares, and how much do total distance "
        "and makespan of the paper's method depend on the number of clusters K = 4 to 8?"
    ),
    paper=(
        "The paper clusters before it auctions. No published number for its choice of K is at "
        "hand, so none is compared."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
)
