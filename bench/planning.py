"""How long it takes to compile a route, to plan it, and to repair the plan, on the maze.

Run with ``python bench/planning.py [--quick]``. A repair is timed as a robot sees it: from the list
of changed edges to the new waypoints. The reference in the same run is the explicit product of
roadmap and automaton, built with numpy and searched with scipy's compiled Dijkstra.
"""

from __future__ import annotations

import argparse
import resource
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from oath import _core
from oath.formats.mission import load
from oath.model import Mission
from oath.motion.mission_automaton import RouteAutomaton, compile_rules, sequence
from oath.motion.planner import Planner, Service
from oath.world.roadmap import Params, Roadmap, World, build

MAZE = Path(__file__).parent.parent / "missions" / "maze-25.yaml"
TASKS = (5, 13, 18, 8)
"""Four deliveries all over the maze, done one after another."""


def table(what: str, measured: str, figure: str) -> None:
    """Print one row."""
    print(f"{what:58} {measured:>26} {figure:>12}")


def seconds(call: Callable[[], object], repeats: int) -> list[float]:
    """Time a call some times."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return times


def route(mission: Mission, tasks: tuple[int, ...] = TASKS) -> list[Service]:
    """The stops of some tasks in order."""
    return [
        Service(at=stop.at, own=f"{mission.tasks[i].id}@{stop.name}")
        for i in tasks
        for stop in mission.tasks[i].stops
    ]


def world_of(mission: Mission, params: Params) -> World:
    """One mode is enough: all robots of the maze are alike."""
    return build(replace(mission, robots=mission.robots[:1]), params, 0, relevant=frozenset())


def compile_time(repeats: int) -> None:
    """Ten tasks in sequence, with three zones to avoid, to an automaton."""
    stops, zones = [f"t{i}" for i in range(10)], ["lab", "pit", "stairs"]
    times = seconds(lambda: sequence(stops, zones), repeats)
    table("sequence of 10 tasks with avoidance to automaton", ms(median(times)), "< 1 ms")


def ms(*times: float) -> str:
    """Print times in milliseconds."""
    return " / ".join(f"{time * 1e3:.3g}" for time in times) + " ms"


# --- Changes


def around(roadmap: Roadmap, way: np.ndarray, share: float, count: int) -> np.ndarray:
    """Edges nearest to the point that lies at a share of the way's length."""
    steps = np.hypot(*np.diff(way, axis=0).T)
    k = int(np.searchsorted(np.cumsum(steps), share * steps.sum()))
    at = (way[k] + way[min(k + 1, len(way) - 1)]) / 2
    middle = roadmap.nodes()[roadmap.graph.ends()].mean(axis=1)
    away = np.hypot(*(middle - at).T)
    return np.argpartition(away, count)[:count].astype(np.int32)


def changes(
    roadmap: Roadmap, planner: Planner, where: str, rounds: int, rng: np.random.Generator
) -> Iterator[tuple[str, np.ndarray]]:
    """Block up to 50 open edges and open them again, many times; yield what to repair after."""
    graph = roadmap.graph
    for _ in range(rounds):
        count = int(rng.integers(1, 51))
        if where == "anywhere":
            edges = rng.choice(graph.edges, count, replace=False).astype(np.int32)
        else:
            legs = [leg for leg in planner._plan.legs if len(leg) > 1]
            if where == "all along the route":
                way, share = legs[rng.integers(len(legs))], rng.uniform(0.0, 1.0)
            else:
                # The current leg: the robot is at its start, its stop is at its end.
                share = {"near the robot": 0.08, "half way": 0.5, "near the stop": 0.92}[where]
                way, share = legs[0], share + rng.uniform(-0.05, 0.05)
            edges = around(roadmap, way, share, count)
        costs = graph.costs(0)[edges]
        graph.set_costs(0, edges, np.full(count, _core.UNREACHABLE))
        yield "block", edges
        graph.set_costs(0, edges, costs)
        yield "open", edges


PLACES = ("anywhere", "near the robot", "half way", "near the stop", "all along the route")


