"""The roadmap: sampled points and corners joined by the Delaunay edges along which robots fit."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from oath import _core
from oath.model import Mission, Obstacle, Point
from oath.world.edges import along_curve, delaunay_edges, unique
from oath.world.halton import Density, Halton, Sampling, sample
from oath.world.workspace import Mode, Workspace, Zones, corners, polygon_corners

Array = NDArray[np.float64]
Edges = NDArray[np.int32]

MICRO = 1e6
"""Costs are integers [um]: sums are exact, so a repaired search equals a fresh one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """How a roadmap is made.

    `corners=False` and `bridges=False` are the ablations without corner nodes, and without the
    points that `Roadmap.connect` adds between components; `sampling` compares ways to sample.
    """

    points: int = 1000
    sampling: Sampling = "adaptive"
    bridges: bool = True
    density: Density = field(default_factory=Density)
    corners: bool = True
    margin: float = 0.01
    """Corner nodes keep this much more than the robot's radius [m]."""
    links: int = 14
    """Nodes that an inserted node is joined to, if that many are in sight."""
    sights: int = 32
    """Nearest corner nodes that corner nodes and inserted nodes look at; those seen are joined."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seconds:
    """Wall clock of the stages of a build [s]."""

    sampling: float
    triangulation: float
    collision: float

    @property
    def total(self) -> float:
        """All stages [s]."""
        return self.sampling + self.triangulation + self.collision


class Roadmap:
    """Nodes and edges through a workspace, with one travel cost per edge and mode.

    Nodes and edges are only appended, never renumbered. A change of the workspace changes costs.

    Parameters
    ----------
    workspace, zones
        What blocks robots, and what their moves make true.
    modes
        The ways of travelling of all robots.
    """

    def __init__(
        self,
        workspace: Workspace,
        zones: Zones,
        modes: Sequence[Mode],
        params: Params,
        rng: np.random.Generator,
        *,
        corner_points: Array,
    ) -> None:
        self.workspace, self.zones, self.params = workspace, zones, params
        self.modes = tuple(modes)
        self.graph = _core.Graph(len(modes))
        self._sequence = Halton(workspace.bounds, rng)
        self._node_at: dict[Point, int] = {}
        self.version = 0  # rises whenever a cost or an edge changes
        self._around: dict[Point, int] = {}  # corner nodes of obstacles that were added
        self._gone: set[int] = set()  # nodes that were tried out and stand alone for good
        # Whether a sample joins two components is asked for every one of thousands.
        self._components: dict[tuple[int, frozenset[str]], NDArray[np.int32]] = {}
        self._components_of = (-1, -1)
        begin = time.perf_counter()
        motions = [mode.motion for mode in modes]
        nodes = sample(workspace, motions, params.points, params.density, rng, params.sampling)
        self.sampled = len(nodes)
        nodes = np.concatenate([nodes, self._useful(corner_points)])
        order = along_curve(nodes)
        nodes = nodes[order]
        self._corners = np.flatnonzero(order >= self.sampled)
        self._corner_tree = cKDTree(nodes[self._corners]) if len(self._corners) else None
        self.graph.add_nodes(nodes)
        sampled = time.perf_counter()
        pairs = delaunay_edges(nodes)
        sights = self._sights(nodes[self._corners], self._corners)
        pairs = unique(np.concatenate([pairs, sights]), len(nodes))
        triangulated = time.perf_counter()
        self._add_edges(pairs)
        self.seconds = Seconds(
            sampling=sampled - begin,
            triangulation=triangulated - sampled,
            collision=time.perf_counter() - triangulated,
        )

    # -- what there is

    def nodes(self) -> Array:
        """Positions (n, 2) [m]."""
        nodes: Array = self.graph.points()
        return nodes

    def edges(self, mode: int | None = None) -> Edges:
        """Nodes (m, 2) of the edges open in a mode, or in any."""
        ends: Edges = self.graph.ends()
        modes = range(len(self.modes)) if mode is None else [mode]
        is_open = np.zeros(len(ends), dtype=np.bool_)
        for m in modes:
            is_open |= self.graph.costs(m) < _core.UNREACHABLE
        return ends[is_open]

    def components(self, mode: int, avoid: frozenset[str] = frozenset()) -> NDArray[np.int32]:
        """Component (n,) of every node over a mode's open edges that touch nothing to avoid."""
        n, key = self.graph.size, (mode, avoid)
        if self._components_of != (self.version, n):
            self._components_of = (self.version, n)
            self._components.clear()
        if key not in self._components:
            is_open = self.graph.costs(mode) < _core.UNREACHABLE
            if avoid:
                is_open &= np.array(self.allowed(avoid), dtype=np.bool_)[self.graph.labels()]
            a, b = self.graph.ends()[is_open].T
            matrix = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(n, n))
            self._components[key] = connected_components(matrix, directed=False)[1]
        return self._components[key]

    def parts(self, mode: int) -> int:
        """How many parts the edges open in a mode fall into; nodes without such an edge are none.

        In the mode of a ground robot, the nodes that a drone has above a bush are of that kind.
        """
        return len(np.unique(self.components(mode)[self.edges(mode)[:, 0]]))

    def travel(
        self,
        mode: int,
        sources: Sequence[int],
        targets: Sequence[int],
        avoid: frozenset[str] = frozenset(),
    ) -> Array:
        """Travel costs (sources, targets) [m] that touch no atom to avoid; inf = unreachable."""
        micro = self.graph.travel(mode, list(sources), list(targets), self.allowed(avoid))
        return np.where(micro < _core.UNREACHABLE, micro / MICRO, np.inf)

    def allowed(self, avoid: frozenset[str]) -> list[int]:
        """Flag the label classes that touch no atom to avoid."""
        return [int(not (atoms & avoid)) for atoms in self.zones.classes]

    # -- what changes

    def insert(self, at: Point) -> int:
        """Return the node at a point [m]; if there is none, add it and join it to those in sight.

        The node may stay alone where no robot fits; nothing else changes.
        """
        if at not in self._node_at:
            self._node_at[at] = self.graph.size
            self._append(np.array([at], dtype=float))
        return self._node_at[at]

    def add_obstacle(self, obstacle: Obstacle) -> NDArray[np.int32]:
        """Put an obstacle in; return the edges whose cost changed in some mode.

        Corner nodes are appended around it, so that there is a way past it wherever a robot fits.
        """
        self.workspace.add(obstacle)
        changed = self._refresh(obstacle)
        if self.params.corners:
            before = self.graph.edges
            around = [(x, y) for x, y in self._useful(self._corners_of(obstacle)).tolist()]
            # An obstacle that comes back finds its corner nodes where it left them.
            again = self._revive([self._around[at] for at in around if at in self._around])
            for at in around:
                if at not in self._around:
                    self._around[at] = self.graph.size
                    self._append(np.array([at]))
            new = np.arange(before, self.graph.edges, dtype=np.int32)
            changed = np.concatenate([changed, again, new])
        return changed

    def remove_obstacle(self, id: str) -> NDArray[np.int32]:
        """Take an obstacle out; return the edges whose cost changed in some mode."""
        return self._refresh(self.workspace.remove(id))

    @contextmanager
    def trial(self) -> Iterator[None]:
        """Try changes out: at the end everything costs again what it cost before.

        Nodes that came meanwhile are left alone, without a way to them.
        """
        nodes, edges, version = self.graph.size, self.graph.edges, self.version
        costs = [self.graph.costs(mode) for mode in range(len(self.modes))]
        obstacles, node_at = dict(self.workspace.obstacles), dict(self._node_at)
        try:
            yield
        finally:
            self._node_at = node_at
            self._gone.update(range(nodes, self.graph.size))
            if self.version != version:
                for id, obstacle in list(self.workspace.obstacles.items()):
                    if obstacles.get(id) != obstacle:
                        self.workspace.remove(id)
                for id, obstacle in obstacles.items():
                    if id not in self.workspace.obstacles:
                        self.workspace.add(obstacle)
                self._reset(costs, edges)

    def links(
        self, at: Point, mode: int, towards: Sequence[int] = ()
    ) -> tuple[list[int], list[int], list[int]]:
        """Nodes that a robot at a point can drive to straight, their costs [um] and labels.

        These are the nearest nodes in sight, and of the nearest corner nodes and the nodes
        `towards` which the robot drives those in sight: the way may lead straight there.
        """
        here = np.array([at], dtype=float)
        far = np.concatenate([self._sights(here, np.array([-1]))[:, 1], towards]).astype(np.intp)
        a, b = np.repeat(here, len(far), axis=0), self.nodes()[far]
        far = far[self.workspace.free(a, b, self.modes[mode])]
        seen = np.unique(np.concatenate([self._in_sight(here[0], self.modes[mode]), far]))
        a, b = np.repeat(here, len(seen), axis=0), self.nodes()[seen]
        costs = self._micro(a, b, self.modes[mode])
        return seen.tolist(), costs.tolist(), self.zones.labels(a, b).tolist()

    def near(self, at: Point, mode: int, avoid: frozenset[str] = frozenset()) -> tuple[int, ...]:
        """The node at a point; if there is none, those that a robot there can drive to straight."""
        if at in self._node_at:
            return (self._node_at[at],)
        nodes, _, labels = self.links(at, mode)
        allowed = self.allowed(avoid)
        return tuple(node for node, label in zip(nodes, labels, strict=True) if allowed[label])

    def connect(self, wanted: Mapping[int, Sequence[int]]) -> None:
        """Sample on between components until, per mode, the wanted nodes hang together.

        `wanted` gives each mode's nodes. What still does not hang together after a bounded effort
        stays apart; the caller names it.
        """
        count = max(200, self.params.points // 4)
        for _ in range(6):
            apart = [m for m, nodes in wanted.items() if self._apart(m, nodes)]
            if not apart:
                return
            self._append(self._bridges(apart, count), bridges_only=True)
            count *= 2

    # -- inside

    def _reset(self, costs: Sequence[NDArray[np.int64]], edges: int) -> None:
        """Give edges their old costs, and close all that are newer."""
        self.version += 1
        every = np.arange(self.graph.edges, dtype=np.int32)
        for mode, old in enumerate(costs):
            new = np.full(len(every), _core.UNREACHABLE, dtype=np.int64)
            new[:edges] = old
            self.graph.set_costs(mode, every, new)

    def _revive(self, nodes: Sequence[int]) -> NDArray[np.int32]:
        """Open the edges of nodes that were only tried out so far; return those that changed."""
        gone = self._gone.intersection(nodes)
        if not gone:
            return np.empty(0, dtype=np.int32)
        self._gone -= gone
        ends = self.graph.ends()
        edges = np.flatnonzero(np.isin(ends, list(gone)).any(axis=1)).astype(np.int32)
        return self._reprice(edges)

    def _apart(self, mode: int, nodes: Sequence[int]) -> bool:
        return len(set(self.components(mode)[list(nodes)].tolist())) > 1

    def _bridges(self, modes: Sequence[int], count: int) -> Array:
        candidates = self._sequence.take(count)
        keep = np.zeros(count, dtype=np.bool_)
        for mode in (self.modes[m] for m in modes):
            keep |= self.workspace.clearance(candidates, mode.motion, 1.0) >= mode.radius
        return candidates[keep]

    def _useful(self, points: Array) -> Array:
        """The points inside the bounds where some robot fits, each once."""
        x0, y0, x1, y1 = self.workspace.bounds
        x, y = points.T
        points = points[(x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)]
        keep = np.zeros(len(points), dtype=np.bool_)
        for mode in self.modes:
            keep |= self.workspace.clearance(points, mode.motion, 2 * mode.radius) >= mode.radius
        return np.unique(np.round(points[keep], 6), axis=0)

    def _corners_of(self, obstacle: Obstacle) -> Array:
        offsets = sorted({mode.radius for mode in self.modes})
        points = [
            point
            for radius in offsets
            for point in polygon_corners(obstacle.polygon, radius + self.params.margin)
        ]
        return np.array(points, dtype=float).reshape(-1, 2)

    def _in_sight(self, at: Array, mode: Mode, *, bare: bool = False) -> NDArray[np.intp]:
        """Nearest nodes to which a robot can drive straight; looks further while it finds none.

        `bare` sees through whatever may go away again.
        """
        workspace = self.workspace
        blocked = workspace.permanent() if bare else workspace.blocked(mode.motion)
        look = 4 * self.params.links
        nodes = self.nodes()
        while True:
            near = self._nearest(at, look)
            a = np.repeat(at[None], len(near), axis=0)
            free = workspace.core.free(a, nodes[near], mode.radius, blocked).astype(np.bool_)
            seen = np.asarray(near[free], dtype=np.intp)
            if len(seen) or look >= min(self.graph.size, 4096):
                return seen[: self.params.links]
            look *= 4

    def _nearest(self, at: Array, count: int) -> NDArray[np.int32]:
        """The nodes nearest to a point, but those that were only tried out."""
        more = count
        while True:
            near = self.graph.nearest(at[0], at[1], more)
            if self._gone:
                near = near[[node not in self._gone for node in near.tolist()]]
            if len(near) >= count or more >= self.graph.size:
                return near[:count]
            more *= 2

    def _sights(self, points: Array, nodes: NDArray[np.intp]) -> NDArray[np.int64]:
        """Pairs (m, 2) of each point's node and the corner nodes nearest to it."""
        if self._corner_tree is None or not len(points):
            return np.empty((0, 2), dtype=np.int64)
        _, near = self._corner_tree.query(points, k=min(self.params.sights, len(self._corners)))
        near = self._corners[near.reshape(len(points), -1)]
        pairs = np.stack([np.repeat(nodes, near.shape[1]), near.ravel()], axis=1).astype(np.int64)
        different: NDArray[np.int64] = pairs[pairs[:, 0] != pairs[:, 1]]
        return different

    def _append(self, points: Array, *, bridges_only: bool = False) -> None:
        """Append nodes and join each to the nodes in sight in any mode.

        Those in sight once all obstacles are gone are joined too, by edges that are blocked until
        then: a stop under an obstacle must not stay cut off when the obstacle is taken away.
        """
        for at in points:
            seen = [self._in_sight(at, mode) for mode in self.modes]
            if bridges_only and not self._joins(seen):
                continue
            if self.workspace.obstacles:
                seen += [self._in_sight(at, mode, bare=True) for mode in self.modes]
            joined = np.unique(np.concatenate(seen)) if seen else np.empty(0, dtype=np.intp)
            self.graph.add_nodes(at[None])
            new = np.array([self.graph.size - 1])
            pairs = np.stack([np.repeat(new, len(joined)), joined], axis=1)
            pairs = np.concatenate([pairs, self._sights(at[None], new)])
            pairs = unique(pairs, self.graph.size)
            self._add_edges(pairs)

    def _joins(self, seen: Sequence[NDArray[np.intp]]) -> bool:
        """Whether the nodes in sight lie in different components of some mode."""
        return any(len(set(self.components(m)[nodes].tolist())) > 1 for m, nodes in enumerate(seen))

    def _micro(self, a: Array, b: Array, mode: Mode) -> NDArray[np.int64]:
        length = self.workspace.length(a, b, mode.motion)
        micro: NDArray[np.int64] = np.ceil(length * MICRO).astype(np.int64)
        return micro

    def _add_edges(self, pairs: NDArray[np.integer]) -> None:
        nodes = self.nodes()
        a, b = nodes[pairs[:, 0]], nodes[pairs[:, 1]]
        # An edge through a wall is blocked for good; one through an obstacle may open again.
        least = min(mode.radius for mode in self.modes)
        core = self.workspace.core
        keep = core.free(a, b, least, self.workspace.permanent()).astype(np.bool_)
        pairs, a, b = pairs[keep], a[keep], b[keep]
        first = self.graph.edges
        one, other = np.ascontiguousarray(pairs.T, dtype=np.int32)
        self.graph.add_edges(one, other, self.zones.labels(a, b))
        self._price(np.arange(first, self.graph.edges, dtype=np.int32), a, b)

    def _price(self, edges: NDArray[np.int32], a: Array, b: Array) -> NDArray[np.bool_]:
        """Set the costs of edges with these ends in every mode; tell which changed."""
        self.version += 1
        changed = np.zeros(len(edges), dtype=np.bool_)
        for m, mode in enumerate(self.modes):
            costs = np.full(len(edges), _core.UNREACHABLE, dtype=np.int64)
            free = self.workspace.free(a, b, mode)
            # Nodes may coincide, but an edge always costs something: the search relies on it.
            costs[free] = np.maximum(self._micro(a[free], b[free], mode), 1)
            changed |= costs != self.graph.costs(m)[edges]
            self.graph.set_costs(m, edges, costs)
        return changed

    def _refresh(self, obstacle: Obstacle) -> NDArray[np.int32]:
        reach = max(mode.radius for mode in self.modes)
        corner = np.array(obstacle.polygon)
        low, high = corner.min(axis=0) - reach, corner.max(axis=0) + reach
        # On which sides of the box a node lies: an edge with both ends on one side stays outside.
        (x, y), ends = self.nodes().T, self.graph.ends()
        sides = (x < low[0]) | (x > high[0]) * 2 | (y < low[1]) * 4 | (y > high[1]) * 8
        touched = np.flatnonzero((sides[ends[:, 0]] & sides[ends[:, 1]]) == 0).astype(np.int32)
        return self._reprice(touched)

    def _reprice(self, edges: NDArray[np.int32]) -> NDArray[np.int32]:
        """Price edges anew; return those whose cost changed in some mode."""
        nodes, ends = self.nodes(), self.graph.ends()[edges]
        return edges[self._price(edges, nodes[ends[:, 0]], nodes[ends[:, 1]])]


@dataclass(frozen=True, slots=True)
class World:
    """A mission's roadmap with its stops on it."""

    roadmap: Roadmap
    mode_of: Mapping[str, int]
    """Mode of each robot."""
    stops: dict[Point, int] = field(default_factory=dict)
    """Node of each stop's and robot start's point."""


def build(
    mission: Mission, params: Params | None = None, seed: int = 0, *, relevant: frozenset[str]
) -> World:
    """Build a mission's roadmap, put every start and stop on it, and connect them.

    `relevant` are the atoms that the rules speak of. Known obstacles are in, unknown ones are not.
    """
    params = params or Params()
    modes: dict[Mode, int] = {}
    mode_of = {
        robot.id: modes.setdefault(Mode(mission.motions[robot.motion], robot.radius), len(modes))
        for robot in mission.robots
    }
    rng = np.random.default_rng(seed)
    workspace = Workspace(mission.map)
    zones = Zones(mission.map.bounds, mission.zones, mission.places, relevant)
    around = _mission_corners(mission, workspace, list(modes), params)
    roadmap = Roadmap(workspace, zones, list(modes), params, rng, corner_points=around)
    world = World(roadmap, mode_of)
    wanted: dict[int, set[int]] = {m: set() for m in modes.values()}
    for robot in mission.robots:
        world.stops[robot.start] = roadmap.insert(robot.start)
        wanted[mode_of[robot.id]].add(world.stops[robot.start])
    for task in mission.tasks:
        for stop in task.stops:
            world.stops[stop.at] = roadmap.insert(stop.at)
            for robot in mission.robots:
                if task.type in robot.can:
                    wanted[mode_of[robot.id]].add(world.stops[stop.at])
    for place in sorted(relevant & mission.places.keys()):
        roadmap.insert(mission.places[place])  # only an edge that ends there visits it
    if params.bridges:
        roadmap.connect({m: sorted(nodes) for m, nodes in wanted.items()})
    return world


def _mission_corners(
    mission: Mission, workspace: Workspace, modes: Sequence[Mode], params: Params
) -> Array:
    if not params.corners:
        return np.empty((0, 2))
    obstacles = workspace.obstacles.values()
    parts = [
        corners(mission.map, obstacles, radius + params.margin, 2 * radius)
        for radius in sorted({mode.radius for mode in modes})
    ]
    return np.concatenate(parts)
