"""Laws of the planner: a repaired plan costs what a fresh search of the explicit product finds."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon

from oath import _core
from oath.formats.mission import load
from oath.model import Map, Mission, Obstacle, Point
from oath.motion.ltl import conjunction, parse
from oath.motion.mission_automaton import Letter, Rules, compile_rules
from oath.motion.planner import Plan, Planner, Service
from oath.world.roadmap import MICRO, Params, Roadmap, build
from oath.world.workspace import Mode
from oracles import Product, gap, holds
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
NAMES = ("lab", "key", "s0", "s1", "s2", "s3")
RULES: tuple[tuple[str, ...], ...] = (
    (),
    ("G !lab",),
    ("!lab W key",),
    ("F key",),
    ("G !lab", "F key"),
    ("!lab W s0", "F key"),
    ("!s1 W s0",),
    ("G (lab -> F key)",),
    ("F key & (!key W s0)", "!lab W key"),
    ("F (key & F lab)", "!s1 W key"),
)
MAZE = Path(__file__).parents[2] / "missions" / "maze-25.yaml"


def rules_of(texts: tuple[str, ...]) -> Rules:
    return compile_rules(texts, NAMES)


def step(rules: Rules, states: frozenset[int], letter: Letter) -> frozenset[int]:
    """The rule states that a letter leads to."""
    if letter & rules.avoid:
        return frozenset()
    return frozenset(
        target
        for source, label, target in rules.automaton.edges
        if source in states and label.positive <= letter and not label.negative & letter
    )


@dataclass
class Run:
    """One planner, what it should know, and what it is compared with."""

    roadmap: Roadmap
    rules: Rules
    planner: Planner
    services: list[Service]
    mode: int = 0
    bare: Map = field(default_factory=lambda: Map(bounds=BOX))
    """The map without what can be added and removed."""
    obstacles: dict[str, Obstacle] = field(default_factory=dict)
    stretched: bool = False
    """Whether some edge was made to cost more than its length."""

    def __post_init__(self) -> None:
        self.at = self.planner.position
        self.states = frozenset(self.rules.automaton.initial)

    def product(self) -> Product:
        graph, zones = self.roadmap.graph, self.roadmap.zones
        stops = [(self.roadmap.insert(s.at), s.letter | {s.own}) for s in self.services]
        costs = graph.costs(self.mode)
        is_open = costs < _core.UNREACHABLE
        letters = [zones.classes[label] for label in graph.labels()[is_open]]
        return Product(
            graph.size,
            graph.ends()[is_open],
            costs[is_open],
            letters,
            self.rules.automaton,
            self.rules.avoid,
            stops,
            zones.at(self.services[-1].at),
        )

    def links(self) -> list[tuple[int, int, Letter]]:
        goals = [self.roadmap.insert(service.at) for service in self.services[:1]]
        nodes, costs, labels = self.roadmap.links(self.at, self.mode, goals)
        letters = [self.roadmap.zones.classes[label] for label in labels]
        return list(zip(nodes, costs, letters, strict=True))

    def fresh(self) -> tuple[int | None, int | None]:
        """Cost [um] and blocked stop by the explicit product."""
        links = self.links()
        return self.product().cost(links, self.states)

    def check(self, plan: Plan) -> int | None:
        """Compare a plan with a fresh search; return its cost [um]."""
        cost, blocked = self.fresh()
        assert plan.blocked == blocked
        if cost is None:
            assert plan.legs == () and plan.length == 0.0
            return None
        # The integer cost is the compiled core's; a plan only tells its rounded length.
        core = self.planner._core
        assert core is not None and core.plan() == cost
        assert self.cost_of_path(core.path()) == cost
        assert len(plan.legs) == len(self.services)
        lines = [np.hypot(*np.diff(leg, axis=0).T).sum() for leg in plan.legs]
        assert plan.length == pytest.approx(sum(lines), abs=1e-9)
        if not self.stretched and not self.roadmap.modes[self.mode].motion.cost:
            # Each edge is rounded up to the next micrometre.
            edges = sum(map(len, plan.legs))
            assert -1e-3 <= cost - plan.length * MICRO <= edges + 1e-3
        assert plan.legs[0][0].tolist() == list(self.at)
        for leg, service in zip(plan.legs, self.services, strict=True):
            assert tuple(leg[-1].tolist()) == service.at
        for leg, following in pairwise(plan.legs):
            assert leg[-1].tolist() == following[0].tolist()
        return cost

    def cost_of_path(self, path: np.ndarray) -> int:
        """Drive a path's nodes and rule states one by one over open edges; sum the costs [um]."""
        graph, zones = self.roadmap.graph, self.roadmap.zones
        edges = {}
        for (a, b), c, label in zip(
            graph.ends().tolist(),
            graph.costs(self.mode).tolist(),
            graph.labels().tolist(),
            strict=True,
        ):
            edges[a, b] = edges[b, a] = (c, zones.classes[label])
        links = {node: (cost, letter) for node, cost, letter in self.links()}
        done = len(self.planner._services) - len(self.services)
        total, here, states, served = 0, None, self.states, 0
        for leg, node, q in path.tolist():
            assert leg == done + served
            if node < 0:
                service = self.services[served]
                assert here == self.roadmap.insert(service.at)
                cost, letter = 0, service.letter | {service.own}
                served += 1
            elif here is None:
                cost, letter = links[node]
            elif node == here:
                cost, letter = 0, None  # a leg begins where the one before ended
            else:
                cost, letter = edges[here, node]
            assert cost < _core.UNREACHABLE
            if letter is not None:
                states = step(self.rules, states, letter)
            assert q in states
            states, total = frozenset([q]), total + cost
            here = node if node >= 0 else here
        assert served == len(self.services)
        return total

    def replan(self) -> int | None:
        return self.check(self.planner.replan(self.at))

    # -- what may happen

    def drive(self, rng: np.random.Generator) -> None:
        """Drive some waypoints of the current leg, the last perhaps in part; serve if there."""
        way = self.planner.leg()
        count = int(rng.integers(0, len(way) + 1))
        for k, to in enumerate(way[:count]):
            if k == count - 1 and rng.random() < 0.5:
                share = rng.random()
                to = tuple((np.array(self.at) * (1 - share) + np.array(to) * share).tolist())
            self.move(to)
        if self.at == self.services[0].at:
            self.serve()

    def move(self, to: Point) -> None:
        if to != self.at:
            label = self.roadmap.zones.labels(np.array([self.at]), np.array([to]))[0]
            self.states = step(self.rules, self.states, self.roadmap.zones.classes[label])
        self.planner.moved(to)
        self.at = to

    def serve(self) -> None:
        service = self.services.pop(0)
        self.states = step(self.rules, self.states, service.letter)
        self.planner.served(service.letter)

    def reprice(self, rng: np.random.Generator) -> None:
        """Block, open or lengthen some edges anywhere."""
        graph = self.roadmap.graph
        if graph.edges == 0:
            return
        edges = rng.choice(graph.edges, min(graph.edges, 12), replace=False).astype(np.int32)
        points, (a, b) = graph.points(), graph.ends()[edges].T
        least = np.ceil(np.hypot(*(points[a] - points[b]).T) * MICRO).astype(np.int64) + 1
        costs = np.where(rng.random(len(edges)) < 0.4, _core.UNREACHABLE, least)
        longer = rng.random(len(edges)) < 0.3
        costs[longer] = least[longer] + rng.integers(0, 2_000_000, longer.sum())
        graph.set_costs(self.mode, edges, costs)
        self.planner.update(edges)
        self.stretched = True

    def toggle(self, rng: np.random.Generator) -> None:
        """Add an obstacle, perhaps on the plan's way, or take one out."""
        if self.obstacles and rng.random() < 0.45:
            id = str(rng.choice(sorted(self.obstacles)))
            del self.obstacles[id]
            self.planner.update(self.roadmap.remove_obstacle(id))
            return
        at = random_point(rng)
        if self.planner._plan.legs and rng.random() < 0.6:
            leg = self.planner._plan.legs[rng.integers(len(self.planner._plan.legs))]
            at = tuple(leg[rng.integers(len(leg))].tolist())
        id = f"n{len(self.roadmap.workspace.obstacles)}-{self.roadmap.graph.edges}"
        self.obstacles[id] = random_obstacle(rng, id, at, float(rng.choice([0.3, 1.5])))
        self.planner.update(self.roadmap.add_obstacle(self.obstacles[id]))


