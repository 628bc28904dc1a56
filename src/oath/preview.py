"""What commands would do to the robots' routes, before anybody confirms them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from oath.allocate import Allocator, Budget, ByPriority, checked
from oath.commands import Command, Live, Trial
from oath.events import AnyEvent, ObstacleAdded, ObstacleRemoved, TaskAdded
from oath.model import Route
from oath.scene import UnderWay, pose
from oath.state import State

ITERATIONS = 1000
"""Of the search for routes that the preview is based on: enough to name the robots."""

SHOWN = 0.05
"""Routes whose length changes less than this are not mentioned [m]."""


def preview(
    live: Live,
    commands: Sequence[Command],
    under_way: Mapping[str, UnderWay],
    allocator: Allocator,
    seed: int = 0,
) -> tuple[str, ...]:
    """Say who could do what is added, and how routes would change, in plain words.

    Nothing changes. The routes that come about may differ: the real search looks longer.

    Raises
    ------
    BadInput
        If one of the commands is not possible.
    """
    with Trial(live) as trial:
        before = _lengths(live, under_way)
        events = trial.admit(commands).events
        after = trial.live
        if all(isinstance(event, ObstacleAdded | ObstacleRemoved) for event in events[1::2]):
            routes = {id: robot.route for id, robot in after.state.robots.items()}
        else:
            problem = pose(after.scene, after.state, under_way)
            budget, rng = Budget(iterations=ITERATIONS), np.random.default_rng(seed)
            routes = dict(checked(ByPriority(allocator), problem, budget, rng).routes)
        lengths = _lengths(after, under_way, routes)
        able = [*_able(after, events)]
    return (*able, *_changes(after.state, routes, before, lengths))


def _able(live: Live, events: Sequence[AnyEvent]) -> Iterator[str]:
    """Who can do the tasks that are added."""
    for event in events:
        if isinstance(event, TaskAdded):
            robots = [
                robot.id
                for robot in live.scene.mission.robots
                if robot.can.get(event.task.type, 0.0) > 0 and robot.id not in live.state.failed
            ]
            yield f"{' or '.join(robots)} can do {event.task.id}"


def _changes(
    state: State,
    routes: Mapping[str, Route],
    before: Mapping[str, float],
    after: Mapping[str, float],
) -> Iterator[str]:
    for id, route in routes.items():
        old = state.robots[id].route
        turns = route[:1] != old[:1]
        if turns and route and state.tasks[route[0].task].priority == "high":
            yield f"{id} goes to {route[0].task} next"
        change = after[id] - before[id]
        if not np.isfinite(change):
            yield f"{id} has no way left for its route"
        elif abs(change) >= SHOWN:
            grows = "grows" if change > 0 else "shrinks"
            yield f"{id}'s route {grows} by {abs(change):.1f} m"


def _lengths(
    live: Live, under_way: Mapping[str, UnderWay], routes: Mapping[str, Route] | None = None
) -> dict[str, float]:
    """How far each robot would drive from where its current move ends [m]."""
    lengths = {}
    scene, state = live.scene, live.state
    roadmap = scene.world.roadmap
    for id, robot in state.robots.items():
        route = robot.route if routes is None else routes[id]
        stops = [state.tasks[stop.task].stop(stop.stop).at for stop in route]
        here = under_way[id].rest if id in under_way else live.pose(id)
        nodes = [roadmap.insert(at) for at in (here, *stops)]
        mode = scene.world.mode_of[id]
        costs = scene.travel.between(mode, nodes)
        lengths[id] = float(sum(costs[i, i + 1] for i in range(len(stops))))
    return lengths
