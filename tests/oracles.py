"""Slow, obviously right versions of what the package computes fast.

Each section restates a definition as directly as it can, shares no code with the package beyond
its value types, and is what the tests of a room compare against.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from collections.abc import Set as AbstractSet
from itertools import combinations, permutations, product

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely.geometry import LineString, Polygon, box
from shapely.geometry import Point as Spot

from oath.allocate.problem import Problem
from oath.model import Map, Obstacle
from oath.motion.buchi import Automaton
from oath.motion.ltl import Formula

# --- Selection --------------------------------------------------------------------------------


def path_length(problem: Problem, robot: int, picks: tuple[tuple[int, str], ...]) -> float:
    """Return the length of an open path from where the robot is; inf if it breaks a rule."""
    cost = problem.cost[problem.mode[robot]]
    at, load, length = problem.start[robot], 0, 0.0
    for place, (task, stop) in enumerate(picks):
        if stop == "delivery" and (task, "pickup") not in picks[:place]:
            return math.inf
        load += {"pickup": 1, "delivery": -1, "visit": 0}[stop]
        if load > problem.capacity[robot]:
            return math.inf
        there = problem.delivery[task] if stop == "delivery" else problem.pickup[task]
        length += cost[at, there]
        at = there
    return length


def shortest_selection(problem: Problem, robot: int, tasks: list[int], take: int) -> float:
    """Return the least length over all subsets of that size and all orders of their stops."""
    best = math.inf
    for subset in combinations(tasks, take):
        stops = [
            (task, stop)
            for task in subset
            for stop in (("visit",) if problem.visit[task] else ("pickup", "delivery"))
        ]
        lengths = (path_length(problem, robot, order) for order in permutations(stops))
        best = min(best, *lengths)
    return best


# --- Whole assignments ----------------------------------------------------------------------


def shortest_path(problem: Problem, robot: int, tasks: Sequence[int]) -> float:
    """Return the least length over all orders of all stops of these tasks; inf if there is none."""
    stops = [
        (task, stop)
        for task in tasks
        for stop in (("visit",) if problem.visit[task] else ("pickup", "delivery"))
    ]
    return min(path_length(problem, robot, order) for order in permutations(stops))


def best_assignment(problem: Problem, weight: float) -> tuple[int, float]:
    """Return the most tasks that can be served, and the least sum + weight * makespan for those.

    Tries every way to give each task to a robot that is able to do it, or to nobody. A robot's time
    is its length / speed plus the service of its tasks, so its shortest path is its best.
    """
    feasible, tasks = problem.feasible(), range(len(problem.tasks))
    work = problem.service_time * np.where(problem.visit, 1, 2)
    known: dict[tuple[int, tuple[int, ...]], float] = {}
    best = (0, 0.0)
    choices = [[-1, *np.flatnonzero(feasible[:, task]).tolist()] for task in tasks]
    for owners in product(*choices):
        total = latest = 0.0
        for robot in range(len(problem.robots)):
            mine = tuple(task for task in tasks if owners[task] == robot)
            if len(mine) > problem.max_tasks[robot]:
                total = math.inf
            if (robot, mine) not in known:
                known[robot, mine] = shortest_path(problem, robot, mine)
            length = known[robot, mine]
            total += length
            latest = max(latest, length / problem.speed[robot] + work[list(mine)].sum())
        served = len(tasks) - owners.count(-1)
        value = total + (weight * latest if weight else 0.0)
        if value < math.inf and (-served, value) < (-best[0], best[1]):
            best = (served, value)
    return best


class FleetProgram:
    """The whole problem as a mixed-integer linear program, for `scipy.optimize.milp`.

    Every robot r has a graph of its own over node 0 (where it is), 1 + i (first stop of task i) and
    1 + n + i (its last). Variables: x[r, a, b] = the robot goes from a to b; y[r, i] = it serves
    task i; u[r, a] = place of a node in its order; q[r, a] = its load after it; at the end the
    makespan. Order and load rise along legs in use (Miller, Tucker, Zemlin 1960).
    """

    def __init__(self, problem: Problem, weight: float) -> None:
        self.problem, self.weight = problem, weight
        self.n, self.nodes = len(problem.tasks), 1 + 2 * len(problem.tasks)
        self.columns: list[tuple[float, float, bool]] = []  # cost, greatest value, whole
        self.rows: list[tuple[dict[int, float], float, float]] = []
        self.makespan = self.column(weight, np.inf)
        self.serves: list[list[int]] = [[] for _ in range(self.n)]
        for robot in range(len(problem.robots)):
            self.add_robot(robot)
        for serves in self.serves:
            self.rows.append((dict.fromkeys(serves, 1.0), 1.0, 1.0))

    def column(self, cost: float, most: float, whole: bool = False) -> int:
        self.columns.append((cost, most, whole))
        return len(self.columns) - 1

    def add_robot(self, r: int) -> None:
        problem, n = self.problem, self.n
        cost, able = problem.cost[problem.mode[r]], problem.feasible()[r]
        at = [problem.start[r], *problem.pickup, *problem.delivery]
        real = [a for a in range(1, self.nodes) if a <= n or not problem.visit[a - 1 - n]]
        y = [self.column(0.0, float(able[i]), True) for i in range(n)]
        for i in range(n):
            self.serves[i].append(y[i])
        u = [self.column(0.0, 2.0 * n) for _ in range(self.nodes)]
        q = [self.column(0.0, float(problem.capacity[r])) for _ in range(self.nodes)]
        legs = {
            (a, b): self.column(cost[at[a], at[b]], 1.0, True)
            for a in [0, *real]
            for b in real
            if a != b and np.isfinite(cost[at[a], at[b]])
        }
        self.rows.append(({x: 1.0 for (a, _), x in legs.items() if a == 0}, 0.0, 1.0))
        self.rows.append((dict.fromkeys(y, 1.0), 0.0, float(problem.max_tasks[r])))
        for node in real:
            served = {y[(node - 1) % n]: -1.0}
            into = {x: 1.0 for (_, b), x in legs.items() if b == node}
            out = {x: 1.0 for (a, _), x in legs.items() if a == node}
            self.rows += [(into | served, 0.0, 0.0), (out | served, -np.inf, 0.0)]
        for (a, b), x in legs.items():
            change = 0.0 if problem.visit[(b - 1) % n] else 1.0 if b <= n else -1.0
            before = {} if a == 0 else {u[a]: -1.0}
            self.rows.append(({u[b]: 1.0, x: -2.0 * n - 1, **before}, -2.0 * n, np.inf))
            room = float(problem.capacity[r]) + 1.0
            loaded = {} if a == 0 else {q[a]: -1.0}
            self.rows.append(({q[b]: 1.0, x: -room, **loaded}, change - room, np.inf))
        for i in np.flatnonzero(~problem.visit).tolist():
            self.rows.append(({u[1 + n + i]: 1.0, u[1 + i]: -1.0, y[i]: -1.0}, 0.0, np.inf))
        time = {x: cost[at[a], at[b]] / problem.speed[r] for (a, b), x in legs.items()}
        work = problem.service_time * np.where(problem.visit, 1, 2)
        time |= {y[i]: float(work[i]) for i in range(n)}
        self.rows.append((time | {self.makespan: -1.0}, -np.inf, 0.0))

    def solve(self) -> float:
        """Return the least objective of serving every task; inf if that cannot be done."""
        cost, most, whole = (
            np.array(part, dtype=float) for part in zip(*self.columns, strict=True)
        )
        entries = [(i, j, v) for i, (row, _, _) in enumerate(self.rows) for j, v in row.items()]
        row, column, value = zip(*entries, strict=True)
        matrix = csr_array((value, (row, column)), shape=(len(self.rows), len(cost)))
        least, greatest = zip(*((low, high) for _, low, high in self.rows), strict=True)
        answer = milp(
            cost,
            integrality=whole,
            bounds=Bounds(0, most),
            constraints=LinearConstraint(matrix, least, greatest),
            options={"mip_rel_gap": 0.0},
        )
        return float(answer.fun) if answer.success else math.inf


# --- Linear temporal logic ------------------------------------------------------------------


def holds(
    formula: Formula, prefix: Sequence[AbstractSet[str]], loop: Sequence[AbstractSet[str]]
) -> bool:
    """Return whether the word ``prefix loop loop ...`` satisfies ``formula``.

    The textbook semantics, evaluated for every position of the lasso: from each of the n
    positions, the first n of its future hold every letter that will ever be read.
    """
    word = [*prefix, *loop]
    n = len(word)
    following = [i + 1 if i + 1 < n else len(prefix) for i in range(n)]
    futures = []
    for i in range(n):
        future = [i]
        while len(future) < n:
            future.append(following[future[-1]])
        futures.append(future)

    def until(left: list[bool], right: list[bool], future: list[int]) -> bool:
        return any(
            right[k] and all(left[j] for j in future[:step]) for step, k in enumerate(future)
        )

    def release(left: list[bool], right: list[bool], future: list[int]) -> bool:
        return all(right[k] or any(left[j] for j in future[:step]) for step, k in enumerate(future))

    def values(part: Formula) -> list[bool]:
        """Return the truth of `part` at each position."""
        if part.op == "atom":
            return [part.name in letter for letter in word]
        args = [values(arg) for arg in part.args]
        match part.op:
            case "true":
                return [True] * n
            case "false":
                return [False] * n
            case "!":
                return [not x for x in args[0]]
            case "&":
                return [all(column) for column in zip(*args, strict=True)]
            case "|":
                return [any(column) for column in zip(*args, strict=True)]
            case "->":
                return [not x or y for x, y in zip(*args, strict=True)]
            case "<->":
                return [x == y for x, y in zip(*args, strict=True)]
            case "X":
                return [args[0][i] for i in following]
            case "F":
                return [any(args[0][k] for k in future) for future in futures]
            case "G":
                return [all(args[0][k] for k in future) for future in futures]
        left, right = args
        match part.op:
            case "U":
                return [until(left, right, future) for future in futures]
            case "R":
                return [release(left, right, future) for future in futures]
            case "W":
                return [
                    until(left, right, future) or all(left[k] for k in future) for future in futures
                ]
            case "M":
                return [
                    release(left, right, future) and any(left[k] for k in future)
                    for future in futures
                ]
        raise AssertionError(part.op)

    return values(formula)[0]


# --- Workspace ------------------------------------------------------------------------------


def gap(map: Map, obstacles: Iterable[Obstacle], *way: tuple[float, float]) -> float:
    """Return how far a point, or the straight line between two, is from walls and obstacles."""
    shape = Spot(way[0]) if len(way) == 1 or way[0] == way[1] else LineString(way)
    distances = [math.inf]
    for wall in map.walls:
        line = LineString(wall) if len(set(wall)) > 1 else Spot(wall[0])
        distances.append(shape.distance(line) - map.wall_thickness / 2)
    distances += [shape.distance(Polygon(obstacle.polygon)) for obstacle in obstacles]
    if map.grid is not None:
        size, (x, y) = map.grid.resolution, map.grid.origin
        for row, column in np.argwhere(map.grid.occupied).tolist():
            left, low = x + column * size, y + row * size
            distances.append(shape.distance(box(left, low, left + size, low + size)))
    return max(min(distances), 0.0)


# --- Product search -------------------------------------------------------------------------


def stays_accepted(automaton: Automaton, letter: AbstractSet[str]) -> list[bool]:
    """Return for every state whether it accepts the letter repeated for ever."""
    n = automaton.states
    reach = np.zeros((n, n), dtype=bool)
    for source, label, target in automaton.edges:
        if label.positive <= letter and not label.negative & letter:
            reach[source, target] = True
    for via in range(n):  # Warshall's closure
        reach |= reach[:, via : via + 1] & reach[via : via + 1]
    again = [f for f in automaton.accepting if reach[f, f]]
    return [q in again or any(reach[q, f] for f in again) for q in range(n)]


class Product:
    """The explicit product of a graph, the rules' automaton and a chain of stops.

    Its nodes are (stops served, rule state, graph node). `ends` (m, 2), `costs` (m,) [um] and
    `letters` (m) describe the open edges; `stops` are pairs of a node and the letter that serving
    it reads; `last` is the letter for ever after.
    """

    def __init__(
        self,
        size: int,
        ends: np.ndarray,
        costs: np.ndarray,
        letters: Sequence[AbstractSet[str]],
        automaton: Automaton,
        avoid: AbstractSet[str],
        stops: Sequence[tuple[int, AbstractSet[str]]],
        last: AbstractSet[str],
    ) -> None:
        self.size, self.automaton, self.avoid, self.stops = size, automaton, avoid, stops
        arcs = [np.empty((0, 3), dtype=np.int64)]
        words = [" ".join(sorted(letter)) for letter in letters]
        for word in sorted(set(words)):
            mine = np.array([other == word for other in words])
            (a, b), c = ends[mine].T.astype(np.int64), costs[mine]
            for q, p in self.steps(set(word.split())):
                for served in range(len(stops)):
                    for one, other in ((a, b), (b, a)):
                        here, there = self.number(served, q, one), self.number(served, p, other)
                        arcs.append(np.stack([here, there, c], axis=1))
        for served, (node, letter) in enumerate(stops):
            for q, p in self.steps(letter):
                here, there = self.number(served, q, node), self.number(served + 1, p, node)
                arcs.append(np.array([[here, there, self.SERVICE]]))
        self.arcs = np.concatenate(arcs)
        ends_well = stays_accepted(automaton, last)
        self.goals = [
            self.number(len(stops), q, stops[-1][0])
            for q in range(automaton.states)
            if ends_well[q] and not last & avoid
        ]

    # A sparse matrix cannot tell an arc that costs nothing from none; this is taken off again.
    SERVICE = 1

    def number(self, served: int, q: int, node: np.ndarray | int) -> np.ndarray | int:
        return (served * self.automaton.states + q) * self.size + node

    def steps(self, letter: AbstractSet[str]) -> list[tuple[int, int]]:
        """Return how reading a letter may change the rule state."""
        if letter & self.avoid:
            return []
        pairs = {
            (source, target)
            for source, label, target in self.automaton.edges
            if label.positive <= letter and not label.negative & letter
        }
        return sorted(pairs)

    def distances(
        self, links: Sequence[tuple[int, int, AbstractSet[str]]], states: AbstractSet[int]
    ) -> np.ndarray:
        """Return the costs from the robot, who may drive the links (node, cost, letter)."""
        total = (len(self.stops) + 1) * self.automaton.states * self.size
        entries = [
            (total, self.number(0, p, node), cost + self.SERVICE)
            for node, cost, letter in links
            for q, p in self.steps(letter)
            if q in states
        ]
        first = np.array(entries, dtype=np.int64).reshape(-1, 3)
        source, target, weight = np.concatenate([self.arcs, first]).T
        # A sparse matrix adds up arcs that run side by side; only the cheapest of them counts.
        order = np.lexsort((weight, target, source))
        source, target, weight = source[order], target[order], weight[order]
        least = np.ones(len(order), dtype=bool)
        least[1:] = (np.diff(source) != 0) | (np.diff(target) != 0)
        matrix = csr_array(
            (weight[least].astype(float), (source[least], target[least])),
            shape=(total + 1, total + 1),
        )
        return dijkstra(matrix, indices=total)

    def cost(
        self, links: Sequence[tuple[int, int, AbstractSet[str]]], states: AbstractSet[int]
    ) -> tuple[int | None, int | None]:
        """Return the least cost [um] of serving every stop, and if there is none which blocks.

        The blocked stop is the first that no way serves; the last if only the end is not allowed.
        """
        found = self.distances(links, states)
        least = min((found[goal] for goal in self.goals), default=math.inf)
        if least < math.inf:
            return round(least) - self.SERVICE * (1 + len(self.stops)), None
        for served, (node, _) in enumerate(self.stops):
            served_here = [self.number(served + 1, q, node) for q in range(self.automaton.states)]
            if not np.isfinite(found[served_here]).any():
                return None, served
        return None, len(self.stops) - 1