def random_run(rng: np.random.Generator, texts: tuple[str, ...], points: int = 30) -> Run:
    """A planner with a route of a few stops in a random small scene."""
    zones = {name: random_polygon(rng, random_point(rng), 1.5) for name in ("lab", "key")}
    rules = rules_of(texts)
    map = random_map(rng, walls=3, obstacles=2)
    roadmap = small_roadmap(
        map,
        modes=(Mode(GROUND, 0.1), Mode(WADER, 0.05)),
        points=points,
        corners=bool(rng.random() < 0.7),
        zones=zones,
        relevant=rules.relevant,
        seed=int(rng.integers(1000)),
    )
    services = []
    for i in range(int(rng.integers(1, 5))):
        at = random_point(rng)
        services.append(Service(at=at, own=f"t{i}", letter=roadmap.zones.at(at) | {f"s{i}"}))
    mode = int(rng.integers(2))
    start = random_point(rng)
    return Run(roadmap, rules, Planner(roadmap, rules, mode, start), services, mode, map)


@settings(max_examples=120, deadline=None)
@given(seed=SEEDS, texts=st.sampled_from(RULES))
def test_first_plan_equals_explicit_product(seed: int, texts: tuple[str, ...]) -> None:
    run = random_run(np.random.default_rng(seed), texts)
    run.check(run.planner.begin(run.at, run.services))


