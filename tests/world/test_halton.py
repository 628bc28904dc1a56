"""The Halton sequence and the acceptance of its points near obstacles."""

from __future__ import annotations

import numpy as np
import pytest

from oath.model import Map, Obstacle
from oath.world.halton import Density, Halton, Sampling, radical_inverse, sample
from oath.world.workspace import Workspace
from scenes import BOX, FLYER, GROUND, random_map

WALL = Map(bounds=BOX, walls=(((4.0, 0.0), (4.0, 8.0)),), wall_thickness=0.2)


def test_radical_inverse_known_answers() -> None:
    halves = [1 / 2, 1 / 4, 3 / 4, 1 / 8, 5 / 8, 3 / 8, 7 / 8, 1 / 16]
    thirds = [1 / 3, 2 / 3, 1 / 9, 4 / 9, 7 / 9, 2 / 9, 5 / 9, 8 / 9, 1 / 27]
    assert radical_inverse(2, 1, 8).tolist() == halves
    assert radical_inverse(3, 1, 9) == pytest.approx(thirds)
    assert radical_inverse(2, 0, 1).tolist() == [0.0]
    assert radical_inverse(5, 1, 0).tolist() == []


@pytest.mark.parametrize("base", [2, 3])
def test_radical_inverse_fills_each_stretch_once(base: int) -> None:
    """The first base^k - 1 values and 0 are the multiples of base^-k, each once."""
    count = base**6
    values = np.sort(radical_inverse(base, 0, count))
    assert values == pytest.approx(np.arange(count) / count)


def test_sequence_uses_bases_2_and_3_and_goes_on() -> None:
    box = (-2.0, 1.0, 6.0, 3.0)
    whole = Halton(box, np.random.default_rng(5)).take(300)
    parts = Halton(box, np.random.default_rng(5))
    assert np.array_equal(np.concatenate([parts.take(100), parts.take(200)]), whole)
    shift = np.random.default_rng(5).random(2)
    unit = np.stack([radical_inverse(2, 1, 300), radical_inverse(3, 1, 300)], axis=1)
    assert whole == pytest.approx(np.array(box[:2]) + (unit + shift) % 1.0 * np.array([8.0, 2.0]))
    assert (whole >= box[:2]).all() and (whole < box[2:]).all()


def test_density_known_answers() -> None:
    density = Density(d_min=0.3, d_opt=0.4, sigma=0.5, beta=0.2)
    distance = np.array([0.0, 0.2999, 0.3, 0.4, 0.9, 1.3, 50.0, np.inf])
    expected = [0, 0, np.exp(-0.02), 1, np.exp(-0.5), max(0.2, np.exp(-1.62)), 0.2, 0.2]
    assert density(distance) == pytest.approx(expected)


def test_points_are_as_dense_as_accepted() -> None:
    """In each band of distances from one wall, the share of points is its acceptance times area."""
    density = Density()
    points = sample(Workspace(WALL), [GROUND], 20_000, density, np.random.default_rng(3))
    away = abs(points[:, 0] - 4.0) - 0.1
    borders = np.array([0.3, 0.5, 0.8, 1.2, 1.6, 2.4, 3.9])
    found = np.histogram(away, borders)[0] / len(points)
    fine = np.linspace(0.3, 3.9, 20_001)[:-1]
    weight = np.histogram(fine, borders, weights=density(fine))[0]
    assert found == pytest.approx(weight / weight.sum(), abs=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_least_distance_is_kept_and_the_count_reached(seed: int) -> None:
    rng = np.random.default_rng(seed)
    workspace = Workspace(random_map(rng))
    density = Density(d_min=0.2)
    points = sample(workspace, [GROUND], 500, density, rng)
    assert points.shape == (500, 2)
    assert (workspace.clearance(points, GROUND) >= 0.2).all()
    assert len(np.unique(points, axis=0)) == 500


def test_without_obstacles_the_count_is_reached_too() -> None:
    workspace = Workspace(Map(bounds=BOX))
    points = sample(workspace, [GROUND], 300, Density(), np.random.default_rng(0))
    assert len(points) == 300


def test_same_seed_same_points() -> None:
    def points(seed: int) -> np.ndarray:
        rng = np.random.default_rng(seed)
        return sample(Workspace(WALL), [GROUND], 200, Density(), rng)

    assert np.array_equal(points(1), points(1))
    assert not np.array_equal(points(1), points(2))


def test_full_maps_give_fewer_points() -> None:
    def count(width: float) -> int:
        block = ((-1.0, -1.0), (9.0 - width, -1.0), (9.0 - width, 9.0), (-1.0, 9.0))
        full = Map(bounds=BOX, obstacles=(Obstacle(id="x", kind="crate", polygon=block),))
        rng = np.random.default_rng(0)
        return len(sample(Workspace(full), [GROUND], 300, Density(d_min=0.3), rng))

    assert count(0.0) == 0  # nothing is free
    assert 0 < count(1.31) < 300  # 1 cm along one side
    assert count(5.0) == 300


def test_nothing_wanted_gives_nothing() -> None:
    rng = np.random.default_rng(0)
    assert sample(Workspace(WALL), [GROUND], 0, Density(), rng).shape == (0, 2)
    assert sample(Workspace(WALL), [], 10, Density(), rng).shape == (0, 2)


def test_points_suit_some_motion() -> None:
    bush = Obstacle(id="x", kind="bush", polygon=((2, 2), (6, 2), (6, 6), (2, 6)))
    workspace = Workspace(Map(bounds=BOX, obstacles=(bush,)))
    for motions, some in (([GROUND], False), ([GROUND, FLYER], True)):
        points = sample(workspace, motions, 400, Density(), np.random.default_rng(1))
        inside = ((points > 2) & (points < 6)).all(axis=1)
        assert inside.any() == some


@pytest.mark.parametrize("sampling", ["adaptive", "uniform", "grid", "random"])
def test_every_sampling_keeps_its_distance_and_count(sampling: Sampling) -> None:
    workspace, density = Workspace(WALL), Density()
    for seed in range(3):
        rng = np.random.default_rng(seed)
        points = sample(workspace, [GROUND], 300, density, rng, sampling)
        assert 270 <= len(points) <= 300
        assert len(np.unique(points, axis=0)) == len(points)
        assert (workspace.clearance(points, GROUND) >= density.d_min).all()
        x, y = points.T
        assert ((x >= 0) & (x < 8) & (y >= 0) & (y < 8)).all()


def test_only_the_adaptive_sampling_is_denser_near_the_wall() -> None:
    workspace = Workspace(WALL)
    near = {}
    for sampling in ("adaptive", "uniform", "random"):
        rng = np.random.default_rng(0)
        points = sample(workspace, [GROUND], 4000, Density(), rng, sampling)
        near[sampling] = (abs(points[:, 0] - 4.0) < 1.1).mean()
    assert near["adaptive"] > 1.5 * near["uniform"]
    assert near["random"] == pytest.approx(near["uniform"], abs=0.03)
