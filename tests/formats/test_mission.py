"""What a mission file means: every field, every default, every example."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from oath.errors import BadInput
from oath.formats.mission import load
from oath.formats.mission_checks import cell_clearance
from oath.model import Motion, Obstacle, OccupancyGrid, Stop

MISSIONS = Path(__file__).parents[2] / "missions"
EXAMPLES = sorted(p for p in MISSIONS.glob("*.yaml") if "schema:" in p.read_text())

FULL = """
schema: oath/mission/1
name: full
map:
  bounds: [0, 0, 20, 10.5]
  walls: [[[5, 0], [5, 4], [6, 4]]]
  wall_thickness: 0.1
  obstacles:
    - {id: bush-1, kind: bush, polygon: [[7, 7], [8, 7], [8, 8], [7, 7]], known: false}
motions:
  ground:
  drone: {ignores: [gate], cost: {bush: 2}}
places: {dock: [1, 1]}
task_types: [carry, look]
robots:
  - {id: r1, start: [1, 2], motion: drone, can: [look], capacity: 2,
     speed: 1e1, radius: 0.3, sensing: 4}
  - {id: r2, start: [3, 2], motion: ground, can: {carry: 1, look: 0.25}}
tasks:
  - {id: t1, pickup: [2, 2], delivery: dock}
  - {id: t2, visit: [9, 9], type: look, priority: high, service_time: 5}