def life(run: Run, rng: np.random.Generator, steps: int) -> None:
    """Let anything happen and compare the repaired plan with a fresh search each time."""
    run.check(run.planner.begin(run.at, run.services))
    for _ in range(steps):
        if not run.services:
            break
        event = rng.random()
        if event < 0.3:
            run.toggle(rng)
        elif event < 0.5:
            run.reprice(rng)
        elif event < 0.6:
            run.roadmap.insert(random_point(rng))  # a stop of somebody else
        elif run.planner._plan.blocked is None:
            run.drive(rng)
        if run.services:
            run.replan()


@settings(max_examples=120, deadline=None)
@given(seed=SEEDS, texts=st.sampled_from(RULES))
def test_repaired_plans_equal_fresh_ones(seed: int, texts: tuple[str, ...]) -> None:
    rng = np.random.default_rng(seed)
    life(random_run(rng, texts), rng, 8)


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, texts=st.sampled_from(RULES))
def test_undoing_changes_restores_the_cost(seed: int, texts: tuple[str, ...]) -> None:
    rng = np.random.default_rng(seed)
    run = random_run(rng, texts)
    before = run.check(run.planner.begin(run.at, run.services))
    costs = run.roadmap.graph.costs(run.mode)
    everything = np.arange(len(costs), dtype=np.int32)
    for _ in range(3):
        run.reprice(rng)
        run.replan()
    run.roadmap.graph.set_costs(run.mode, everything, costs)
    run.planner.update(everything)
    assert run.replan() == before
    obstacles = [random_obstacle(rng, f"u{i}", random_point(rng), 2.0) for i in range(3)]
    for obstacle in obstacles:
        run.planner.update(run.roadmap.add_obstacle(obstacle))
        run.replan()
    for k in rng.permutation(3).tolist():
        run.planner.update(run.roadmap.remove_obstacle(obstacles[k].id))
        after = run.replan()
    # Nodes once put around an obstacle stay, and may be nearer to the robot than those it saw.
    if not run.roadmap.params.corners:
        assert after == before


@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, texts=st.sampled_from(RULES))
def test_planners_that_share_a_roadmap_do_not_disturb_each_other(
    seed: int, texts: tuple[str, ...]
) -> None:
    rng = np.random.default_rng(seed)
    one = random_run(rng, texts)
    services = [Service(at=random_point(rng), own=f"u{i}") for i in range(2)]
    planner = Planner(one.roadmap, one.rules, 0, random_point(rng))
    other = Run(one.roadmap, one.rules, planner, services)
    for run in (one, other, one):
        run.check(run.planner.begin(run.at, run.services))
    for _ in range(3):
        obstacle = random_obstacle(rng, f"x{rng.integers(2**40)}", random_point(rng), 1.5)
        edges = one.roadmap.add_obstacle(obstacle)
        one.planner.update(edges)
        other.planner.update(edges)
        one.replan()
        other.replan()


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS)
def test_repairs_use_the_edges_of_stops_inserted_by_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    roadmap = small_roadmap(random_map(rng, obstacles=0), points=15, corners=False)
    start, rules = random_point(rng), rules_of(())
    run = Run(
        roadmap,
        rules,
        Planner(roadmap, rules, 0, start),
        [Service(at=random_point(rng), own=f"t{i}") for i in range(2)],
    )
    run.check(run.planner.begin(start, run.services))
    for _ in range(5):
        for _ in range(3):
            roadmap.insert(random_point(rng))
        run.replan()


