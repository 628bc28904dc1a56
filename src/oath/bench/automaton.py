"""The product of automaton and roadmap: how large it would be, and how long plans take."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from oath import _core
from oath.bench import paper
from oath.bench.figures import plain_ticks, sheet, style
from oath.bench.sampling import grouped, product_size
from oath.bench.study import Case, Row, Study
from oath.motion.buchi import translate
from oath.motion.mission_automaton import compile_rules, formula, sequence
from oath.motion.planner import Planner, Service
from oath.world.roadmap import Params, World, build

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = (200, 500, 1000, 2000, 5000)
STOPS = (2, 4, 8, 12, 16)
POINTS_FOR_STOPS, STOPS_FOR_POINTS = 1000, 8
CHANGED = 30
"""Edges that a repair has to get around."""


def cases(quick: bool, seeds: int) -> list[Case]:
    """Points at one number of stops, and stops at one number of points."""
    settings = [(points, STOPS_FOR_POINTS) for points in POINTS]
    settings += [(POINTS_FOR_STOPS, stops) for stops in STOPS if stops != STOPS_FOR_POINTS]
    repeats = 5 if quick else 25
    return [
        Case(
            f"{points}-{stops}-{repeats}-{seed}",
            {"points": points, "stops": stops, "seed": seed, "repeats": repeats},
        )
        for seed in range(min(seeds, 3) if quick else 2 * seeds)
        for points, stops in settings
    ]


def measure(points: int, stops: int, seed: int, repeats: int) -> list[Row]:
    """Times for one route through the maze, medians of some repeats."""
    mission = paper.maze()
    world = build(mission, Params(points=points), seed, relevant=frozenset())
    route = _route(stops, seed)
    names = [service.own for service in route]
    wanted = formula(names)
    automaton, general = sequence(names), translate(wanted)
    start = mission.robots[0].start
    planner = Planner(world.roadmap, compile_rules((), ()), 0, start)
    return [
        {
            "points": points,
            "stops": stops,
            "seed": seed,
            "states": automaton.states,
            "general_states": general.states,
            **product_size(world, stops),
            "direct_seconds": _median(lambda: sequence(names), repeats),
            "general_seconds": _median(lambda: translate(wanted), repeats),
            "plan_seconds": _median(lambda: planner.begin(start, route), repeats),
            "repair_seconds": _repair(world, planner, route, repeats),
        }
    ]


def _route(stops: int, seed: int) -> list[Service]:
    """Deliveries of the paper's tasks, one after another, in random order."""
    order = np.random.default_rng([seed, stops]).permutation(len(paper.PICKUPS))
    tasks = [list(paper.PICKUPS)[i] for i in order[: (stops + 1) // 2]]
    points = [
        (f"{task}@{name}", at)
        for task in tasks
        for name, at in (("pickup", paper.PICKUPS[task]), ("delivery", paper.DELIVERIES[task[-1]]))
    ]
    return [Service(at=at, own=name) for name, at in points[:stops]]


def _repair(world: World, planner: Planner, route: Sequence[Service], repeats: int) -> float:
    """Median time to plan around blocked edges half way to a stop, and to notice them gone [s]."""
    graph, start = world.roadmap.graph, planner.position
    plan = planner.begin(start, route)
    middle = world.roadmap.nodes()[graph.ends()].mean(axis=1)
    times = []
    for repeat in range(repeats):
        leg = plan.legs[repeat % len(plan.legs)]
        away = np.hypot(*(middle - leg[len(leg) // 2]).T)
        edges = np.argsort(away)[:CHANGED].astype(np.int32)
        costs = graph.costs(0)[edges]
        for now in (np.full(CHANGED, _core.UNREACHABLE), costs):
            graph.set_costs(0, edges, now)
            begin = time.perf_counter()
            planner.update(edges)
            planner.replan(start)
            times.append(time.perf_counter() - begin)
    return median(times)


def _median(call: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return median(times)


TIMES = {
    "direct_seconds": "automaton, direct",
    "general_seconds": "automaton, translated",
    "plan_seconds": "first plan",
    "repair_seconds": "repair",
}


def table(rows: Sequence[Row]) -> list[Row]:
    """Medians over the seeds."""
    out = []
    for (points, stops), group in sorted(grouped(rows, "points", "stops").items()):
        row: Row = {
            "points": points,
            "stops": stops,
            "states": group[0]["states"],
            "product nodes": round(median(one["product_nodes"] for one in group)),
            "product edges": round(median(one["product_edges"] for one in group)),
        }
        for column, name in TIMES.items():
            row[f"{name} [ms]"] = 1e3 * median(one[column] for one in group)
        out.append(row)
    return out


def plot(rows: Sequence[Row]) -> Figure:
    """Size and times against the points, and against the stops."""
    figure, axes = sheet(2, 2)
    by_points = grouped([row for row in rows if row["stops"] == STOPS_FOR_POINTS], "points")
    by_stops = grouped([row for row in rows if row["points"] == POINTS_FOR_STOPS], "stops")
    columns = (
        (by_points, "sampled points", f"Routes of {STOPS_FOR_POINTS} stops"),
        (by_stops, "stops of the route", f"{POINTS_FOR_STOPS} sampled points"),
    )
    for column, (groups, label, title) in enumerate(columns):
        at = sorted(groups)
        x = [value for (value,) in at]
        size, times = axes[column], axes[2 + column]
        for index, (what, name) in enumerate(
            (("product_nodes", "nodes x states"), ("product_edges", "directed edges"))
        ):
            size.plot(
                x, [median(r[what] for r in groups[k]) for k in at], label=name, **style(index)
            )
        for index, (what, name) in enumerate(TIMES.items()):
            y = [1e3 * median(r[what] for r in groups[k]) for k in at]
            times.plot(x, y, label=name, **style(index))
        size.set(title=title, ylabel="product, never built")
        times.set(xlabel=label, ylabel="time [ms]")
        for one in (size, times):
            one.set_yscale("log")
            if column == 0:
                one.set_xscale("log")
            plain_ticks(one, x)
    axes[0].legend(frameon=False)
    handles, labels = axes[2].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def finding(rows: Sequence[Row]) -> str:
    """Say how large the product is, what planning takes, and what direct construction saves."""
    faster = [row["general_seconds"] / row["direct_seconds"] for row in rows]
    largest = max(rows, key=lambda row: row["product_nodes"])
    quicker = [row["plan_seconds"] / row["repair_seconds"] for row in rows]
    same = all(row["states"] == row["general_states"] for row in rows)
    return (
        f"The largest product has {largest['product_nodes']} nodes and {largest['product_edges']} "
        f"edges ({largest['points']} points, {largest['stops']} stops). It is never built: its "
        f"first plan took {1e3 * largest['plan_seconds']:.2f} ms and a repair "
        f"{1e3 * largest['repair_seconds']:.2f} ms; over all routes the highest are "
        f"{1e3 * max(row['plan_seconds'] for row in rows):.2f} ms and "
        f"{1e3 * max(row['repair_seconds'] for row in rows):.2f} ms, and a repair is "
        f"{median(quicker):.1f} times as fast as a first plan in the median. Building the "
        f"automaton of a route directly takes {1e3 * median(r['direct_seconds'] for r in rows):.3f}"
        f" ms, {median(faster):.0f} times less than the general translation of its formula, which "
        f"gives {'as many' if same else 'another number of'} states."
    )


STUDY = Study(
    name="automaton",
    title="Automaton and product",
    asked=(
        "How large is the product of roadmap and automaton, and how long do automaton, first plan "
        f"and repair (of {CHANGED} changed edges) take, for 200 to 5000 points and for routes of "
        "2 to 16 stops? What does the direct construction of a route's automaton save?"
    ),
    paper=(
        "The paper plans on the product of an automaton of the task sequence and the roadmap. No "
        "published size or time of it is at hand, so none is compared."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
    timed=True,
)