def repairs(mission: Mission, params: Params, rounds: int, figures: tuple[str, str]) -> None:
    """First plans, then repairs after changes in different places."""
    world = world_of(mission, params)
    roadmap, start = world.roadmap, mission.robots[0].start
    rules, stops = compile_rules((), ()), route(mission)
    about = f"{roadmap.graph.size} nodes{'' if params.corners else ', no corners'}"
    planner = Planner(roadmap, rules, 0, start)
    times = seconds(lambda: planner.begin(start, stops), 3 if params.points > 10_000 else 21)
    table(f"first plan, 4 tasks, {about}", ms(median(times)), figures[0])
    rng = np.random.default_rng(5)
    every: list[float] = []
    for where in PLACES:
        planner.begin(start, stops)
        took, scratch = [], []
        for k, (_, edges) in enumerate(changes(roadmap, planner, where, rounds, rng)):
            begin = perf_counter()
            planner.update(edges)
            plan = planner.replan(start)
            took.append(perf_counter() - begin)
            if k % max(1, rounds // 10) == 0:  # the same question, answered from scratch
                other = Planner(roadmap, rules, 0, start)
                begin = perf_counter()
                fresh = other.begin(start, stops)
                scratch.append(perf_counter() - begin)
                assert fresh.blocked == plan.blocked
                assert plan.blocked is not None or abs(fresh.length - plan.length) < 1e-3
        every += took
        table(
            f"  repair, <= 50 edges {where}: p50 / p99 / max",
            ms(*np.percentile(took, [50, 99, 100])),
            f"{median(scratch) / median(took):.1f} x new",
        )
    table(
        f"repair, {about}, all places: p50 / p99 / max",
        ms(*np.percentile(every, [50, 99, 100])),
        figures[1],
    )


# --- Against the explicit product


class Explicit:
    """The product of a roadmap and a chain automaton as one sparse matrix."""

    def __init__(self, roadmap: Roadmap, targets: list[int]) -> None:
        ends, costs = roadmap.graph.ends(), roadmap.graph.costs(0)
        is_open = costs < _core.UNREACHABLE
        (a, b), c = ends[is_open].T, costs[is_open]
        n, states = roadmap.graph.size, len(targets) + 1
        shift = np.arange(states)[:, None] * n
        source = np.concatenate([(a + shift).ravel(), (b + shift).ravel()])
        target = np.concatenate([(b + shift).ravel(), (a + shift).ravel()])
        weight = np.concatenate([np.tile(c, 2 * states).astype(float), np.ones(len(targets))])
        served = np.arange(len(targets)) * n + np.array(targets)
        both = np.concatenate([source, served]), np.concatenate([target, served + n])
        self.matrix = csr_array((weight, both), shape=(n * states, n * states))
        self.goal = n * len(targets) + targets[-1]

    def cost(self, start: int) -> float:
        """Search it; each service costs 1 um, for a sparse matrix has no arcs of cost 0."""
        return float(dijkstra(self.matrix, indices=start)[self.goal])


def explicit(mission: Mission, repeats: int) -> None:
    """Time build and search of both products for a route of four stops, five automaton states."""
    world = world_of(mission, Params(points=1000))
    roadmap, start = world.roadmap, mission.robots[0].start
    stops = route(mission, TASKS[:2])
    targets = [world.stops[stop.at] for stop in stops]
    first = world.stops[start]
    rules = compile_rules((), ())
    planner = Planner(roadmap, rules, 0, start)
    links, classes = roadmap.links(start, 0), roadmap.zones.classes

    def layered() -> int:
        """What the explicit product is compared with: tables, search, the way's cost."""
        automaton = RouteAutomaton(rules, [(stop.own, stop.letter) for stop in stops])
        core = _core.Planner(
            roadmap.graph, 0, automaton.drive(classes), targets, automaton.serve(),
            automaton.settled(frozenset()),
        )  # fmt: skip
        core.start(0, *start, *links, [1])
        return core.plan()

    alone = seconds(layered, repeats)
    begin_all = seconds(lambda: planner.begin(start, stops), repeats)
    building = seconds(lambda: Explicit(roadmap, targets), repeats)
    product = Explicit(roadmap, targets)
    searching = seconds(lambda: product.cost(first), repeats)
    expected = product.cost(first)
    core = planner._core
    assert core is not None and core.plan() == layered() == round(expected) - len(stops)
    rng = np.random.default_rng(1)
    repairing = []
    for _, edges in changes(roadmap, planner, "all along the route", repeats, rng):
        begin = perf_counter()
        planner.update(edges)
        planner.replan(start)
        repairing.append(perf_counter() - begin)
    about = f"{roadmap.graph.size} nodes, 5 states"
    reference = median(building) + median(searching)
    print()
    table(f"explicit product, {about}: build", ms(median(building)), "")
    table("explicit product: search by scipy's Dijkstra", ms(median(searching)), "")
    table("layered search: automaton, tables, search", ms(median(alone)), "")
    table("explicit / layered, build and search", f"{reference / median(alone):.1f} x", ">= 20 x")
    table("whole first plan, with links and waypoints", ms(median(begin_all)), "")
    table(
        "explicit build and search / whole first plan", f"{reference / median(begin_all):.1f} x", ""
    )
    table("repair on the route: p50", ms(median(repairing)), "")
    table("explicit build and search / repair", f"{reference / median(repairing):.1f} x", "")


def main() -> None:
    """Print every figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer repeats")
    quick = parser.parse_args().quick
    mission = load(MAZE)
    table("", "measured", "figure")
    compile_time(51 if quick else 501)
    explicit(mission, 11 if quick else 101)
    for corners in (True, False):
        print()
        rounds = 50 if quick else 500
        params = Params(points=2000, corners=corners)
        repairs(mission, params, rounds, ("<= 1 ms", "p99 <= 1 ms"))
    for corners in (True, False):
        print()
        rounds = 10 if quick else 100
        params = Params(points=100_000, corners=corners)
        repairs(mission, params, rounds, ("<= 60 ms", "p99 <= 15 ms"))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print()
    table("peak memory", f"{peak:.2f} GiB", "<= 1 GiB")


if __name__ == "__main__":
    main()