zones: {lab: [[18, 0], [25, 0], [25, 2]]}
rules: ["G !lab"]
"""


def test_every_field(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(FULL)
    mission = load(str(path))
    assert mission.name == "full"
    assert mission.source == str(path)
    assert mission.map.bounds == (0, 0, 20, 10.5)
    assert mission.map.walls == (((5, 0), (5, 4), (6, 4)),)
    assert mission.map.wall_thickness == 0.1
    assert mission.map.grid is None
    bush = Obstacle(id="bush-1", kind="bush", polygon=((7, 7), (8, 7), (8, 8)), known=False)
    assert mission.map.obstacles == (bush,)
    assert mission.motions == {
        "ground": Motion(name="ground"),
        "drone": Motion(name="drone", ignores=frozenset({"gate"}), cost={"bush": 2.0}),
    }
    assert mission.places == {"dock": (1, 1)}
    assert mission.task_types == ("carry", "look")
    first, second = mission.robots
    assert (first.id, first.start, first.motion, first.can) == ("r1", (1, 2), "drone", {"look": 1})
    assert (first.capacity, first.speed, first.radius, first.sensing) == (2, 10, 0.3, 4)
    assert second.can == {"carry": 1.0, "look": 0.25}
    carry, look = mission.tasks
    assert (carry.type, carry.priority, carry.service_time) == ("carry", "normal", 0)
    assert carry.stops == (
        Stop(name="pickup", at=(2, 2)),
        Stop(name="delivery", at=(1, 1), place="dock"),
    )
    assert look.stops == (Stop(name="visit", at=(9, 9)),)
    assert (look.type, look.priority, look.service_time) == ("look", "high", 5)
    assert mission.zones == {"lab": ((18, 0), (25, 0), (25, 2))}
    assert mission.rules == ("G !lab",)


def test_defaults(tmp_path: Path) -> None:
    path = tmp_path / "tiny.yaml"
    path.write_text("robots: [{id: a, start: [2, 3]}]\ntasks: [{id: t, visit: [5, 3]}]\n")
    mission = load(path)
    assert mission.name == "tiny"
    assert mission.map.bounds == (1, 2, 6, 4)
    assert mission.map.wall_thickness == 0.2
    assert mission.motions == {"ground": Motion(name="ground")}
    assert mission.task_types == ("normal",)
    robot = mission.robots[0]
    assert (robot.motion, robot.can, robot.capacity) == ("ground", {"normal": 1.0}, 1)
    assert (robot.speed, robot.radius, robot.sensing) == (1.0, 0.2, 1.5)
    assert (mission.tasks[0].type, mission.tasks[0].priority) == ("normal", "normal")
    assert (mission.places, mission.zones, mission.rules) == ({}, {}, ())


def test_types_that_robots_name_need_no_list(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("robots: [{id: a, start: [2, 3], can: [lift]}, {id: b, start: [2, 3]}]\n")
    mission = load(path)
    assert mission.task_types == ("normal", "lift")
    assert dict(mission.robots[1].can) == {"normal": 1.0, "lift": 1.0}


def test_a_key_without_a_value_is_an_empty_collection(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("robots: [{id: a, start: [2, 3]}]\ntasks:\nplaces:\nzones:\nrules:\nmotions:\n")
    assert load(path).tasks == ()


def test_the_first_motion_is_the_default(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("motions: {hover: {}, ground: {}}\nrobots: [{id: a, start: [2, 3]}]\n")
    assert load(path).robots[0].motion == "hover"


def test_anchors_and_merges_spare_typing(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(
        "robots:\n- &r {id: a, start: [2, 3], speed: 2}\n- {<<: *r, id: b, start: [3, 3]}\n"
    )
    second = load(path).robots[1]
    assert (second.id, second.start, second.speed) == ("b", (3, 3), 2.0)


def fits(folder: Path, **changes: object) -> bool:
    """Whether a visit 0.25 m from a bush, known or not, is accepted for one robot."""
    robot = {"id": "a", "start": [1, 1], "radius": changes.get("radius", 0.2)}
    bush = {"id": "b", "kind": "bush", "polygon": [[4, 4], [5, 4], [5, 5], [4, 5]]}
    path = folder / "m.yaml"
    mission = {
        "map": {"obstacles": [bush | {"known": changes.get("known", True)}]},
        "motions": {"m": {"ignores": ["bush"] if changes.get("drone") else []}},
        "robots": [robot],
        "tasks": [{"id": "t", "visit": [3.75, 4.5]}],
    }
    path.write_text(yaml.safe_dump(mission))
    try:
        load(path)
    except BadInput as error:
        assert "clearance 0.25 m" in str(error)
        return False
    return True


def test_a_stop_needs_the_radius_from_known_blocking_obstacles(tmp_path: Path) -> None:
    assert fits(tmp_path, radius=0.25)
    assert not fits(tmp_path, radius=0.26)
    assert fits(tmp_path, radius=0.26, known=False)
    assert fits(tmp_path, radius=0.26, drone=True)


def test_one_small_robot_is_enough(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    text = "map: {walls: [[[4, 0], [4, 9]]]}\ntasks: [{id: t, visit: [4.3, 5]}]\nrobots:\n"
    path.write_text(
        text + "- {id: a, start: [1, 1], radius: 0.5}\n- {id: b, start: [1, 1], radius: 0.2}\n"
    )
    assert len(load(path).robots) == 2


def test_a_costly_obstacle_does_not_block_a_start(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(
        "map: {obstacles: [{id: o, kind: mud, polygon: [[0, 0], [2, 0], [2, 2], [0, 2]]}]}\n"
        "motions: {ground: {cost: {mud: 3}}}\nrobots: [{id: a, start: [1, 1]}]\n"
    )
    assert load(path).robots[0].start == (1, 1)


def test_a_map_file_gives_bounds_and_cells(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "a.map").write_text("type octile\nheight 2\nwidth 3\nmap\n@..\n...\n")
    path = tmp_path / "m.yaml"
    robots = "robots: [{id: a, start: [1.5, 1.5]}]\n"
    path.write_text("map: {file: maps/a.map, walls: [[[2.5, 0], [2.5, 1]]]}\n" + robots)
    mission = load(path)
    assert mission.map.bounds == (0, 0, 3, 2)
    assert mission.map.grid is not None
    assert mission.map.grid.occupied.tolist() == [[False] * 3, [True, False, False]]
    assert len(mission.map.walls) == 1
    path.write_text("map: {file: maps/a.map, bounds: [1, 0, 3, 2]}\n" + robots)
    assert load(path).map.bounds == (1, 0, 3, 2)


@pytest.mark.parametrize("start", [[0.5, 1.5], [1.1, 1.5], [0.5, 0.9]])
def test_cells_keep_robots_off(start: list[float], tmp_path: Path) -> None:
    (tmp_path / "a.map").write_text("type octile\nheight 2\nwidth 3\nmap\n@..\n...\n")
    path = tmp_path / "m.yaml"
    path.write_text(f"map: {{file: a.map}}\nrobots: [{{id: a, start: {start}}}]\n")
    with pytest.raises(BadInput, match="occupied cell"):
        load(path)


def far(grid: OccupancyGrid, point: tuple[float, float]) -> float:
    """Distance to the nearest occupied cell, one cell after the other."""
    best = np.inf
    for row, column in np.argwhere(grid.occupied):
        x = grid.origin[0] + column * grid.resolution
        y = grid.origin[1] + row * grid.resolution
        gap_x = max(x - point[0], 0, point[0] - x - grid.resolution)
        gap_y = max(y - point[1], 0, point[1] - y - grid.resolution)
        best = min(best, float(np.hypot(gap_x, gap_y)))
    return best


@given(
    cells=hnp.arrays(bool, hnp.array_shapes(min_dims=2, max_dims=2, max_side=6)),
    point=st.tuples(st.floats(-4, 4), st.floats(-4, 4)),
    reach=st.floats(0, 5),
    resolution=st.sampled_from([0.05, 0.3, 1.0]),
)
def test_cell_clearance_is_the_distance_within_reach(
    cells: np.ndarray, point: tuple[float, float], reach: float, resolution: float
) -> None:
    grid = OccupancyGrid(occupied=cells, resolution=resolution, origin=(-1.0, -0.5))
    exact = far(grid, point)
    found = cell_clearance(grid, point, reach)
    if exact < reach - 1e-9:
        assert found == pytest.approx(exact, abs=1e-12)
    elif exact > reach + 1e-9:
        assert found == np.inf


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_load(path: Path) -> None:
    mission = load(path)
    assert mission.name == path.stem
    assert mission.tasks


def test_there_are_examples() -> None:
    assert {"maze-25-gates", "maze-25", "office", "warehouse"} <= {path.stem for path in EXAMPLES}


def test_the_paper_s_maze() -> None:
    mission = load(MISSIONS / "maze-25-gates.yaml")
    assert len(mission.map.walls) == 40
    assert len(mission.tasks) == 25
    assert [robot.motion for robot in mission.robots] == ["ground", "drone"] * 2
    assert sum(not obstacle.known for obstacle in mission.map.obstacles) == 4
    assert mission.task("ge").stop("delivery").at == (16, 5.5)


def test_the_office_picture_is_what_its_script_draws(tmp_path: Path) -> None:
    script = shutil.copy(MISSIONS / "make_office.py", tmp_path)
    subprocess.run([sys.executable, script], check=True)
    drawn = (tmp_path / "office-map.pgm").read_bytes()
    assert drawn == (MISSIONS / "office-map.pgm").read_bytes()