def test_a_new_route_begins_where_the_robot_is_and_keeps_the_rules_state() -> None:
    zones = {"lab": ((6, 0), (8, 0), (8, 8), (6, 8)), "key": ((0, 6), (2, 6), (2, 8), (0, 8))}
    rules = rules_of(("!lab W key",))
    roadmap = small_roadmap(Map(bounds=BOX), points=150, zones=zones, relevant=rules.relevant)
    planner = Planner(roadmap, rules, 0, (4.0, 4.0))
    into_lab = [Service(at=(7.0, 4.0), own="t0", letter=frozenset({"lab"}))]
    plan = planner.begin((4.0, 4.0), into_lab)
    assert plan.blocked is None and plan.length > 7.0  # by way of the key
    by_key = [Service(at=(1.0, 7.0), own="t1", letter=frozenset({"key"}))]
    planner.begin((4.0, 4.0), by_key)
    for to in planner.leg():
        planner.moved(to)
    planner.served(frozenset({"key"}))
    plan = planner.begin(planner.position, into_lab)
    assert plan.blocked is None
    assert plan.length == pytest.approx(np.hypot(6, 3), rel=0.1)


def test_coinciding_nodes_do_not_trap_the_search() -> None:
    """Removing and adding an obstacle again and again puts corner nodes on corner nodes."""
    roadmap = small_roadmap(Map(bounds=BOX), points=10)
    square = ((3.0, 3.0), (5.0, 3.0), (5.0, 5.0), (3.0, 5.0))
    rules = rules_of(())
    run = Run(
        roadmap, rules, Planner(roadmap, rules, 0, (1.0, 4.0)), [Service(at=(7.0, 4.0), own="t")]
    )
    run.check(run.planner.begin(run.at, run.services))
    around, free, sizes = [], [], []
    for _ in range(4):
        run.planner.update(roadmap.add_obstacle(Obstacle(id="x", kind="crate", polygon=square)))
        around.append(run.replan())
        run.planner.update(roadmap.remove_obstacle("x"))
        free.append(run.replan())
        sizes.append(roadmap.graph.size)
    for values in (around, free, sizes):
        assert len(set(values)) == 1 and None not in values
    # Somebody else's stop on a corner node.
    for at in roadmap.nodes()[-3:].tolist():
        roadmap.insert(tuple(at))
    run.replan()
    roadmap.insert((7.0, 4.0))
    run.replan()
    assert (roadmap.graph.costs(0) > 0).all()


def test_the_search_refuses_edges_that_cost_nothing() -> None:
    graph = _core.Graph(1)
    graph.add_nodes(np.zeros((2, 2)))
    one = np.zeros(1, dtype=np.int32)
    graph.add_edges(one, one + 1, one)
    with pytest.raises(ValueError, match="positive"):
        graph.set_costs(0, one, np.zeros(1, dtype=np.int64))


# --- The first stop without a way


WALL = Map(bounds=BOX, walls=(((4.0, -1.0), (4.0, 9.0)),), wall_thickness=0.2)


def route(*stops: Point, letters: dict[int, Letter] | None = None) -> list[Service]:
    letters = letters or {}
    return [
        Service(at=at, own=f"t{i}", letter=letters.get(i, frozenset()))
        for i, at in enumerate(stops)
    ]


