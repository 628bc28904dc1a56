"""Pictures of missions: the routes that were driven, and the roadmap they were planned on.

Robots are told apart by colour, line style and marker together, so that the pictures can be read in
grey and by the colour-blind. Drawing touches no global state of matplotlib.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import cycle, pairwise
from math import ceil, hypot, nan
from os import PathLike
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from oath import events as ev
from oath.model import Map, Mission, Obstacle, OccupancyGrid, Point, Robot, Stop, Task
from oath.picture.sheet import MAP_SIZE, Floats, Label, Sheet, Style, begin, finish

ROBOT_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito's colour-blind safe palette without black (walls) and yellow (too light)."""
LINE_STYLES: tuple[Any, ...] = ("-", (0, (5, 1.2)), (0, (5, 1.2, 1, 1.2)), (0, (1.6, 1)))
ROBOT_MARKERS = ("o", "s", "p", "P", "X", "*", "h")
STOP_MARKERS = {"pickup": "^", "delivery": "v", "visit": "D"}
KIND_COLOURS = ("#8F8F2E", "#882255", "#8B5E3C", "#6A7B8C", "#C9B458", "#777777")
WALL_COLOUR, INK = "#3C3C3C", "#1A1A1A"

State = Literal["known", "unknown", "found", "never found", "removed"]
Key = tuple[str, str]
"""A stop: its task's id and its name."""


def draw_run(
    mission: Mission,
    events: Sequence[ev.AnyEvent],
    path: str | PathLike[str],
    *,
    nodes: NDArray[Any] | None = None,
    edges: NDArray[Any] | None = None,
) -> None:
    """Draw the routes that the robots drove as a PNG.

    Parameters
    ----------
    mission
        The mission as it was when it started.
    events
        Its event log, which may be empty or cut off.
    path
        File to write.
    nodes, edges
        The roadmap, drawn faintly if given: (n, 2) positions [m; world frame] and (m, 2) indices.
    """
    sheet = begin(mission)
    _draw_roadmap(sheet, nodes, edges)
    _draw_world(sheet, mission.map, _states(mission.map, events))
    _draw_places(sheet, mission)
    served: dict[Key, str] = {
        (e.task, e.stop): e.robot for e in events if isinstance(e, ev.StopServed)
    }
    looks = {robot.id: _look(i) for i, robot in enumerate(mission.robots)}
    _draw_drives(sheet, mission, events, looks)
    tasks = _tasks(mission, events)
    colours = {key: str(looks[who]["color"]) for key, who in served.items() if who in looks}
    missed = {
        (task.id, s.name) for task in tasks for s in task.stops if (task.id, s.name) not in served
    }
    _draw_stops(sheet, tasks, colours, missed, "not served")
    finish(sheet, _run_title(mission, events, tasks, served), path)


def draw_map(
    mission: Mission,
    nodes: NDArray[Any],
    edges: NDArray[Any],
    path: str | PathLike[str],
    *,
    clearance: NDArray[Any] | None = None,
    unreachable: Collection[str] | None = None,
) -> None:
    """Draw a mission's map with its roadmap as a PNG.

    Parameters
    ----------
    nodes, edges
        The roadmap: (n, 2) positions [m; world frame] and (m, 2) indices.
    path
        File to write.
    clearance
        (n,) distance of each node to the nearest obstacle [m]; colours the nodes if given.
    unreachable
        Ids of tasks with a stop that no robot can reach. By default they are read off the roadmap:
        a stop is reachable if its nearest node is connected to the nearest node of a robot's start.
    """
    sheet = begin(mission)
    nodes, edges = np.asarray(nodes).reshape(-1, 2), np.asarray(edges).reshape(-1, 2)
    _draw_roadmap(sheet, nodes, edges, clearance=clearance, faint=False)
    _draw_world(sheet, mission.map, _states(mission.map, ()))
    _draw_places(sheet, mission)
    for i, robot in enumerate(mission.robots):
        _draw_start(sheet, robot, _look(i), robot.id)
    missed = _cut_off_stops(mission, nodes, edges)
    if unreachable is not None:
        missed = {(t.id, s.name) for t in mission.tasks for s in t.stops if t.id in unreachable}
    _draw_stops(sheet, mission.tasks, {}, missed, "unreachable")
    parts = [f"{len(nodes)} nodes", f"{len(edges)} edges", f"{len(mission.tasks)} tasks"]
    if missed:
        parts.append(f"{len({task for task, _ in missed})} unreachable")
    finish(sheet, (f"{mission.name}: roadmap", " · ".join(parts)), path)


