"""Build times, connectivity and path quality of the roadmap on the maze.

Run with ``python bench/roadmap.py [--quick]``. Paths are compared with the exact shortest paths of
a visibility graph on finely circumscribed corners, computed in the same run.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import time
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import Delaunay

from oath import _core
from oath.bench.shortest import exact_lengths, stop_points
from oath.formats.mission import load
from oath.model import Mission
from oath.world.roadmap import MICRO, Params, World, build

MAZE = Path(__file__).parent.parent / "missions" / "maze-25.yaml"


def pulled_lengths(world: World, nodes: list[int]) -> np.ndarray:
    """Lengths of the string-pulled roadmap paths between stops (n, n) [m]."""
    roadmap = world.roadmap
    ends, costs = roadmap.graph.ends(), roadmap.graph.costs(0)
    is_open = costs < _core.UNREACHABLE
    n = roadmap.graph.size
    graph = csr_array((costs[is_open] / MICRO, ends[is_open].T), shape=(n, n))
    _, before = dijkstra(graph, directed=False, indices=nodes, return_predecessors=True)
    points, mode = roadmap.nodes(), roadmap.modes[0]
    blocked = roadmap.workspace.blocked(mode.motion)
    lengths = np.zeros((len(nodes), len(nodes)))
    for a in range(len(nodes)):
        for b, node in enumerate(nodes):
            path = [node]
            while path[-1] != nodes[a]:
                path.append(before[a, path[-1]])
            way = points[path]
            kept = _core.pull(
                way, roadmap.workspace.core, mode.radius, blocked, [0] * len(blocked),
                roadmap.zones.core, roadmap.zones.all,
            )  # fmt: skip
            lengths[a, b] = np.hypot(*np.diff(way[kept], axis=0).T).sum()
    return lengths


def build_times(mission: Mission, quick: bool) -> None:
    """Print the median build time for each size, beside scipy's triangulation of as many points."""
    print(f"{'points':>8} {'nodes':>8} {'edges':>8} {'build [ms]':>11} {'x Delaunay':>11}")
    for points, repeats in ((1000, 15), (2000, 15), (100_000, 1 if quick else 3)):
        seconds, references = [], []
        for seed in range(repeats):
            params = Params(points=points)
            start = time.perf_counter()
            world = build(mission, params, seed, relevant=frozenset())
            seconds.append(time.perf_counter() - start)
            nodes = world.roadmap.nodes()
            start = time.perf_counter()
            Delaunay(nodes)
            references.append(time.perf_counter() - start)
        graph = world.roadmap.graph
        median, ratio = statistics.median(seconds), statistics.median(references)
        print(
            f"{points:8d} {graph.size:8d} {graph.edges:8d} {median * 1e3:11.1f}"
            f" {median / ratio:11.2f}"
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak:.0f} MiB")


def quality(mission: Mission, seeds: int) -> None:
    """Print the mean excess over the exact shortest paths, over all stop pairs."""
    print(f"\n{'points':>8} {'corners':>8} {'raw excess':>11} {'pulled':>8}  (all stop pairs)")
    stops = stop_points(mission)
    exact = None
    off = ~np.eye(len(stops), dtype=bool)
    for points in (500, 1000, 2000):
        for with_corners in (True, False):
            raw, pulled = [], []
            for seed in range(seeds):
                params = Params(points=points, corners=with_corners)
                world = build(mission, params, seed, relevant=frozenset())
                if exact is None:
                    exact = exact_lengths(mission.map, stops, world.roadmap.modes[0])
                nodes = [world.stops[tuple(stop)] for stop in stops]
                lengths = world.roadmap.travel(0, nodes, nodes)
                raw.append((lengths[off] / exact[off] - 1).mean())
                pulled.append((pulled_lengths(world, nodes)[off] / exact[off] - 1).mean())
            print(
                f"{points:8d} {'yes' if with_corners else 'no':>8} {np.mean(raw):11.2%}"
                f" {np.mean(pulled):8.2%}"
            )


def connectivity(mission: Mission, seeds: int) -> None:
    """Print the share of stop pairs that are connected."""
    print(f"\n{'points':>8} {'pairs connected':>16}  ({seeds} seeds)")
    for points in (500, 1000, 2000):
        joined = total = 0
        for seed in range(seeds):
            world = build(mission, Params(points=points), seed, relevant=frozenset())
            nodes = list(world.stops.values())
            for mode in range(len(world.roadmap.modes)):
                parts = world.roadmap.components(mode)[nodes]
                same = parts[:, None] == parts[None, :]
                joined, total = joined + same.sum(), total + same.size
        print(f"{points:8d} {joined / total:16.2%}")


def travel_costs(mission: Mission) -> None:
    """Print the time for 200 sources on about 2000 nodes, beside scipy's compiled Dijkstra."""
    world = build(mission, Params(points=2000), 0, relevant=frozenset())
    graph = world.roadmap.graph
    ends, costs = graph.ends(), graph.costs(0)
    is_open = costs < _core.UNREACHABLE
    a, b = ends[is_open].T
    weights = costs[is_open].astype(float)
    both = (np.concatenate([a, b]), np.concatenate([b, a]))
    matrix = csr_array((np.concatenate([weights, weights]), both), shape=(graph.size, graph.size))
    sources = np.random.default_rng(0).choice(graph.size, 200, replace=False).tolist()
    everywhere = list(range(graph.size))
    ours, some, theirs = [], [], []
    for _ in range(15):
        start = time.perf_counter()
        world.roadmap.travel(0, sources, everywhere)
        ours.append(time.perf_counter() - start)
        start = time.perf_counter()
        world.roadmap.travel(0, sources, sources)
        some.append(time.perf_counter() - start)
        start = time.perf_counter()
        dijkstra(matrix, indices=sources)
        theirs.append(time.perf_counter() - start)
    reference = statistics.median(theirs)
    print(f"\ntravel costs, 200 sources, {graph.size} nodes: scipy {reference * 1e3:.1f} ms")
    for what, times in (("to all nodes", ours), ("to the 200", some)):
        median = statistics.median(times)
        print(f"  {what:14} {median * 1e3:7.1f} ms  {median / reference:5.2f} x scipy")


def main() -> None:
    """Print every table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer repeats and seeds")
    quick = parser.parse_args().quick
    mission = load(MAZE)
    build_times(mission, quick)
    quality(mission, 2 if quick else 5)
    connectivity(mission, 3 if quick else 20)
    travel_costs(mission)


if __name__ == "__main__":
    main()