@pytest.mark.parametrize(
    ("stops", "blocked"),
    [
        ([(2, 2), (2, 6), (6, 6)], 2),
        ([(6, 6), (2, 2), (2, 6)], 0),
        ([(2, 2), (6, 6), (2, 6)], 1),  # not the one after it, though that has no way either
        ([(2, 2), (2, 6)], None),
    ],
)
def test_blocked_names_the_first_stop_without_a_way(
    stops: list[Point], blocked: int | None
) -> None:
    rules = rules_of(())
    planner = Planner(small_roadmap(WALL, points=60), rules, 0, (1.0, 1.0))
    plan = planner.begin((1.0, 1.0), route(*stops))
    assert plan.blocked == blocked
    if blocked:
        # What comes before it can still be driven and served; then there is one stop less.
        plan = planner.begin((1.0, 1.0), route(*stops[:blocked]))
        assert plan.blocked is None


def test_blocked_names_the_stop_whose_service_breaks_a_rule() -> None:
    rules = rules_of(("G !s1",))
    planner = Planner(small_roadmap(Map(bounds=BOX), points=30), rules, 0, (1.0, 1.0))
    services = route((2, 2), (3, 3), (4, 4), letters={1: frozenset({"s1"})})
    assert planner.begin((1.0, 1.0), services).blocked == 1


def test_blocked_names_the_last_stop_if_only_the_end_breaks_a_rule() -> None:
    rules = rules_of(("F s3",))
    planner = Planner(small_roadmap(Map(bounds=BOX), points=30), rules, 0, (1.0, 1.0))
    assert planner.begin((1.0, 1.0), route((2, 2), (3, 3))).blocked == 1
    done = route((2, 2), (3, 3), letters={0: frozenset({"s3"})})
    assert planner.begin((1.0, 1.0), done).blocked is None


def test_blocked_counts_the_remaining_stops_and_opens_again() -> None:
    rules = rules_of(())
    roadmap = small_roadmap(Map(bounds=BOX), points=80)
    planner = Planner(roadmap, rules, 0, (1.0, 1.0))
    planner.begin((1.0, 1.0), route((2.0, 2.0), (2.0, 6.0), (6.0, 6.0)))
    for to in planner.leg():
        planner.moved(to)
    planner.served(frozenset())
    bar = Obstacle(id="bar", kind="crate", polygon=((4, -1), (4.5, -1), (4.5, 9), (4, 9)))
    planner.update(roadmap.add_obstacle(bar))
    assert planner.replan(planner.position).blocked == 1
    planner.update(roadmap.remove_obstacle("bar"))
    assert planner.replan(planner.position).blocked is None


def test_a_broken_rule_blocks_the_next_stop() -> None:
    rules = rules_of(("G !lab",))
    zones = {"lab": ((3, 3), (4, 3), (4, 4), (3, 4))}
    roadmap = small_roadmap(Map(bounds=BOX), zones=zones, relevant=rules.relevant)
    planner = Planner(roadmap, rules, 0, (1.0, 1.0))
    assert planner.begin((1.0, 1.0), route((7, 7), (1, 7))).blocked is None
    planner.moved((3.5, 3.5))
    assert planner.replan((3.5, 3.5)).blocked == 0


def test_an_empty_route_needs_nothing() -> None:
    planner = Planner(small_roadmap(WALL, points=20), rules_of(()), 0, (1.0, 1.0))
    assert planner.begin((1.0, 1.0), []) == Plan(length=0.0, legs=())


def test_a_robot_at_its_stop_stays_there() -> None:
    planner = Planner(small_roadmap(WALL, points=40), rules_of(()), 0, (1.0, 1.0))
    plan = planner.begin((1.0, 1.0), route((1.0, 1.0), (1.0, 1.0), (2.0, 2.0)))
    assert plan.blocked is None
    assert plan.length == pytest.approx(2**0.5, rel=0.4)
    for _ in range(2):
        assert planner.leg() == []
        planner.served(frozenset())
    assert planner.leg()[-1] == (2.0, 2.0)


# --- String pulling


def along(way: list[Point]) -> float:
    return sum(float(np.hypot(b[0] - a[0], b[1] - a[1])) for a, b in pairwise(way))