def _look(i: int) -> Style:
    """Return colour, line style and marker of robot `i`; 168 robots look different."""
    styles = LINE_STYLES[(i + i // len(ROBOT_COLOURS)) % len(LINE_STYLES)]
    return {
        "color": ROBOT_COLOURS[i % len(ROBOT_COLOURS)],
        "linestyle": styles,
        "marker": ROBOT_MARKERS[i % len(ROBOT_MARKERS)],
    }


def _draw_roadmap(
    sheet: Sheet,
    nodes: NDArray[Any] | None,
    edges: NDArray[Any] | None,
    *,
    clearance: NDArray[Any] | None = None,
    faint: bool = True,
) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    if nodes is None or not len(nodes):
        return
    colour = "#E2E2E2" if faint else "#A9B4BD"
    if edges is not None and len(edges):
        lines = LineCollection(nodes[edges], colors=colour, linewidths=0.4 if faint else 0.6)
        sheet.axes.add_collection(lines.set(zorder=1) and lines, autolim=False)
    size = float(np.clip(4000 / len(nodes), 0.6 if clearance is None else 7, 9))
    dots = sheet.axes.scatter(
        *nodes.T,
        s=size,
        c=colour if faint else ("#5B6770" if clearance is None else clearance),
        cmap=None if clearance is None else "cividis",
        linewidths=0,
        zorder=1.5,
    )
    sheet.scale = dots if clearance is not None else None
    sheet.legend(9, "roadmap", Line2D([], [], color="#B5B5B5", lw=0.8, marker=".", ms=4))


def _draw_world(sheet: Sheet, map: Map, states: Iterable[tuple[Obstacle, State]]) -> None:
    from matplotlib.patches import Patch, Rectangle

    x_min, y_min, x_max, y_max = map.bounds
    box = Rectangle(
        (x_min, y_min), x_max - x_min, y_max - y_min, fill=False, ec="#777777", lw=0.8, zorder=2
    )
    sheet.axes.add_patch(box)
    if map.grid is not None:
        _draw_cells(sheet, map.grid)
        sheet.legend(8, "occupied", Patch(fc=WALL_COLOUR))
    if map.walls:
        _draw_walls(sheet, map)
        sheet.legend(8, "wall", Patch(fc=WALL_COLOUR))
    states = sorted(states, key=lambda one: (one[0].kind, one[1]))
    kinds = dict.fromkeys(obstacle.kind for obstacle, _ in states)
    colours = dict(zip(kinds, cycle(KIND_COLOURS), strict=False))
    for obstacle, state in states:
        look = _obstacle_look(colours[obstacle.kind], state)
        xy = np.asarray(obstacle.polygon)
        sheet.axes.fill(*xy.T, zorder=3, **look)
        sheet.legend(7, f"{obstacle.kind}, {state}", Patch(**look))


def _draw_walls(sheet: Sheet, map: Map) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    sides = np.concatenate([np.stack([np.array(w)[:-1], np.array(w)[1:]], 1) for w in map.walls])
    lines = shapely.linestrings(sides)
    if map.wall_thickness > 0:
        # One shape per side: a single one for walls that close a ring would need holes.
        shapes = shapely.buffer(lines, map.wall_thickness / 2)
        outlines = [shapely.get_coordinates(shape.exterior) for shape in shapes]
        bodies: Any = PolyCollection(outlines, facecolors=WALL_COLOUR, edgecolors=WALL_COLOUR)
    else:
        bodies = LineCollection([*sides], colors=WALL_COLOUR)
    bodies.set(linewidths=0.6 if map.wall_thickness > 0 else 1.8, zorder=4)
    sheet.axes.add_collection(bodies, autolim=False)
    step = (sheet.bounds[2] - sheet.bounds[0]) / 150
    sheet.ink += [_marks(np.asarray(wall, dtype=float), step) for wall in map.walls]


def _draw_cells(sheet: Sheet, grid: OccupancyGrid) -> None:
    from matplotlib.colors import ListedColormap

    # Shrinking keeps a block if any of its cells is occupied: thin walls must not fade away.
    block = max(1, ceil(max(grid.occupied.shape) / 2000))
    rows, columns = (ceil(n / block) for n in grid.occupied.shape)
    cells = np.zeros((rows * block, columns * block), dtype=bool)
    cells[: grid.occupied.shape[0], : grid.occupied.shape[1]] = grid.occupied
    cells = np.logical_or.reduce(cells.reshape(rows, block, columns, block), axis=(1, 3))
    (x, y), size = grid.origin, grid.resolution * block
    sheet.axes.imshow(
        np.ma.masked_equal(cells.astype(np.uint8), 0),
        extent=(x, x + columns * size, y, y + rows * size),
        origin="lower",
        cmap=ListedColormap([WALL_COLOUR]),
        interpolation="nearest",
        zorder=2.5,
    )
    # Drawing an image resets the limits.
    sheet.axes.set(xlim=sheet.bounds[::2], ylim=sheet.bounds[1::2], aspect="equal")
    some = np.argwhere(cells)[:: max(1, int(cells.sum()) // 5000)]
    sheet.ink.append((some[:, ::-1] + 0.5) * size + (x, y))


def _states(map: Map, events: Sequence[ev.AnyEvent]) -> list[tuple[Obstacle, State]]:
    """Return every obstacle there ever was, and what became of it."""
    hidden: State = "never found" if events else "unknown"
    states: dict[str, tuple[Obstacle, State]] = {
        o.id: (o, "known" if o.known else hidden) for o in map.obstacles
    }
    for event in events:
        if isinstance(event, ev.ObstacleAdded):
            new = Obstacle(id=event.obstacle, kind=event.kind, polygon=event.polygon)
            states[new.id] = (new, "known")
        elif isinstance(event, ev.ObstacleFound | ev.ObstacleRemoved) and event.obstacle in states:
            found = isinstance(event, ev.ObstacleFound)
            states[event.obstacle] = (states[event.obstacle][0], "found" if found else "removed")
    return list(states.values())


def _obstacle_look(colour: str, state: State) -> Style:
    match state:
        case "known":
            return {"fc": colour, "ec": INK, "lw": 0.7}
        case "found":
            return {"fc": (*_rgb(colour), 0.35), "ec": colour, "lw": 1.2, "hatch": "////"}
        case "never found" | "unknown":
            return {"fc": "none", "ec": colour, "lw": 1.6, "ls": ":"}
        case "removed":
            return {"fc": "none", "ec": colour, "lw": 0.8, "ls": "--"}


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


def _draw_places(sheet: Sheet, mission: Mission) -> None:
    for name, polygon in mission.zones.items():
        xy = np.asarray(polygon)
        sheet.axes.fill(*xy.T, fc="#56B4E9", alpha=0.16, lw=0, zorder=0.5)
        sheet.axes.fill(*xy.T, fc="none", ec="#3A7CA5", lw=0.9, ls=(0, (4, 2)), zorder=2)
        inner = shapely.Polygon(polygon).representative_point()
        sheet.labels.append(
            Label(name, (inner.x, inner.y), {"color": "#2B5F80", "style": "italic"}, gap=0)
        )
    for name, at in mission.places.items():
        sheet.axes.plot(*at, "o", ms=13, mfc="none", mec="#555555", mew=0.9, zorder=5)
        style = {"color": INK, "weight": "bold", "style": "italic", "fontsize": 11}
        sheet.labels.append(Label(name, at, style, gap=8))


def _draw_drives(
    sheet: Sheet, mission: Mission, events: Sequence[ev.AnyEvent], looks: Mapping[str, Style]
) -> None:
    from matplotlib.lines import Line2D

    width = 1.8 if len(mission.robots) <= 8 else 1.2
    for i, robot in enumerate(mission.robots):
        moves = [e for e in events if isinstance(e, ev.Moved) and e.robot == robot.id]
        xy = np.array([robot.start, *(move.to for move in moves)], dtype=float)
        look, where = looks[robot.id], _aside(sheet, i, len(mission.robots))
        # All the white borders lie below all the lines, so no line hides another one's.
        road = _roads([robot.start, *(move.to for move in moves)])
        border: Style = {"color": "white", "lw": width + 1.4, "alpha": 0.85}
        sheet.axes.plot(*road.T, **border, transform=where, zorder=5.5)
        line: Style = {"color": look["color"], "ls": look["linestyle"], "lw": width}
        sheet.axes.plot(*road.T, **line, solid_joinstyle="round", transform=where, zorder=6)
        marks = _marks(road, 0.08 * (sheet.bounds[2] - sheet.bounds[0]))
        mark: Style = {"color": look["color"], "marker": look["marker"], "ls": ""}
        sheet.axes.plot(*marks.T, **mark, ms=width + 3, mew=0, transform=where, zorder=6)
        length = _driven(moves)
        _draw_start(sheet, robot, look, f"{robot.id} ({robot.motion}), {length:.1f} m")
        if moves:
            hollow: Style = {"marker": look["marker"], "mec": look["color"], "mfc": "white"}
            sheet.axes.plot(*xy[-1], ls="", ms=11, mew=1.6, zorder=6.5, transform=where, **hollow)
            sheet.ink.append(_marks(xy, (sheet.bounds[2] - sheet.bounds[0]) / 150))
    grey: Style = {"marker": "o", "ls": "", "color": "#777777"}
    sheet.legend(3, "start", Line2D([], [], ms=10, mec=INK, mew=0.8, **grey))
    sheet.legend(4, "end", Line2D([], [], ms=7, mew=1.6, mfc="white", mec="#777777", **grey))


def _aside(sheet: Sheet, i: int, n: int) -> Any:
    """Return where to draw robot `i` of n: a hair's breadth aside, so that shared roads show all.

    The offsets lie on a zigzag across the main diagonal, which tells roads of every direction
    apart, and stay within 0.25 m so that no route seems to touch a wall.
    """
    from matplotlib.transforms import ScaledTranslation

    scale = MAP_SIZE * 72 / max(*np.subtract(sheet.bounds[2:], sheet.bounds[:2]))
    reach = min(1.3 * (n - 1), 4.0, max(1.5, 0.25 * scale))
    along = reach * (2 * i / (n - 1) - 1) if n > 1 else 0.0
    across = (i % 2 - 0.5) * min(1.4, reach)
    x, y = (along + across) / 2**0.5 / 72, (across - along) / 2**0.5 / 72
    return sheet.axes.transData + ScaledTranslation(x, y, sheet.figure.dpi_scale_trans)


def _roads(stations: Sequence[Point]) -> Floats:
    """Return a path that drives each road once, with gaps (NaN) for those driven before.

    Dashes drawn forth and back would fill each other's gaps.
    """
    drawn: set[frozenset[Point]] = set()
    path: list[Point] = [stations[0]]
    for a, b in pairwise(stations):
        if (road := frozenset((a, b))) in drawn:
            path += [(nan, nan), b]
        else:
            path.append(b)
            drawn.add(road)
    return np.array(path, dtype=float)


def _marks(path: Floats, every: float) -> Floats:
    """Return points along a path with gaps, `every` so many metres."""
    steps = np.nan_to_num(np.hypot(*np.diff(path, axis=0).T))
    along = np.concatenate([[0.0], np.cumsum(steps)])
    places = np.arange(every / 2, along[-1], every)
    leg = np.searchsorted(along, places) - 1
    share = (places - along[leg]) / steps[leg]
    marks: Floats = path[leg] + share[:, None] * (path[leg + 1] - path[leg])
    return marks


def _driven(moves: Iterable[ev.Moved]) -> float:
    """Return the length of some moves [m]."""
    return sum(hypot(m.to[0] - m.from_[0], m.to[1] - m.from_[1]) for m in moves)


def _draw_start(sheet: Sheet, robot: Robot, look: Style, text: str) -> None:
    from matplotlib.lines import Line2D

    size = 11 if look["marker"] != "*" else 14
    sheet.axes.plot(
        *robot.start,
        marker=look["marker"],
        ms=size,
        mfc=look["color"],
        mec=INK,
        mew=0.9,
        ls="",
        zorder=9,
    )
    style = {"color": look["color"], "weight": "bold", "fontsize": 10}
    sheet.labels.append(Label(robot.id, robot.start, style, gap=8))
    sheet.legend(1, text, Line2D([], [], **look, lw=1.8, ms=7, mec=INK, mew=0.6))


def _tasks(mission: Mission, events: Iterable[ev.AnyEvent]) -> list[Task]:
    tasks = {task.id: task for task in mission.tasks}
    for event in events:
        if isinstance(event, ev.TaskAdded):
            tasks[event.task.id] = event.task
        elif isinstance(event, ev.TaskCancelled):
            tasks.pop(event.task, None)
    return list(tasks.values())


def _draw_stops(
    sheet: Sheet,
    tasks: Sequence[Task],
    colours: Mapping[Key, str],
    missed: Collection[Key],
    why: str,
) -> None:
    """Draw the stops, one marker for all that share a point, in the colour of who served them."""
    from matplotlib.lines import Line2D

    points: dict[tuple[Point, str], list[tuple[Task, Stop]]] = {}
    for task in tasks:
        for stop in task.stops:
            points.setdefault((stop.at, stop.name), []).append((task, stop))
    for (at, name), stops in points.items():
        keys = [(task.id, stop.name) for task, stop in stops]
        bad = [key for key in keys if key in missed]
        seen = {colours.get(key, "#8A8A8A") for key in keys if key not in missed}
        face = "white" if not seen else (seen.pop() if len(seen) == 1 else "#4D4D4D")
        size = 8.5 if name != "visit" else 7
        sheet.axes.plot(
            *at, marker=STOP_MARKERS[name], ms=size, mfc=face, mec=INK, mew=0.9, ls="", zorder=7
        )
        sheet.legend(
            5, name, Line2D([], [], marker=STOP_MARKERS[name], ls="", ms=8, mfc="white", mec=INK)
        )
        if len(bad) == len(stops):
            cross: Style = {"marker": "x", "ls": "", "mec": "black", "mew": 2.2}
            sheet.axes.plot(*at, **cross, ms=12, zorder=10)
            sheet.legend(6, why, Line2D([], [], **cross, ms=9))
        style: Style = {"color": "#444444", "fontsize": 8}
        if bad and len(stops) > 1:
            text = f"{len(bad)} {why}"
            sheet.labels.append(Label(text, at, style, gap=6.5))
        elif len(stops) == 1 and (name != "delivery" or bad):
            sheet.labels.append(Label(keys[0][0], at, style, gap=6.5, needed=bool(bad)))


def _cut_off_stops(mission: Mission, nodes: NDArray[Any], edges: NDArray[Any]) -> set[Key]:
    """Return the stops whose nearest node is not connected to that of any robot's start."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    stops = [(task.id, stop.name, stop.at) for task in mission.tasks for stop in task.stops]
    if not len(nodes):
        return {(task, name) for task, name, _ in stops}
    links = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(nodes),) * 2)
    _, part = connected_components(links, directed=False)
    tree = KDTree(nodes)
    near = {part[tree.query(robot.start)[1]] for robot in mission.robots}
    return {(task, name) for task, name, at in stops if part[tree.query(at)[1]] not in near}


def _run_title(
    mission: Mission,
    events: Sequence[ev.AnyEvent],
    tasks: Sequence[Task],
    served: Collection[Key],
) -> tuple[str, str]:
    first = [e.allocator for e in events if isinstance(e, ev.MissionStarted)]
    moves = [e for e in events if isinstance(e, ev.Moved)]
    done = sum(all((task.id, stop.name) in served for stop in task.stops) for task in tasks)
    length = _driven(moves)
    last = max((e.t for e in events if isinstance(e, ev.StopServed)), default=0.0)
    parts = [f"{done} of {len(tasks)} tasks done", f"distance {length:.1f} m"]
    heading = f"{mission.name}, allocator {first[0]}" if first else mission.name
    return heading, " · ".join([*parts, f"makespan {last:.1f} s"])
