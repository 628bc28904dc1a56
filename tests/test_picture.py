"""Pictures come out whole for small, big, crowded and empty missions, and touch nothing else."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from oath import events as ev
from oath.model import Map, Mission, Motion, Obstacle, OccupancyGrid, Point, Robot, Stop, Task
from oath.picture import draw_map, draw_run

BOX = ((4.0, 4.0), (5.0, 4.0), (5.0, 5.0), (4.0, 5.0))


def mission(map: Map, *, robots: int = 2, tasks: int = 3, **changes: Any) -> Mission:
    x0, y0, x1, y1 = map.bounds

    def spot(a: float, b: float) -> Point:
        return (x0 + (x1 - x0) * (0.5 + 0.45 * cos(a)), y0 + (y1 - y0) * (0.5 + 0.45 * sin(b)))

    team = [
        Robot(
            id=f"robot{i}",
            start=spot(i, i),
            motion="ground",
            can={"normal": 1.0},
            capacity=1,
            speed=1.0,
            radius=0.2,
            sensing=1.5,
        )
        for i in range(robots)
    ]
    jobs = [
        Task(
            id=f"t{i}",
            type="normal",
            stops=(Stop(name="pickup", at=spot(2 * i, i)), Stop(name="delivery", at=spot(1, 2)))
            if i % 3
            else (Stop(name="visit", at=spot(i, 3 * i)),),
        )
        for i in range(tasks)
    ]
    values: dict[str, Any] = {
        "name": "sketch",
        "motions": {"ground": Motion(name="ground")},
        "places": {"dock": spot(1, 2)},
        "task_types": ("normal",),
        "zones": {"lab": ((x0, y0), (x0 + (x1 - x0) / 5, y0), (x0, y0 + (y1 - y0) / 5))},
        "rules": (),
    }
    return Mission(map=map, robots=tuple(team), tasks=tuple(jobs), **{**values, **changes})


def run(mission: Mission) -> list[ev.AnyEvent]:
    """Robots drive their tasks in turn as the crow flies; the last task is left over."""
    log: list[ev.AnyEvent] = [ev.MissionStarted(t=0.0, mission="sketch", allocator="hand", seed=0)]
    here = {robot.id: robot.start for robot in mission.robots}
    for i, task in enumerate(mission.tasks[:-1]):
        who = mission.robots[i % len(mission.robots)].id
        for stop in task.stops:
            log.append(
                ev.Moved(t=i, robot=who, from_=here[who], to=stop.at, start=float(i), end=i + 1.0)
            )
            log.append(
                ev.StopServed(t=i + 1.0, robot=who, task=task.id, stop=stop.name, at=stop.at)
            )
            here[who] = stop.at
    return log


def maze() -> Mission:
    walls = (((0.0, 3.0), (2.0, 3.0), (2.0, 4.0)), ((6.0, 6.0), (8.0, 6.0), (8.0, 8.0), (6.0, 6.0)))
    obstacles = tuple(
        Obstacle(id=f"o{i}", kind=kind, polygon=tuple((x + i, y) for x, y in BOX), known=i == 0)
        for i, kind in enumerate(["bush", "gate", "bush"])
    )
    map = Map(bounds=(0, 0, 10, 10), walls=walls, wall_thickness=0.2, obstacles=obstacles)
    return mission(map, robots=4, tasks=12)


def grid(rows: int, columns: int) -> Mission:
    occupied = np.zeros((rows, columns), dtype=bool)
    occupied[rows // 2, : columns // 2] = True
    cells = OccupancyGrid(occupied=occupied, resolution=0.05, origin=(-1, -1))
    return mission(Map(bounds=(-1, -1, columns * 0.05 - 1, rows * 0.05 - 1), grid=cells))


MISSIONS: dict[str, Callable[[], Mission]] = {
    "maze": maze,
    "grid": lambda: grid(60, 80),
    "big grid": lambda: grid(2100, 900),
    "tiny": lambda: mission(Map(bounds=(0, 0, 0.5, 0.5)), robots=1, tasks=1),
    "huge": lambda: mission(Map(bounds=(-5e3, -5e3, 5e3, 5e3)), robots=3, tasks=30),
    "corridor": lambda: mission(Map(bounds=(0, 0, 100, 2), walls=(((0, 0), (9, 0)),))),
    "fifty robots": lambda: mission(Map(bounds=(0, 0, 20, 20)), robots=50, tasks=60),
    "nobody": lambda: mission(Map(bounds=(0, 0, 1, 1)), robots=0, tasks=0),
    "odd names": lambda: mission(
        Map(bounds=(0, 0, 9, 9)), name="$x_{", places={"_a": (1, 1), "$b$": (1.01, 1)}, zones={}
    ),
}


def check(path: Path) -> tuple[int, int]:
    with Image.open(path) as image:
        size = image.size
        colours = image.convert("RGB").getcolors(1 << 24)
    assert max(size) >= 600 and size[0] <= 4000 and size[1] <= 2000
    assert colours is not None and len(colours) > 20
    return size


@pytest.mark.parametrize("name", MISSIONS)
def test_draws_runs(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scene = MISSIONS[name]()
    events = run(scene) if scene.robots else []
    draw_run(scene, events, tmp_path / "run.png")
    check(tmp_path / "run.png")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["maze", "grid", "corridor"])
def test_draws_roadmaps(name: str, tmp_path: Path) -> None:
    scene = MISSIONS[name]()
    x0, y0, x1, y1 = scene.map.bounds
    nodes = np.random.default_rng(0).uniform((x0, y0), (x1, y1), (50, 2))
    edges = np.stack([np.arange(49), np.arange(1, 50)], axis=1)
    draw_map(scene, nodes, edges, tmp_path / "map.png", clearance=np.arange(50.0))
    check(tmp_path / "map.png")
    draw_map(scene, nodes[:0], edges[:0], tmp_path / "none.png", unreachable=["t1"])
    check(tmp_path / "none.png")
    draw_run(scene, run(scene), tmp_path / "run.png", nodes=nodes, edges=edges)
    check(tmp_path / "run.png")


def test_size_and_bytes_are_always_the_same(tmp_path: Path) -> None:
    scene = maze()
    log = run(scene)
    log += [
        ev.ObstacleFound(t=20.0, robot="robot0", obstacle="o1", polygon=BOX),
        ev.ObstacleAdded(t=20.0, obstacle="new", kind="wall", polygon=BOX),
        ev.ObstacleRemoved(t=20.0, obstacle="o0"),
        ev.TaskCancelled(t=20.0, task="t1"),
        ev.TaskAdded(t=20.0, task=scene.tasks[2]),
    ]
    for name in ("a.png", "b.png"):
        draw_run(scene, log, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    width, height = check(tmp_path / "a.png")
    assert width > height >= 1200


def test_an_empty_run_still_shows_the_mission(tmp_path: Path) -> None:
    draw_run(maze(), [], tmp_path / "run.png")
    check(tmp_path / "run.png")


def test_tells_connected_stops_from_cut_off_ones(tmp_path: Path) -> None:
    far = Task(id="far", type="normal", stops=(Stop(name="visit", at=(9, 1)),))
    scene = replace(mission(Map(bounds=(0, 0, 10, 10)), robots=1, tasks=0), tasks=(far,))
    nodes = np.array([scene.robots[0].start, (9.0, 1.0)])
    black = []
    for links in (np.array([[0, 1]]), np.empty((0, 2), dtype=int)):
        draw_map(scene, nodes, links, tmp_path / "map.png")
        with Image.open(tmp_path / "map.png") as image:
            black.append(int((np.asarray(image.convert("L")) == 0).sum()))
    # The cross on the stop and its line in the legend are of pure black.
    assert black[1] > black[0]


def test_no_plotting_state_is_loaded() -> None:
    code = (
        "import sys, oath.picture as p; assert 'matplotlib' not in sys.modules\n"
        "from matplotlib.figure import Figure; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_drawing_does_not_load_pyplot(tmp_path: Path) -> None:
    before = "matplotlib.pyplot" in sys.modules
    draw_run(maze(), [], tmp_path / "run.png")
    assert ("matplotlib.pyplot" in sys.modules) == before