@settings(max_examples=80, deadline=None)
@given(seed=SEEDS, texts=st.sampled_from(RULES))
def test_driven_routes_keep_clearance_rules_and_length(seed: int, texts: tuple[str, ...]) -> None:
    """Drive a route with obstacles coming and going; judge the whole drive independently."""
    rng = np.random.default_rng(seed)
    run = random_run(rng, texts, points=60)
    map, zones = run.roadmap.workspace, run.roadmap.zones
    mode = run.roadmap.modes[run.mode]
    whole = conjunction([parse(text) for text in texts])
    plan = run.planner.begin(run.at, run.services)
    last, word = run.services[-1].at, []
    while run.services and plan.blocked is None:
        raw = [tuple(at) for at in run.planner._plan.legs[0].tolist()]
        way = [run.at, *run.planner.leg()]
        assert way[-1] == run.services[0].at
        assert len(way) == len([at for k, at in enumerate(raw) if k == 0 or at != raw[k - 1]])
        assert along(way) <= along(raw) + 1e-9
        a, b = (np.array(part, dtype=float).reshape(-1, 2) for part in (way[:-1], way[1:]))
        c, d = (np.array(part, dtype=float) for part in (raw[:-1], raw[1:]))
        price = run.roadmap.workspace.length
        assert price(a, b, mode.motion).sum() <= price(c, d, mode.motion).sum() + 1e-9
        blocking = [o for o in map.obstacles.values() if mode.motion.blocked_by(o.kind)]
        for one, other in pairwise(way):
            assert gap(run.bare, blocking, one, other) >= mode.radius - 1e-6
        # Now and then something changes half way.
        stop_after = int(rng.integers(0, 2 * len(way)))
        for to in way[1 : stop_after + 1]:
            label = zones.labels(np.array([run.at]), np.array([to]))[0]
            word.append(zones.classes[label])
            run.move(to)
        # A way may pass its own stop to satisfy a rule elsewhere first, so arrival is its end.
        if stop_after >= len(way) - 1:
            word.append(run.services[0].letter)
            run.serve()
        if run.services:
            run.toggle(rng)
            plan = run.planner.replan(run.at)
            run.check(plan)
    if not run.services:
        assert holds(whole, word, [zones.at(last)])


def test_pulling_shortens_but_stays_out_of_zones() -> None:
    rules = rules_of(("G !lab",))
    zones = {"lab": ((3.0, 2.0), (5.0, 2.0), (5.0, 6.0), (3.0, 6.0))}
    roadmap = small_roadmap(Map(bounds=BOX), points=200, zones=zones, relevant=rules.relevant)
    planner = Planner(roadmap, rules, 0, (1.0, 4.0))
    plan = planner.begin((1.0, 4.0), route((7.0, 4.0)))
    way = [(1.0, 4.0), *planner.leg()]
    assert along(way) < plan.length - 0.01
    assert LineString(way).distance(Polygon(zones["lab"])) > 0.0


def test_pulling_in_the_open_gives_the_straight_line() -> None:
    roadmap = small_roadmap(Map(bounds=BOX), points=100)
    planner = Planner(roadmap, rules_of(()), 0, (0.5, 0.5))
    planner.begin((0.5, 0.5), route((0.6, 0.6), (7.5, 6.5)))
    assert planner.leg() == [(0.6, 0.6)]  # a stop in sight is driven to straight
    planner.moved((0.6, 0.6))
    planner.served(frozenset())
    way = planner.leg()
    assert len(way) > 2
    assert along([(0.6, 0.6), *way]) == pytest.approx(np.hypot(6.9, 5.9))
    assert planner._plan.length == pytest.approx(np.hypot(6.9, 5.9))


