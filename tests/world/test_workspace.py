"""Clearance, visibility, labels and costs against shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon
from shapely.geometry import Point as Spot

from oath.model import Map, Motion, Obstacle, OccupancyGrid, Point
from oath.world.workspace import Mode, Workspace, Zones, corners, polygon_corners
from oracles import gap
from scenes import (
    BOX,
    FLYER,
    GROUND,
    WADER,
    random_grid,
    random_map,
    random_obstacle,
    random_point,
    random_polygon,
)

SEEDS = st.integers(0, 2**32 - 1)
CLOSE = 1e-7
"""Distances nearer to the radius than this are left to rounding."""
BOXES = (BOX, (0.0, 0.0, 100.0, 1.0), (-3.0, 5.0, -2.5, 60.0))


def lines(
    rng: np.random.Generator, box: tuple[float, ...], count: int, beyond: float
) -> np.ndarray:
    """Segments (count, 2, 2): long ones, short ones, points, and some along the axes."""
    low, high = np.array(box[:2]) - beyond, np.array(box[2:]) + beyond
    ends = rng.uniform(low, high, (count, 2, 2))
    short = count // 3
    ends[:short, 1] = ends[:short, 0] + rng.normal(0, 0.3, (short, 2))
    ends[short : short + 3, 1] = ends[short : short + 3, 0]
    ends[-2, 1, 0], ends[-1, 1, 1] = ends[-2, 0, 0], ends[-1, 0, 1]
    return ends


def compare(map: Map, workspace: Workspace, ends: np.ndarray, motion: Motion) -> int:
    """Check clearance and `free` for some radii; return how many segments were free."""
    blocking = [o for o in workspace.obstacles.values() if motion.blocked_by(o.kind)]
    a, b = ends[:, 0].copy(), ends[:, 1].copy()
    expected = [gap(map, blocking, tuple(p)) for p in a.tolist()]
    assert workspace.clearance(a, motion) == pytest.approx(expected, abs=1e-9)
    capped = np.minimum(expected, 0.7)
    assert workspace.clearance(a, motion, 0.7) == pytest.approx(capped, abs=1e-9)
    widths = [gap(map, blocking, tuple(p), tuple(q)) for p, q in ends.tolist()]
    count = 0
    for radius in (0.0, 0.05, 0.3, 1.5):
        fits = workspace.free(a, b, Mode(motion, radius))
        for width, fit in zip(widths, fits.tolist(), strict=True):
            if width == 0.0 or abs(width - radius) > CLOSE:
                assert fit == (width > 0.0 and width >= radius)
            count += fit
    return count


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, box=st.sampled_from(BOXES), beyond=st.sampled_from([0.0, 2.0]))
def test_walls_and_polygons_equal_shapely(seed: int, box: tuple[float, ...], beyond: float) -> None:
    rng = np.random.default_rng(seed)
    map = random_map(rng, walls=rng.integers(0, 8), obstacles=5, box=box, beyond=beyond)
    workspace = Workspace(map)
    ends = lines(rng, box, 30, beyond)
    for motion in (GROUND, FLYER, WADER):
        compare(map, workspace, ends, motion)


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, share=st.sampled_from([0.03, 0.3, 0.9]))
def test_cells_equal_shapely_boxes(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    grid = random_grid(rng, int(rng.integers(1, 12)), int(rng.integers(1, 12)), share)
    x, y = grid.origin
    rows, columns = grid.occupied.shape
    box = (x, y, x + columns * grid.resolution, y + rows * grid.resolution)
    map = Map(bounds=box, grid=grid, walls=(((x, y), (x + 0.3, y + 0.2)),), wall_thickness=0.1)
    workspace = Workspace(map)
    compare(map, workspace, lines(rng, box, 30, 0.0), GROUND)
    compare(map, workspace, lines(rng, box, 15, 0.5), GROUND)


def test_occupied_cells_reach_to_the_edge_of_the_raster() -> None:
    occupied = np.zeros((4, 4), dtype=bool)
    occupied[:, 3] = True
    grid = OccupancyGrid(occupied=occupied, resolution=1.0, origin=(0.0, 0.0))
    workspace = Workspace(Map(bounds=(0, 0, 4, 4), grid=grid))
    edge = np.array([[4.0, 0.5], [4.0, 3.5]])
    assert workspace.clearance(edge, GROUND).tolist() == [0.0, 0.0]
    assert not workspace.free(edge[:1], edge[1:], Mode(GROUND, 0.1)).any()


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_removal_in_any_order_equals_never_added(seed: int) -> None:
    rng = np.random.default_rng(seed)
    map = random_map(rng, walls=2, obstacles=2)
    workspace = Workspace(map)
    ends = lines(rng, BOX, 15, 0.5)
    ids = [f"x{i}" for i in range(5)]
    for id in ids:
        workspace.add(random_obstacle(rng, id, random_point(rng), 2.0))
    for id in rng.permutation(ids).tolist():
        compare(map, workspace, ends, GROUND)
        assert workspace.remove(id).id == id
    compare(map, workspace, ends, GROUND)
    assert set(workspace.obstacles) == {"o0", "o1"}


def test_an_id_may_come_back() -> None:
    workspace = Workspace(Map(bounds=BOX))
    square = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
    inside = np.array([[1.5, 1.5]])
    for _ in range(3):
        workspace.add(Obstacle(id="a", kind="bush", polygon=square))
        assert workspace.clearance(inside, GROUND)[0] == 0.0
        workspace.remove("a")
        assert workspace.clearance(inside, GROUND)[0] == math.inf


def test_kinds_decide_what_blocks() -> None:
    wall = ((6.0, 0.0), (6.0, 8.0))
    bush = Obstacle(id="b", kind="bush", polygon=((1, 1), (2, 1), (2, 2), (1, 2)))
    pond = Obstacle(id="p", kind="water", polygon=((3, 1), (4, 1), (4, 2), (3, 2)))
    workspace = Workspace(Map(bounds=BOX, walls=(wall,), obstacles=(bush, pond)))
    a, b = np.array([[0.5, 1.5]] * 3), np.array([[2.5, 1.5], [5.0, 1.5], [7.0, 1.5]])
    for motion, expected in (
        (GROUND, [False, False, False]),
        (FLYER, [True, False, False]),
        (WADER, [True, True, False]),
    ):
        assert workspace.free(a, b, Mode(motion, 0.1)).tolist() == expected
    assert workspace.blocked(None) == [1, 1, 1]
    assert workspace.clearance(np.array([[1.5, 1.5]]), None)[0] == 0.0
    assert workspace.permanent() == [1, 0, 0]


def test_unknown_obstacles_are_not_there_until_added() -> None:
    hidden = Obstacle(id="b", kind="bush", polygon=((1, 1), (2, 1), (2, 2), (1, 2)), known=False)
    workspace = Workspace(Map(bounds=BOX, obstacles=(hidden,)))
    inside = np.array([[1.5, 1.5]])
    assert workspace.clearance(inside, None)[0] == math.inf
    workspace.add(hidden)
    assert workspace.clearance(inside, None)[0] == 0.0


def test_empty_workspace_is_free_everywhere() -> None:
    workspace = Workspace(Map(bounds=BOX))
    points = np.array([[0.0, 0.0], [8.0, 8.0], [4.0, -100.0]])
    assert workspace.clearance(points, GROUND).tolist() == [math.inf] * 3
    assert workspace.clearance(points, GROUND, 2.0).tolist() == [2.0] * 3
    assert workspace.free(points, points[::-1].copy(), Mode(GROUND, 50.0)).all()
    assert workspace.clearance(np.empty((0, 2)), GROUND).shape == (0,)
    assert workspace.free(np.empty((0, 2)), np.empty((0, 2)), Mode(GROUND, 0.1)).shape == (0,)


def test_points_on_a_border_have_no_clearance() -> None:
    square = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
    workspace = Workspace(
        Map(bounds=BOX, obstacles=(Obstacle(id="a", kind="crate", polygon=square),))
    )
    on = np.array([[1.0, 1.0], [2.0, 2.0], [1.5, 1.0], [2.0, 1.5], [1.0, 1.5], [1.5, 2.0]])
    assert workspace.clearance(on, GROUND).tolist() == [0.0] * len(on)
    assert not workspace.free(on, on, Mode(GROUND, 0.0)).any()
    along = np.array([[0.0, 1.0]]), np.array([[3.0, 1.0]])
    assert not workspace.free(*along, Mode(GROUND, 0.0)).any()


def test_a_clearance_equal_to_the_radius_is_enough() -> None:
    map = Map(bounds=BOX, walls=(((0, 4), (8, 4)),), wall_thickness=0.2)
    a, b = np.array([[1.0, 3.7]]), np.array([[7.0, 3.7]])
    workspace = Workspace(map)
    assert workspace.free(a, b, Mode(GROUND, 0.2)).all()
    assert not workspace.free(a, b, Mode(GROUND, 0.201)).any()


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS)
def test_length_pays_the_factor_inside_only(seed: int) -> None:
    rng = np.random.default_rng(seed)
    map = random_map(rng, walls=1, obstacles=6)
    workspace = Workspace(map)
    ends = lines(rng, BOX, 20, 0.0)
    a, b = ends[:, 0].copy(), ends[:, 1].copy()
    straight = np.hypot(*(b - a).T)
    assert workspace.length(a, b, GROUND) == pytest.approx(straight)
    expected = straight.copy()
    for i, way in enumerate(ends.tolist()):
        for obstacle in map.obstacles:
            if obstacle.kind == "water":
                inside = LineString(way).intersection(Polygon(obstacle.polygon))
                expected[i] += 1.5 * inside.length
    assert workspace.length(a, b, WADER) == pytest.approx(expected)
    assert (workspace.length(a, b, WADER) >= straight - 1e-12).all()


# --- Zones


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS)
def test_labels_are_the_zones_touched(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = {f"z{i}": random_polygon(rng, random_point(rng, beyond=1.0), 2.0) for i in range(5)}
    zones = Zones(BOX, shapes, {}, [*shapes, "a-task"])
    ends = lines(rng, BOX, 30, 1.0)
    labels = zones.labels(ends[:, 0].copy(), ends[:, 1].copy())
    for (a, b), label in zip(ends.tolist(), labels.tolist(), strict=True):
        way = LineString([a, b]) if a != b else Spot(a)
        touched = {name for name, shape in shapes.items() if way.intersects(Polygon(shape))}
        assert zones.classes[label] == touched
    for point in ends[:, 0].tolist():
        assert zones.at(tuple(point)) == {
            name for name, shape in shapes.items() if Spot(point).intersects(Polygon(shape))
        }
    assert len(set(zones.classes)) == len(zones.classes)
    assert zones.classes[0] == frozenset()


def test_a_place_is_crossed_only_exactly_and_only_if_relevant() -> None:
    places: dict[str, Point] = {"dock": (4.0, 4.0), "gate": (6.0, 4.0)}
    zones = Zones(BOX, {}, places, ["dock"])
    a = np.array([[3.0, 4.0], [3.0, 4.001], [4.0, 4.0], [5.0, 4.0]])
    b = np.array([[5.0, 4.0], [5.0, 4.001], [4.0, 5.0], [7.0, 4.0]])
    assert [sorted(zones.classes[k]) for k in zones.labels(a, b)] == [["dock"], [], ["dock"], []]
    assert zones.atoms == ["dock"]


def test_without_atoms_every_label_is_none() -> None:
    zones = Zones(BOX, {"lab": ((0, 0), (1, 0), (1, 1))}, {}, ())
    here = np.array([[0.5, 0.2]])
    assert zones.labels(here, here).tolist() == [0]
    assert zones.at((0.5, 0.2)) == frozenset()


# --- Corners


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, offset=st.sampled_from([0.05, 0.21]))
def test_corner_nodes_lie_outside_near_the_offset(seed: int, offset: float) -> None:
    rng = np.random.default_rng(seed)
    polygon = random_polygon(rng, (4.0, 4.0), 2.0)
    shape = Polygon(polygon)
    for x, y in polygon_corners(polygon, offset):
        away = min(math.dist((x, y), corner) for corner in polygon)
        # The points circumscribe a circle with turns of at most 45 degrees.
        assert away <= offset / math.cos(math.radians(22.5)) + 1e-9
        if shape.convex_hull.equals(shape):
            assert shape.distance(Spot(x, y)) >= offset - 1e-9
    # At least every corner of the hull is one around which a shortest path may turn.
    assert len(polygon_corners(polygon, offset)) >= len(shape.convex_hull.exterior.coords) - 1 - (
        sum(1 for turn in turns(polygon) if turn < math.radians(5))
    )


def turns(polygon: tuple[Point, ...]) -> list[float]:
    """By how much the border turns at each corner [rad]."""
    corner = np.array(polygon)
    ahead = np.roll(corner, -1, axis=0) - corner
    angles = np.arctan2(ahead[:, 1], ahead[:, 0])
    return [abs((t + math.pi) % math.tau - math.pi) for t in angles - np.roll(angles, 1)]


def test_corner_nodes_of_a_square_and_of_a_wall_end() -> None:
    square = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
    found = polygon_corners(square, 0.1)
    assert len(found) == 8
    assert all(Polygon(square).distance(Spot(p)) >= 0.1 - 1e-12 for p in found)
    map = Map(bounds=BOX, walls=(((2.0, 4.0), (6.0, 4.0)),), wall_thickness=0.2)
    around = corners(map, (), 0.3, 1.0)
    assert len(around) == 8  # four half way around each end
    wall = LineString(map.walls[0])
    for x, y in around.tolist():
        assert 0.4 - 1e-9 <= wall.distance(Spot(x, y)) <= 0.4 / math.cos(math.radians(22.5)) + 1e-9


def test_corner_nodes_of_cells_lie_on_the_diagonal_and_are_thinned() -> None:
    occupied = np.zeros((10, 10), dtype=bool)
    occupied[4:6, 4:6] = True
    grid = OccupancyGrid(occupied=occupied, resolution=1.0, origin=(0.0, 0.0))
    map = Map(bounds=(0, 0, 10, 10), grid=grid)
    found = sorted(corners(map, (), 0.5, 0.1).round(9).tolist())
    assert found == [[3.5, 3.5], [3.5, 6.5], [6.5, 3.5], [6.5, 6.5]]
    assert len(corners(map, (), 0.5, 20.0)) == 1


def test_a_straight_wall_joint_needs_no_corner_node() -> None:
    map = Map(bounds=BOX, walls=(((1, 4), (4, 4), (7, 4)),), wall_thickness=0.2)
    around = corners(map, (), 0.2, 1.0)
    assert not any(2 < x < 6 for x, _ in around.tolist())
