"""Plans of routes on the roadmap, repaired when it changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString
from shapely import Polygon as ShapelyPolygon

from oath import _core
from oath.model import Obstacle, Point
from oath.motion.mission_automaton import Letter, RouteAutomaton, Rules
from oath.world.roadmap import Roadmap

Array = NDArray[np.float64]

_SAME = 1e-9
"""Points this near to each other are one [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Service:
    """A stop of a route as the planner sees it: where, its own atom, what serving it makes true."""

    at: Point
    own: str
    letter: Letter = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What remains of a route as waypoints on the roadmap.

    `legs` holds the waypoints (n, 2) [m] of every leg, from where the last one ended to its stop;
    `length` is their sum [m]. If there is no way, there are no legs, and `blocked` is the index
    among the remaining stops of the one that cannot be reached (or only by breaking a rule).
    """

    length: float
    legs: tuple[Array, ...]
    blocked: int | None = None


class Planner:
    """Plans one robot's routes, one after another, and keeps track of the rules on the way.

    Parameters
    ----------
    roadmap, rules
        Shared by all robots; the roadmap may change, the rules may not.
    mode
        The robot's mode of travel on the roadmap.
    at
        Where the robot starts [m].
    """

    def __init__(self, roadmap: Roadmap, rules: Rules, mode: int, at: Point) -> None:
        self.roadmap, self.rules, self.mode = roadmap, rules, mode
        self.position = at
        self._states = frozenset(rules.automaton.initial)
        self._services: tuple[Service, ...] = ()
        self._core: _core.Planner | None = None
        self._labels_known = self._edges_known = 0
        self._leg = 0
        self._pending: list[NDArray[np.int32]] = []
        self._plan = Plan(length=0.0, legs=())
        self._joins: Point | None = None  # where the move under way ends and the plan begins

    def begin(self, at: Point, services: Sequence[Service]) -> Plan:
        """Plan a new route from a point [m]; a robot on the move names where the move ends."""
        self._services, self._core, self._leg = tuple(services), None, 0
        return self.replan(at)

    def replan(self, at: Point) -> Plan:
        """Repair the plan of what remains of the route, from a point [m]."""
        self._joins = at if at != self.position else None
        core = self._searcher()
        states = self._after_driving_to(at)
        flags = [int(q in states) for q in range(self.rules.automaton.states)]
        goals = [self.roadmap.insert(service.at) for service in self._services[self._leg :][:1]]
        nodes, costs, labels = self.roadmap.links(at, self.mode, goals)
        if len(self.roadmap.zones.classes) > self._labels_known:
            core = self._searcher()
        if (edges := self.roadmap.graph.edges) > self._edges_known:  # others inserted their stops
            self._pending.append(np.arange(self._edges_known, edges, dtype=np.int32))
            self._edges_known = edges
        core.start(self._leg, at[0], at[1], nodes, costs, labels, flags)
        if self._pending:
            core.changed(np.concatenate(self._pending).tolist())
            self._pending.clear()
        reached = bool(states) and core.plan() < _core.UNREACHABLE
        if reached:
            self._plan = self._waypoints(core.path(), at)
        else:
            blocked = core.blocked - self._leg if states else 0
            self._plan = Plan(length=0.0, legs=(), blocked=blocked)
        return self._plan

    def update(self, edges: NDArray[np.int32]) -> None:
        """Note edges whose cost changed; the next `replan` repairs what they touch."""
        if self._core is not None and len(edges):
            self._pending.append(edges)

    def touches(self, obstacle: Obstacle) -> bool:
        """Whether the way to the plan or what remains of it comes too near to what blocks."""
        mode = self.roadmap.modes[self.mode]
        if mode.motion.blocked_by(obstacle.kind):
            polygon, reach = ShapelyPolygon(obstacle.polygon), mode.radius
        elif obstacle.kind in mode.motion.cost:
            polygon, reach = ShapelyPolygon(obstacle.polygon), 0.0
        else:
            return False
        ways: list[Array | list[Point]] = [leg for leg in self._plan.legs if len(leg) > 1]
        if self._joins is not None:
            ways.append([self.position, self._joins])
        lines = [LineString(way) for way in ways]
        return any(line.distance(polygon) <= reach for line in lines)

    def leg(self) -> list[Point]:
        """The current leg's waypoints [m] after string pulling, the start left out.

        Every edge of the roadmap path stays one waypoint; pulling moves it onto the straight line.
        """
        way = _distinct(self._plan.legs[0])
        pulled = self._pull(way)
        self._plan = _plan((pulled, *self._plan.legs[1:]))
        points = [(float(x), float(y)) for x, y in pulled[1:]]
        if points:
            points[-1] = self._services[self._leg].at
        return points

    def ahead(self) -> tuple[Point, float]:
        """Where a robot that drives along the plan ends its current move, and how far it is on [m].

        The way on is that from there to the current leg's stop.
        """
        way = self._ahead()
        if self._joins is not None:
            return self._joins, _length(self._plan.legs[0] if self._plan.legs else way)
        on = way[1:] if len(way) > 1 else way
        return (float(on[0, 0]), float(on[0, 1])), _length(on)

    def way(self) -> list[Point]:
        """What is left of the current leg's waypoints [m], from where the robot was last seen."""
        return [(float(x), float(y)) for x, y in self._ahead()]

    def at_stop(self) -> str | None:
        """The atom of the current leg's stop, if the robot has come to it."""
        # A leg may lead from its stop round and back, for a rule's sake.
        if self._joins is not None or not self._plan.legs or _length(self._ahead()) > 0.0:
            return None
        stop = self._services[self._leg]
        return stop.own if stop.at == self.position else None

    def _ahead(self) -> Array:
        """What is left of the current leg, from where the robot was last seen."""
        here = np.array([self.position])
        if not self._plan.legs:
            return here
        way = self._plan.legs[0]
        sides = shapely.linestrings(np.stack([way[:-1], way[1:]], axis=1))
        away = shapely.distance(sides, shapely.points(here))
        on = int(np.argmax(away <= away.min(initial=np.inf) + _SAME)) if len(away) else -1
        ahead = way[on + 1 :]
        if len(ahead) > 1 and np.hypot(*(ahead[0] - here[0])) <= _SAME:
            ahead = ahead[1:]  # it stands on the waypoint
        return np.concatenate([here, ahead])

    def moved(self, to: Point) -> None:
        """The robot drove straight from where it was to a point [m]."""
        self._states = self._after_driving_to(to)
        self.position = to
        if to == self._joins:
            self._joins = None

    def served(self, letter: Letter) -> None:
        """The robot served the current leg's stop, which made a letter true."""
        self._states = self.rules.step(self._states, letter)
        self._leg += 1
        self._plan = _plan(self._plan.legs[1:])

    # -- inside

    def _after_driving_to(self, at: Point) -> frozenset[int]:
        if at == self.position:
            return self._states
        zones = self.roadmap.zones
        if not zones.atoms:
            return self.rules.step(self._states, zones.classes[0])
        label = zones.labels(np.array([self.position]), np.array([at]))[0]
        return self.rules.step(self._states, zones.classes[label])

    def _searcher(self) -> _core.Planner:
        """The search of the current route, made anew when labels occur that it does not know."""
        classes = self.roadmap.zones.classes
        if self._core is None or len(classes) > self._labels_known:
            targets = [self.roadmap.insert(service.at) for service in self._services]
            automaton = RouteAutomaton(self.rules, [(s.own, s.letter) for s in self._services])
            last = self._services[-1].at if self._services else self.position
            self._core = _core.Planner(
                self.roadmap.graph,
                self.mode,
                automaton.drive(classes),
                targets,
                automaton.serve(),
                automaton.settled(self.roadmap.zones.at(last)),
            )
            self._labels_known = len(classes)
            self._edges_known = self.roadmap.graph.edges
            self._pending.clear()
        return self._core

    def _waypoints(self, path: NDArray[np.int32], at: Point) -> Plan:
        nodes = self.roadmap.nodes()
        legs, way = [], [np.array(at, dtype=float)]
        for _, node, _ in path.tolist():
            if node >= 0:
                way.append(nodes[node])
            else:
                legs.append(np.array(way))
                way = way[-1:]
        return _plan(tuple(legs))

    def _pull(self, way: Array) -> Array:
        labels = self.roadmap.zones.labels(way[:-1], way[1:])
        # Only stretches that touch no zone are pulled: the letters stay what was planned.
        cuts = [0, *(np.flatnonzero(np.diff(labels) != 0) + 1).tolist(), len(labels)]
        parts = [way[:1]]
        for first, last in pairwise(cuts):
            part = way[first : last + 1]
            if first < last and labels[first] == 0:
                part = self._straighten(part)
            parts.append(part[1:])
        return np.concatenate(parts)

    def _straighten(self, way: Array) -> Array:
        workspace, zones = self.roadmap.workspace, self.roadmap.zones
        mode = self.roadmap.modes[self.mode]
        kept = _core.pull(
            np.ascontiguousarray(way),
            workspace.core,
            mode.radius,
            workspace.blocked(mode.motion),
            workspace.costly(mode.motion),
            zones.core,
            zones.all,
        )
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
        out = way.copy()
        for first, last in pairwise(kept.tolist()):
            span = along[last] - along[first]
            share = (along[first + 1 : last] - along[first]) / span
            out[first + 1 : last] = way[first] + share[:, None] * (way[last] - way[first])
        return out


def _plan(legs: tuple[Array, ...]) -> Plan:
    """The plan along these legs."""
    return Plan(length=sum(map(_length, legs)), legs=legs)


def _length(way: Array) -> float:
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


def _distinct(way: Array) -> Array:
    """Leave out waypoints that repeat the one before."""
    keep = np.ones(len(way), dtype=np.bool_)
    keep[1:] = np.any(np.diff(way, axis=0) != 0, axis=1)
    return way[keep]