def test_a_robot_knows_its_way_ahead_between_waypoints() -> None:
    roadmap = small_roadmap(Map(bounds=BOX), points=100)
    planner = Planner(roadmap, rules_of(()), 0, (0.5, 0.5))
    planner.begin((0.5, 0.5), route((7.5, 6.5)))
    way = [(0.5, 0.5), *planner.leg()]
    for k, (a, b) in enumerate(pairwise(way)):
        left = along(way[k:])
        for share in (0.0, 0.1, 0.5, 0.9):
            planner.moved((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
            rest, on = planner.ahead()
            assert rest == pytest.approx(b)
            assert on == pytest.approx(left - along([a, b]))
    planner.moved(way[-1])
    assert planner.ahead() == (way[-1], 0.0)


# --- Which obstacles matter


def test_touches_what_comes_nearer_than_the_radius() -> None:
    roadmap = small_roadmap(Map(bounds=BOX), modes=(Mode(GROUND, 0.5), Mode(WADER, 0.5)))
    ground, wader = (Planner(roadmap, rules_of(()), mode, (1.0, 4.0)) for mode in (0, 1))
    for planner in (ground, wader):
        planner.begin((1.0, 4.0), route((7.0, 4.0)))
        planner.leg()

    def at(low: float, kind: str) -> Obstacle:
        return Obstacle(id="x", kind=kind, polygon=((3, low), (4, low), (4, low + 1), (3, low + 1)))

    assert ground.touches(at(4.4, "crate")) and ground.touches(at(3.5, "crate"))
    assert not ground.touches(at(4.6, "crate"))
    # What only costs extra matters when it is driven through.
    assert wader.touches(at(3.5, "water")) and not wader.touches(at(4.4, "water"))
    assert wader.touches(at(4.4, "crate"))
    flyer = Planner(
        small_roadmap(Map(bounds=BOX), modes=(Mode(FLYER, 0.5),)), rules_of(()), 0, (1, 4)
    )
    flyer.begin((1.0, 4.0), route((7.0, 4.0)))
    assert not flyer.touches(at(3.5, "bush")) and flyer.touches(at(3.5, "crate"))


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS)
def test_what_does_not_touch_leaves_the_plan_possible(seed: int) -> None:
    rng = np.random.default_rng(seed)
    run = random_run(rng, ())
    if run.planner.begin(run.at, run.services).blocked is not None:
        return
    run.planner.leg()
    mode = run.roadmap.modes[run.mode]
    for k in range(5):
        obstacle = random_obstacle(rng, f"x{k}", random_point(rng), 1.0)
        if run.planner.touches(obstacle):
            continue
        run.roadmap.add_obstacle(obstacle)
        for leg in run.planner._plan.legs:
            if len(leg) > 1:
                assert run.roadmap.workspace.free(leg[:-1], leg[1:], mode).all()


def test_served_legs_no_longer_count() -> None:
    roadmap = small_roadmap(Map(bounds=BOX), points=60)
    planner = Planner(roadmap, rules_of(()), 0, (1.0, 1.0))
    plan = planner.begin((1.0, 1.0), route((7.0, 1.0), (7.0, 7.0)))
    on_first = Obstacle(id="x", kind="crate", polygon=((0.5, 0.5), (1.5, 0.5), (1.5, 1.5)))
    assert planner.touches(on_first)
    for to in planner.leg():
        planner.moved(to)
    planner.served(frozenset())
    assert not planner.touches(on_first)
    assert planner._plan.length == pytest.approx(along(list(map(tuple, plan.legs[1]))))


# --- The maze


@pytest.fixture(scope="module")
def maze() -> Mission:
    return load(MAZE)


@pytest.mark.parametrize("corners", [True, False])
def test_repairs_in_the_maze(maze: Mission, corners: bool) -> None:
    rng = np.random.default_rng(8)
    rules = rules_of(())
    world = build(maze, Params(points=600, corners=corners), 1, relevant=rules.relevant)
    start = maze.robots[0].start
    stops = [stop.at for task in maze.tasks[5:8] for stop in task.stops]
    planner = Planner(world.roadmap, rules, 0, start)
    run = Run(world.roadmap, rules, planner, route(*stops), 0, bare=maze.map)
    before = run.check(planner.begin(start, run.services))
    assert before is not None
    for _ in range(12):
        event = rng.random()
        if event < 0.5:
            run.toggle(rng)
        elif event < 0.7:
            run.reprice(rng)
        elif run.services and planner._plan.blocked is None:
            run.drive(rng)
        if not run.services:
            break
        run.replan()


def test_the_same_seed_gives_the_same_plan(maze: Mission) -> None:
    def ways() -> list[list[list[float]]]:
        world = build(maze, Params(points=400), 3, relevant=frozenset())
        planner = Planner(world.roadmap, rules_of(()), 0, maze.robots[0].start)
        stops = [stop.at for task in maze.tasks[:3] for stop in task.stops]
        return [leg.tolist() for leg in planner.begin(maze.robots[0].start, route(*stops)).legs]

    assert ways() == ways()
