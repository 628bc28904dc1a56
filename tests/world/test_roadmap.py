"""The roadmap: what its edges keep, cost and join, and what a change leaves alone."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import ConvexHull
from shapely.geometry import LineString, Polygon

from oath import _core
from oath.model import Map, Mission, Motion, Obstacle, Point, Robot, Stop, Task
from oath.world.halton import Density
from oath.world.passages import missed
from oath.world.roadmap import MICRO, Params, Roadmap, World, build
from oath.world.workspace import Mode, Workspace
from oracles import gap
from scenes import (
    BOX,
    FLYER,
    GROUND,
    WADER,
    random_map,
    random_obstacle,
    random_point,
    random_polygon,
    small_roadmap,
)

SEEDS = st.integers(0, 2**32 - 1)
MODES = (Mode(GROUND, 0.1), Mode(FLYER, 0.3), Mode(WADER, 0.05))


def mission(
    map: Map,
    stops: list[Point],
    *,
    motions: tuple[Motion, ...] = (GROUND,),
    radii: tuple[float, ...] = (0.2,),
) -> Mission:
    """One robot per motion, all at the first stop; one visit to each of the others."""
    return Mission(
        name="m",
        map=map,
        motions={motion.name: motion for motion in motions},
        places={},
        task_types=("visit",),
        robots=tuple(
            Robot(
                id=f"r{i}", start=stops[0], motion=motion.name, can={"visit": 1.0},
                capacity=1, speed=1.0, radius=radius, sensing=1.0,
            )
            for i, (motion, radius) in enumerate(zip(motions, radii, strict=True))
        ),
        tasks=tuple(
            Task(id=f"t{i}", type="visit", stops=(Stop(name="visit", at=at),))
            for i, at in enumerate(stops[1:])
        ),
        zones={},
        rules=(),
    )  # fmt: skip


def between(world: World, mode: int, one: Point, other: Point) -> float:
    """Travel cost between two stops [m]."""
    return float(world.roadmap.travel(mode, [world.stops[one]], [world.stops[other]])[0, 0])


def square(id: str, kind: str, x: float, y: float, width: float, height: float) -> Obstacle:
    corners = ((x, y), (x + width, y), (x + width, y + height), (x, y + height))
    return Obstacle(id=id, kind=kind, polygon=corners)


def all_costs(roadmap: Roadmap) -> np.ndarray:
    """Costs (modes, edges) [um]."""
    return np.stack([roadmap.graph.costs(m) for m in range(len(roadmap.modes))])


# --- Edges


@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_open_edges_keep_the_radius_and_cost_what_they_should(seed: int) -> None:
    rng = np.random.default_rng(seed)
    map = random_map(rng, obstacles=5)
    roadmap = small_roadmap(map, modes=MODES, seed=seed % 97)
    roadmap.insert(random_point(rng))
    roadmap.add_obstacle(random_obstacle(rng, "new", random_point(rng), 1.5))
    obstacles = list(roadmap.workspace.obstacles.values())
    nodes = roadmap.nodes()
    for m, mode in enumerate(MODES):
        blocking = [o for o in obstacles if mode.motion.blocked_by(o.kind)]
        costs = roadmap.graph.costs(m)
        for (a, b), cost in zip(nodes[roadmap.graph.ends()].tolist(), costs.tolist(), strict=True):
            width = gap(map, blocking, tuple(a), tuple(b))
            if cost >= _core.UNREACHABLE:
                assert width < mode.radius + 1e-6
                continue
            assert width >= mode.radius - 1e-6
            price = math.dist(a, b)
            for o in obstacles:
                factor = mode.motion.cost.get(o.kind, 1.0)
                price += (factor - 1) * LineString([a, b]).intersection(Polygon(o.polygon)).length
            assert -0.01 <= cost - price * MICRO <= 1.01


def test_every_delaunay_edge_with_room_is_there_hull_included() -> None:
    roadmap = small_roadmap(Map(bounds=BOX), points=60)
    nodes, pairs = roadmap.nodes(), {tuple(sorted(p)) for p in roadmap.edges().tolist()}
    hull = ConvexHull(nodes).simplices.tolist()
    assert {tuple(sorted(pair)) for pair in hull} <= pairs
    # A triangulation of n points of which h lie on the hull has 3 n - 3 - h edges.
    assert len(pairs) == len(roadmap.edges()) == 3 * 60 - 3 - len(hull)


def test_edges_lie_side_by_side_nowhere_and_nodes_have_an_order() -> None:
    roadmap = small_roadmap(random_map(np.random.default_rng(4)), modes=MODES)
    for at in ((1.0, 1.0), (7.0, 7.0), (4.0, 4.0)):
        roadmap.insert(at)
    ends = np.sort(roadmap.graph.ends(), axis=1)
    assert len(np.unique(ends, axis=0)) == len(ends)
    assert (ends[:, 0] < ends[:, 1]).all()


def test_without_corner_nodes_ways_are_longer() -> None:
    wall = Map(bounds=BOX, walls=(((4.0, 0.0), (4.0, 5.0)),), wall_thickness=0.2)
    stops = [(2.0, 1.0), (6.0, 1.0)]
    ways, counts = [], []
    for corners in (True, False):
        world = build(
            mission(wall, stops), Params(points=80, corners=corners), 1, relevant=frozenset()
        )
        ways.append(between(world, 0, *stops))
        counts.append(world.roadmap.graph.size)
    exact = 2 * math.hypot(2, 4) + 0.5
    assert exact - 0.6 < ways[0] < ways[1]
    assert ways[0] < 1.05 * exact
    assert counts[1] == 82 and counts[0] == 86  # four around the wall's end


# --- Travel


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_travel_equals_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    zones = {"lab": random_polygon(rng, random_point(rng), 3.0)}
    roadmap = small_roadmap(
        random_map(rng), modes=MODES, zones=zones, relevant=frozenset({"lab"}), seed=seed % 97
    )
    size = roadmap.graph.size
    ends, labels = roadmap.graph.ends(), roadmap.graph.labels()
    nodes = roadmap.nodes()
    in_lab = [LineString(way).intersects(Polygon(zones["lab"])) for way in nodes[ends].tolist()]
    for m, avoid in ((0, frozenset()), (1, frozenset({"lab"})), (2, frozenset({"lab"}))):
        costs = roadmap.graph.costs(m)
        use = costs < _core.UNREACHABLE
        if avoid:
            use &= ~np.array(in_lab, dtype=bool)
            assert [not (roadmap.zones.classes[k] & avoid) for k in labels] == [
                not x for x in in_lab
            ]
        matrix = csr_array((costs[use].astype(float), ends[use].T), shape=(size, size))
        sources = rng.integers(0, size, 4).tolist()
        targets = [*rng.integers(0, size, 5).tolist(), sources[0]]
        expected = dijkstra(matrix, directed=False, indices=sources)[:, targets] / MICRO
        assert np.array_equal(roadmap.travel(m, sources, targets, avoid), expected)
    assert roadmap.travel(0, [], [0]).shape == (0, 1)
    assert roadmap.travel(0, [0], []).shape == (1, 0)


def test_avoided_zones_are_driven_around() -> None:
    strip = {"lab": ((3.0, -1.0), (5.0, -1.0), (5.0, 7.0), (3.0, 7.0))}
    roadmap = small_roadmap(Map(bounds=BOX), points=300, zones=strip, relevant=frozenset({"lab"}))
    ends = [roadmap.insert((1.0, 1.0)), roadmap.insert((7.0, 1.0))]
    straight = roadmap.travel(0, ends[:1], ends[1:])[0, 0]
    around = roadmap.travel(0, ends[:1], ends[1:], frozenset({"lab"}))[0, 0]
    assert straight < 6.5 and around > 2 * math.hypot(2, 6)
    assert roadmap.travel(0, ends[:1], ends[1:], frozenset({"other"}))[0, 0] == straight


def test_unreachable_is_infinite() -> None:
    wall = Map(bounds=BOX, walls=(((4.0, -1.0), (4.0, 9.0)),))
    roadmap = small_roadmap(wall, points=50)
    a, b = roadmap.insert((1.0, 1.0)), roadmap.insert((7.0, 1.0))
    assert roadmap.travel(0, [a], [a, b]).tolist() == [[0.0, math.inf]]
    parts = roadmap.components(0)
    assert parts[a] != parts[b]


# --- Motions and radii


def test_costed_motions_pay_and_ignoring_ones_pass() -> None:
    bush = replace(square("b", "bush", 3.0, -1.0, 2.0, 10.0))
    payer = Motion(name="payer", cost={"bush": 3.0})
    stops = [(1.0, 4.0), (7.0, 4.0)]
    world = build(
        mission(Map(bounds=BOX, obstacles=(bush,)), stops, motions=(GROUND, FLYER, payer),
                radii=(0.1,) * 3),
        Params(points=150), relevant=frozenset(),
    )  # fmt: skip
    ground, flyer, pays = (between(world, m, *stops) for m in range(3))
    assert ground == math.inf
    assert 6.0 <= flyer < 6.3
    assert 6.0 + 2 * 2.0 - 1e-6 <= pays < 10.6


def test_the_cheaper_of_through_and_around_is_taken() -> None:
    pond = square("p", "water", 3.0, 1.0, 2.0, 6.0)
    stops = [(1.0, 4.0), (7.0, 4.0)]
    lengths = []
    for factor in (1.2, 50.0):
        motion = Motion(name="m", cost={"water": factor})
        world = build(
            mission(Map(bounds=BOX, obstacles=(pond,)), stops, motions=(motion,), radii=(0.1,)),
            Params(points=400), relevant=frozenset(),
        )  # fmt: skip
        lengths.append(between(world, 0, *stops))
    around = 2 * math.hypot(2, 3) + 2
    assert 6.4 - 1e-6 <= lengths[0] < 6.8
    assert around - 1e-6 <= lengths[1] < 1.1 * around


def test_a_fat_robot_does_not_pass_where_a_thin_one_does() -> None:
    gate = (((4.0, -1.0), (4.0, 3.7)), ((4.0, 4.3), (4.0, 9.0)))
    stops = [(1.0, 4.0), (7.0, 4.0)]
    fat = Motion(name="fat")
    world = build(
        mission(Map(bounds=BOX, walls=gate), stops, motions=(GROUND, fat), radii=(0.2, 0.35)),
        Params(points=300), relevant=frozenset(),
    )  # fmt: skip
    assert between(world, 0, *stops) == pytest.approx(6.0, abs=0.3)
    assert between(world, 1, *stops) == math.inf


# --- Resampling until all hangs together


def maze_of_gates(width: float) -> Map:
    """Two walls, each with one narrow gate, far apart from each other."""
    half = width / 2
    return Map(
        bounds=BOX,
        walls=(
            ((3.0, -1.0), (3.0, 1.0 - half)),
            ((3.0, 1.0 + half), (3.0, 9.0)),
            ((5.0, -1.0), (5.0, 7.0 - half)),
            ((5.0, 7.0 + half), (5.0, 9.0)),
        ),
        wall_thickness=0.1,
    )


@pytest.mark.parametrize("seed", range(4))
def test_resampling_finds_gates_that_sampling_misses(seed: int) -> None:
    """Sampling keeps 0.3 m away from walls, but the robot needs only 0.2 m: 0.25 m in the gate."""
    map, stops = maze_of_gates(0.6), [(1.0, 4.0), (4.0, 4.0), (7.0, 4.0)]
    fits, radii = (GROUND, Motion(name="tank")), (0.2, 0.3)
    params = Params(points=60, corners=False, links=6)
    sampled = Roadmap(
        Workspace(map), build(mission(map, stops), params, relevant=frozenset()).roadmap.zones,
        [Mode(GROUND, 0.2)], params, np.random.default_rng(seed), corner_points=np.empty((0, 2)),
    )  # fmt: skip
    ends = [sampled.insert(at) for at in stops]
    assert np.isinf(sampled.travel(0, ends, ends)).any()
    world = build(
        mission(map, stops, motions=fits, radii=radii), params, seed, relevant=frozenset()
    )
    thin = [between(world, 0, one, other) for one, other in combinations(stops, 2)]
    assert np.isfinite(thin).all()
    # What no way joins stays apart, without an error and without a made-up cost.
    wide = [between(world, 1, one, other) for one, other in combinations(stops, 2)]
    assert np.isinf(wide).all()
    inside = world.roadmap.nodes()
    assert ((inside >= 0) & (inside <= 8)).all()


def test_only_what_is_wanted_is_connected() -> None:
    map, stops = maze_of_gates(0.6), [(1.0, 4.0), (2.0, 6.0)]
    params = Params(points=60, corners=False)
    world = build(mission(map, stops), params, relevant=frozenset())
    assert world.roadmap.graph.size == world.roadmap.sampled + 2


@pytest.mark.parametrize("seed", range(3))
def test_same_seed_same_roadmap(seed: int) -> None:
    def graph() -> tuple[list[list[float]], list[list[int]], list[int]]:
        world = build(
            mission(maze_of_gates(0.6), [(1.0, 4.0), (7.0, 4.0)]),
            Params(points=60), seed, relevant=frozenset(),
        )  # fmt: skip
        roadmap = world.roadmap
        return (
            roadmap.nodes().tolist(), roadmap.graph.ends().tolist(),
            roadmap.graph.costs(0).tolist(),
        )  # fmt: skip

    assert graph() == graph()


# --- Insertions


def test_inserting_twice_gives_the_same_node_and_renumbers_nothing() -> None:
    roadmap = small_roadmap(random_map(np.random.default_rng(2)), modes=MODES)
    nodes, ends, costs = roadmap.nodes(), roadmap.graph.ends(), all_costs(roadmap)
    first = roadmap.insert((3.3, 4.4))
    sizes = roadmap.graph.size, roadmap.graph.edges
    assert roadmap.insert((3.3, 4.4)) == first == len(nodes)
    assert (roadmap.graph.size, roadmap.graph.edges) == sizes
    second = roadmap.insert((5.5, 4.4))
    assert second == first + 1
    assert np.array_equal(roadmap.nodes()[: len(nodes)], nodes)
    assert np.array_equal(roadmap.graph.ends()[: len(ends)], ends)
    assert np.array_equal(all_costs(roadmap)[:, : len(ends)], costs)
    assert roadmap.nodes()[first].tolist() == [3.3, 4.4]


def test_a_stop_nearer_to_a_wall_than_samples_is_joined_with_its_own_clearance() -> None:
    wall = Map(bounds=BOX, walls=(((0.0, 4.0), (8.0, 4.0)),), wall_thickness=0.2)
    roadmap = small_roadmap(wall, modes=(Mode(GROUND, 0.2),), points=80)
    near, inside, far = (roadmap.insert(at) for at in ((4.0, 3.69), (4.0, 4.0), (1.0, 1.0)))
    reach = roadmap.travel(0, [far], [near, inside])[0]
    assert math.isfinite(reach[0]) and reach[1] == math.inf


# --- Obstacles that come and go


@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, corners=st.booleans())
def test_obstacles_leave_no_trace_on_old_edges(seed: int, corners: bool) -> None:
    rng = np.random.default_rng(seed)
    roadmap = small_roadmap(random_map(rng), modes=MODES, corners=corners, seed=seed % 97)
    nodes, ends, costs = roadmap.nodes(), roadmap.graph.ends(), all_costs(roadmap)
    old = len(ends)
    ids = [f"x{i}" for i in range(4)]
    steps = [(roadmap.add_obstacle, random_obstacle(rng, id, random_point(rng), 2.0)) for id in ids]
    steps += [(roadmap.remove_obstacle, id) for id in rng.permutation(ids).tolist()]
    for change, what in steps:
        before, edges = all_costs(roadmap), roadmap.graph.edges
        changed = change(what)
        after = all_costs(roadmap)
        differs = np.flatnonzero((after[:, :edges] != before).any(axis=0)).tolist()
        new = list(range(edges, roadmap.graph.edges))
        assert sorted(changed.tolist()) == differs + new
        assert changed.dtype == np.int32 and len(set(changed.tolist())) == len(changed)
        assert np.array_equal(after, evaluated(roadmap))
        assert np.array_equal(roadmap.nodes()[: len(nodes)], nodes)
        assert np.array_equal(roadmap.graph.ends()[:old], ends)
    assert np.array_equal(all_costs(roadmap)[:, :old], costs)
    if not corners:
        assert roadmap.graph.edges == old


def evaluated(roadmap: Roadmap) -> np.ndarray:
    """What each edge costs in each mode, one by one on a workspace of its own."""
    here = roadmap.workspace
    bare = Workspace(Map(bounds=here.bounds, obstacles=tuple(here.obstacles.values())))
    costs = []
    a, b = roadmap.nodes()[roadmap.graph.ends()].transpose(1, 0, 2).copy()
    for m, mode in enumerate(roadmap.modes):
        fits = bare.free(a, b, mode)
        # The bare workspace lacks the map's walls: what they block stays blocked.
        walls = here.core.free(a, b, mode.radius, here.permanent()).astype(bool)
        price = np.maximum(np.ceil(bare.length(a, b, mode.motion) * MICRO), 1).astype(np.int64)
        costs.append(np.where(fits & walls, price, _core.UNREACHABLE))
        assert len(costs[m]) == roadmap.graph.edges
    return np.stack(costs)


def test_a_new_obstacle_gets_corner_nodes_and_ways_around() -> None:
    ways = []
    for corners in (True, False):
        roadmap = small_roadmap(Map(bounds=BOX), points=60, corners=corners)
        ends = [roadmap.insert((1.0, 4.0)), roadmap.insert((7.0, 4.0))]
        size = roadmap.graph.size
        roadmap.add_obstacle(square("x", "crate", 3.5, 1.0, 1.0, 6.0))
        assert (roadmap.graph.size > size) == corners
        ways.append(roadmap.travel(0, ends[:1], ends[1:])[0, 0])
        around = roadmap.nodes()[size:]
        x, y = np.abs(around - 4.0).T
        assert (np.maximum(x - 0.5, y - 3.0) >= 0.1 - 1e-9).all()
    exact = 2 * math.hypot(2.5 - 0.1, 3.1) + 1.2
    assert exact - 0.1 < ways[0] < min(ways[1], 1.03 * exact)


def test_an_obstacle_that_comes_back_adds_nothing() -> None:
    roadmap = small_roadmap(Map(bounds=BOX), points=60)
    crate = square("x", "crate", 3.0, 3.0, 2.0, 2.0)
    roadmap.add_obstacle(crate)
    sizes, costs = (roadmap.graph.size, roadmap.graph.edges), all_costs(roadmap)
    roadmap.remove_obstacle("x")
    roadmap.add_obstacle(crate)
    assert (roadmap.graph.size, roadmap.graph.edges) == sizes
    assert np.array_equal(all_costs(roadmap), costs)


# --- Small and full maps


@pytest.mark.parametrize("points", [0, 1, 2, 3])
def test_hardly_any_nodes(points: int) -> None:
    roadmap = small_roadmap(Map(bounds=BOX), points=points)
    assert roadmap.graph.size == points
    assert len(roadmap.edges()) == {0: 0, 1: 0, 2: 1, 3: 3}[points]
    a, b = roadmap.insert((1.0, 1.0)), roadmap.insert((7.0, 7.0))
    assert roadmap.travel(0, [a], [b])[0, 0] >= math.hypot(6, 6) - 1e-9
    assert len(set(roadmap.components(0).tolist())) == 1
    assert roadmap.links((4.0, 4.0), 0)[0]


def test_nodes_on_a_line_are_joined_in_order() -> None:
    flat = Map(bounds=BOX, obstacles=(square("x", "crate", -1, -1, 10, 2),))
    roadmap = small_roadmap(flat, points=0)
    line = np.stack([np.linspace(1, 7, 6), np.full(6, 4.0)], axis=1)
    one = Roadmap(
        roadmap.workspace, roadmap.zones, [Mode(GROUND, 0.1)], Params(points=0),
        np.random.default_rng(0), corner_points=line,
    )  # fmt: skip
    assert one.graph.size == 6
    order = np.argsort(one.nodes()[:, 0])
    pairs = {tuple(sorted(p)) for p in one.edges().tolist()}
    assert {tuple(sorted(p)) for p in pairwise(order.tolist())} <= pairs


def test_tiny_and_thin_maps() -> None:
    for box in ((0.0, 0.0, 0.01, 0.01), (0.0, 0.0, 200.0, 0.5), (-1e4, -1e4, 1e4, 1e4)):
        map = Map(bounds=box)
        stops = [(box[0], box[1]), (box[2], box[3])]
        world = build(mission(map, stops, radii=(0.001,)), Params(points=20), relevant=frozenset())
        assert between(world, 0, *stops) >= math.dist(*stops) - 1e-9
        assert math.isfinite(between(world, 0, *stops))


def test_a_full_map_has_no_way() -> None:
    full = Map(bounds=BOX, obstacles=(square("x", "crate", -1, -1, 10, 10),))
    stops = [(1.0, 1.0), (7.0, 7.0)]
    world = build(mission(full, stops), Params(points=20), relevant=frozenset())
    assert world.roadmap.sampled == 0
    assert between(world, 0, *stops) == math.inf
    assert world.roadmap.links((1.0, 1.0), 0) == ([], [], [])
    world.roadmap.remove_obstacle("x")
    assert between(world, 0, *stops) == pytest.approx(math.hypot(6, 6))


def test_a_stop_behind_an_obstacle_is_joined_once_that_is_gone() -> None:
    """The only way out of a dead end leads past what closes it when the stop is inserted."""
    pocket = Map(
        bounds=BOX, walls=(((0.0, 2.0), (2.0, 2.0)), ((0.0, 3.0), (2.0, 3.0))), wall_thickness=0.1
    )
    roadmap = small_roadmap(pocket, points=60, modes=MODES[:1])
    outside = roadmap.insert((6.0, 6.0))
    roadmap.add_obstacle(square("plug", "crate", 1.0, 1.9, 0.5, 1.2))
    inside = roadmap.insert((0.3, 2.5))
    assert roadmap.travel(0, [outside], [inside])[0, 0] == math.inf
    roadmap.remove_obstacle("plug")
    assert math.isfinite(roadmap.travel(0, [outside], [inside])[0, 0])


def test_links_are_what_a_robot_sees() -> None:
    wall = Map(bounds=BOX, walls=(((4.0, -1.0), (4.0, 9.0)),), wall_thickness=0.2)
    roadmap = small_roadmap(wall, points=80, modes=(Mode(GROUND, 0.1),))
    at = (3.0, 4.0)
    nodes, costs, labels = roadmap.links(at, 0)
    assert len(nodes) >= roadmap.params.links and labels == [0] * len(nodes)
    far = roadmap.insert((0.5, 9.5))
    assert far in roadmap.links(at, 0, [far])[0] and far not in nodes
    behind = roadmap.insert((6.0, 4.0))
    assert behind not in roadmap.links(at, 0, [behind])[0]
    for node, cost in zip(nodes, costs, strict=True):
        there = roadmap.nodes()[node]
        assert there[0] < 4.0
        assert cost == math.ceil(np.hypot(*(there - at)) * MICRO)


# --- What is missed


def test_missed_finds_a_passage_and_an_empty_room() -> None:
    gate = maze_of_gates(0.6)
    roadmap = small_roadmap(gate, points=25, modes=(Mode(GROUND, 0.2),), corners=False)
    gaps = missed(roadmap, 0)
    assert len(set(roadmap.components(0).tolist())) > 1
    assert gaps and all(gap.mode == 0 and gap.area > 0 for gap in gaps)
    assert [gap.area for gap in gaps] == sorted((gap.area for gap in gaps), reverse=True)
    # One room without any node.
    closed = Map(bounds=BOX, walls=(((6.0, -1.0), (6.0, 9.0)),))
    left = np.random.default_rng(0).uniform(0.5, 5.5, (40, 2))
    bare = Roadmap(
        Workspace(closed), roadmap.zones, [Mode(GROUND, 0.1)], Params(points=0),
        np.random.default_rng(0), corner_points=left,
    )  # fmt: skip
    (room,) = missed(bare, 0)
    assert 6.0 < room.at[0] < 8.0
    assert room.area == pytest.approx(1.9 * 8.0, rel=0.05)


def test_missed_is_empty_when_all_hangs_together() -> None:
    world = build(
        mission(maze_of_gates(0.6), [(1.0, 4.0), (4.0, 4.0), (7.0, 4.0)]),
        Params(points=300, density=Density(d_min=0.2)), relevant=frozenset(),
    )  # fmt: skip
    parts = world.roadmap.components(0)
    assert len(set(parts[list(world.stops.values())].tolist())) == 1
    assert missed(world.roadmap, 0) == []


# --- Trials


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_trial_leaves_no_trace_and_what_it_tried_can_be_done_after(seed: int) -> None:
    """Costs, obstacles and components are as before; a real change then equals one untried."""
    rng = np.random.default_rng(seed)
    map = random_map(rng)
    modes = (Mode(GROUND, 0.1), Mode(FLYER, 0.2))
    tried, untried = (small_roadmap(map, modes=modes, seed=seed % 7) for _ in range(2))
    spots = [random_point(rng) for _ in range(6)]
    for roadmap in (tried, untried):
        for at in spots:
            roadmap.insert(at)
    nodes = [tried.insert(at) for at in spots]
    obstacle = random_obstacle(rng, "new", random_point(rng))
    before = [tried.travel(mode, nodes, nodes) for mode in (0, 1)]
    with tried.trial():
        tried.add_obstacle(obstacle)
        tried.insert(random_point(rng))
        for id in list(tried.workspace.obstacles)[:1]:
            tried.remove_obstacle(id)
    assert tried.workspace.obstacles == untried.workspace.obstacles
    for mode in (0, 1):
        np.testing.assert_array_equal(tried.travel(mode, nodes, nodes), before[mode])
        np.testing.assert_array_equal(
            tried.components(mode)[nodes] == tried.components(mode)[nodes[0]],
            untried.components(mode)[nodes] == untried.components(mode)[nodes[0]],
        )
    tried.add_obstacle(obstacle)
    untried.add_obstacle(obstacle)
    for mode in (0, 1):
        got, wanted = (one.travel(mode, nodes, nodes) for one in (tried, untried))
        np.testing.assert_array_equal(np.isfinite(got), np.isfinite(wanted))


def test_nodes_that_were_only_tried_out_are_never_joined() -> None:
    roadmap = small_roadmap(Map(bounds=BOX))
    with roadmap.trial():
        gone = roadmap.insert((4.0, 4.0))
    node = roadmap.insert((4.0, 4.0))
    assert node != gone
    ends = roadmap.graph.ends()
    assert gone not in ends[(ends == node).any(axis=1)]
    assert roadmap.near((4.0, 4.0), 0) == (node,)


def test_components_without_what_is_to_be_avoided() -> None:
    lab = {"lab": ((3.0, -1.0), (5.0, -1.0), (5.0, 9.0), (3.0, 9.0))}
    roadmap = small_roadmap(Map(bounds=BOX), zones=lab, relevant=frozenset({"lab"}))
    nodes = [roadmap.insert(at) for at in ((1.0, 4.0), (7.0, 4.0))]
    west, east = roadmap.components(0)[nodes]
    assert west == east
    west, east = roadmap.components(0, frozenset({"lab"}))[nodes]
    assert west != east
    assert roadmap.near((2.9, 4.1), 0, frozenset({"lab"}))
