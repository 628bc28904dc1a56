"""Travel costs kept between rounds are those of the roadmap as it is now."""

from __future__ import annotations

import numpy as np
import pytest

from oath.formats.mission import load
from oath.model import Obstacle
from oath.world.roadmap import Params, World, build
from oath.world.travel import TravelCosts


@pytest.fixture
def world() -> World:
    mission = load("missions/maze-09.yaml")
    return build(mission, Params(points=300), relevant=frozenset())


def same(world: World, travel: TravelCosts, nodes: list[int]) -> bool:
    fresh = world.roadmap.travel(0, nodes, nodes)
    return bool(np.array_equal(travel.between(0, nodes), fresh))


def test_any_order_of_questions_gives_the_roadmaps_own_costs(world: World) -> None:
    travel = TravelCosts(world.roadmap, frozenset())
    nodes = list(world.stops.values())
    rng = np.random.default_rng(0)
    for _ in range(20):
        assert same(world, travel, rng.choice(nodes, rng.integers(0, 8)).tolist())


def test_a_change_of_the_map_changes_the_answer(world: World) -> None:
    travel = TravelCosts(world.roadmap, frozenset())
    nodes = list(world.stops.values())
    before = travel.between(0, nodes)
    block = Obstacle(id="x", kind="gate", polygon=((7.5, 7.5), (12, 7.5), (12, 12), (7.5, 12)))
    world.roadmap.add_obstacle(block)
    assert (travel.between(0, nodes) > before).any()
    assert same(world, travel, nodes)
    nodes.append(world.roadmap.insert((3.0, 11.0)))
    assert same(world, travel, nodes)
    world.roadmap.remove_obstacle("x")
    assert same(world, travel, nodes)
