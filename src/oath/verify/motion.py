"""Judge the motion: contiguous, no faster than allowed, clear of all that stands in the way.

Distances are exact distances between straight segments and the true shapes (wall polylines, cell
squares, obstacle polygons); nothing is grown into an approximate buffer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, groupby, pairwise
from math import ceil
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from oath.events import ObstacleFound
from oath.model import Map, Obstacle, OccupancyGrid, Point
from oath.verify.record import TOLERANCE, Life, Record, Track, Violation, apart

SIGHT_STEP = 0.01
"""Distance between the points of an obstacle's outline that are tried for a line of sight [m]."""

BUMPER = 0.02
"""A robot notices what blocks it this near to its body, in sight or not [m]."""

CELLS_AT_ONCE = 16
"""Length of the pieces [cells] in which a move is compared with a grid: the windows stay small."""

Floats = NDArray[np.float64]
Shapes = NDArray[Any]
"""An array of shapely geometries."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """The nearest that two robots' centres ever came: how near [m], who, and when [s]."""

    distance: float
    robots: tuple[str, str]
    t: float


def judge_motion(record: Record) -> Iterator[Violation]:
    """Yield what is wrong with the moves of all robots and with what they sensed."""
    for track in record.tracks.values():
        yield from _chain_faults(track, record.begin)
        yield from _limit_faults(track, record.mission.map)
        yield from _halt_faults(track)
        yield from _wall_faults(track, record.mission.map)
        yield from _cell_faults(track, record.mission.map.grid)
        yield from _obstacle_faults(track, record)
    yield from _sensing_faults(record)


def _chain_faults(track: Track, begin: float) -> Iterator[Violation]:
    """Each move starts where and not before the last one ended."""
    here, now = track.robot.start, begin
    for i, seq in enumerate(track.seq):
        start = _point(track.from_[i])
        gap = apart(here, start)
        if gap > TOLERANCE:
            text = (
                f"a move starts at {_xy(start)}, {gap:.6g} m from where the robot is, {_xy(here)}"
            )
            yield _fault("contiguity", track, seq, text)
        if track.start[i] < now - TOLERANCE:
            text = f"a move starts at {track.start[i]:.6g} s, before the last one ends, {now:.6g} s"
            yield _fault("contiguity", track, seq, text)
        here, now = _point(track.to[i]), max(now, float(track.end[i]))


def _limit_faults(track: Track, map: Map) -> Iterator[Violation]:
    x_min, y_min, x_max, y_max = map.bounds
    low, high = np.array([x_min, y_min]), np.array([x_max, y_max])
    for points in (track.from_[:1], track.to):
        outside = ((points < low - TOLERANCE) | (points > high + TOLERANCE)).any(axis=1)
        for i in np.flatnonzero(outside):
            text = f"it is at {_xy(points[i])}, outside of the bounds {[*map.bounds]}"
            yield _fault("bounds", track, track.seq[i], text)
    speed, length, time = track.robot.speed, track.length, np.maximum(track.end - track.start, 0)
    for i in np.flatnonzero(length > speed * time + TOLERANCE):
        text = f"{length[i]:.6g} m in {time[i]:.6g} s; its speed is at most {speed:.6g} m/s"
        yield _fault("speed", track, track.seq[i], text)


def _halt_faults(track: Track) -> Iterator[Violation]:
    for since, until, why in track.halts:
        shared = np.minimum(track.end, until) - np.maximum(track.start, since)
        for i in np.flatnonzero((shared > TOLERANCE) & (track.length > 0)):
            span = f"{track.start[i]:.6g}..{track.end[i]:.6g} s"
            text = f"it moves at {span} though it is {why} since {since:.6g} s"
            yield _fault("halted", track, track.seq[i], text)


def _wall_faults(track: Track, map: Map) -> Iterator[Violation]:
    polylines = [np.asarray(wall, dtype=float) for wall in map.walls]
    if not polylines or not len(track.seq):
        return
    sides = shapely.linestrings(np.concatenate([np.stack([w[:-1], w[1:]], 1) for w in polylines]))
    owner = np.repeat(np.arange(len(polylines)), [len(w) - 1 for w in polylines])
    lines = _lines(track.from_, track.to)
    needed = map.wall_thickness / 2 + track.robot.radius
    moves, walls = shapely.STRtree(sides).query(lines, predicate="dwithin", distance=needed)
    gaps = shapely.distance(lines[moves], sides[walls])
    if needed <= TOLERANCE:
        # A point among lines without width can only be caught in the act of crossing one.
        whole = np.array([shapely.linestrings(wall) for wall in polylines])
        gaps[shapely.crosses(lines[moves], whole[owner[walls]])] = -1.0
    for i, wall, gap in _nearest(moves, owner[walls], gaps, needed):
        text = (
            f"the move {_leg(track, i)} passes wall {wall} at {max(gap, 0):.6g} m from its middle; "
            f"radius and half of the wall need {needed:.6g} m"
        )
        yield _fault("wall", track, track.seq[i], text)


def _nearest(
    moves: NDArray[np.intp], others: NDArray[np.intp], gaps: Floats, needed: float
) -> Iterator[tuple[int, int, float]]:
    """Yield the worst offence of each move that comes too near: move, what, gap [m]."""
    order = np.lexsort((gaps, moves))
    order = order[gaps[order] < needed - TOLERANCE]
    _, first = np.unique(moves[order], return_index=True)
    for k in order[first]:
        yield int(moves[k]), int(others[k]), float(gaps[k])


def _cell_faults(track: Track, grid: OccupancyGrid | None) -> Iterator[Violation]:
    if grid is None or not len(track.seq):
        return
    needed = track.robot.radius
    found = [_cells_near(grid, a, b, needed) for a, b in zip(track.from_, track.to, strict=True)]
    moves = np.repeat(np.arange(len(found)), [len(cells) for cells in found])
    cells = np.concatenate(found)
    # Without a radius, only the inside of a cell is forbidden; driving along its edge is not.
    inset = TOLERANCE if needed <= TOLERANCE else 0.0
    low = np.asarray(grid.origin) + cells * grid.resolution + inset
    high = low + grid.resolution - 2 * inset
    squares = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
    gaps = shapely.distance(_lines(track.from_, track.to)[moves], squares)
    if inset:
        gaps[gaps == 0.0] = -1.0
    for i, k, gap in _nearest(moves, np.arange(len(cells)), gaps, needed):
        column, row = cells[k]
        text = (
            f"the move {_leg(track, i)} passes the occupied cell in row {row}, column {column} at "
            f"{max(gap, 0):.6g} m; its radius is {needed:.6g} m"
        )
        yield _fault("cell", track, track.seq[i], text)


def _cells_near(grid: OccupancyGrid, a: Floats, b: Floats, reach: float) -> NDArray[np.int64]:
    """Return (k, 2) column and row of the occupied cells within `reach` of a segment, and some."""
    size, (rows, columns) = grid.resolution, grid.occupied.shape
    a, b = (a - grid.origin) / size, (b - grid.origin) / size
    reach = reach / size + 0.75  # the centre of a cell is within 0.71 cells of all of it
    pieces = max(1, ceil(float(np.hypot(*(b - a))) / CELLS_AT_ONCE))
    knots = a + np.linspace(0.0, 1.0, pieces + 1)[:, None] * (b - a)
    found = []
    for p, q in pairwise(knots):
        x0, y0 = np.maximum(np.floor(np.minimum(p, q) - reach), 0).astype(int)
        x1, y1 = np.ceil(np.maximum(p, q) + reach).astype(int)
        y, x = np.nonzero(
            grid.occupied[y0 : max(min(y1, rows), y0), x0 : max(min(x1, columns), x0)]
        )
        cells = np.stack([x + x0, y + y0], axis=1)
        along = q - p
        share = (cells + 0.5 - p) @ along / max(float(along @ along), 1e-300)
        off = cells + 0.5 - p - np.clip(share, 0.0, 1.0)[:, None] * along
        found.append(cells[np.hypot(*off.T) <= reach])
    return np.unique(np.concatenate(found), axis=0)


def _obstacle_faults(track: Track, record: Record) -> Iterator[Violation]:
    motion = record.mission.motions[track.robot.motion]
    lives = [life for life in record.lives if motion.blocked_by(life.obstacle.kind)]
    if not lives or not len(track.seq):
        return
    tree = shapely.STRtree([shapely.Polygon(life.obstacle.polygon) for life in lives])
    lines, radius = _lines(track.from_, track.to), track.robot.radius
    near = tree.query(lines, predicate="dwithin", distance=radius)
    pairs = sorted((int(which), int(move)) for move, which in near.T)
    for which, group in groupby(pairs, key=lambda pair: pair[0]):
        yield from _approach_faults(track, lives[which], [move for _, move in group])


def _approach_faults(track: Track, life: Life, moves: list[int]) -> Iterator[Violation]:
    """Judge the moves near one obstacle, in the order of time.

    A robot that is too near already when the obstacle appears may drive away, so until it has
    once been clear, all that is asked is that it comes no nearer than it was then.
    """
    radius, obstacle = track.robot.radius, life.obstacle
    shape = shapely.Polygon(obstacle.polygon)
    allowed = min(radius, _gap(shapely.Point(track.at(life.since)), shape, radius))
    for i in moves:
        begin, end = max(track.start[i], life.since), min(track.end[i], life.until)
        if end < begin or (end == begin and track.end[i] > track.start[i]):
            continue
        p, q = _part(track, i, begin), _part(track, i, end)
        gap = _gap(_lines(p[None], q[None])[0], shape, radius)
        if gap < allowed - TOLERANCE:
            limit = f"its radius is {radius:.6g} m"
            if allowed < radius:
                limit = f"it was at {max(allowed, 0):.6g} m when the obstacle appeared"
            text = (
                f"the move {_leg(track, i)} passes obstacle '{obstacle.id}' ({obstacle.kind}) at "
                f"{max(gap, 0):.6g} m; {limit}"
            )
            yield _fault("obstacle", track, track.seq[i], text)
        if _gap(shapely.Point(q), shape, radius) >= radius - TOLERANCE:
            allowed = radius


def _gap(path: Any, shape: Any, radius: float) -> float:
    """Return the distance [m] of a path to a polygon; -1 for a point-like robot inside of it."""
    if radius <= TOLERANCE and shapely.intersects(path, shape.buffer(-TOLERANCE)):
        return -1.0
    return float(shapely.distance(path, shape))


def _part(track: Track, i: int, t: float) -> Floats:
    """Return where move `i` is at time `t` [s]."""
    span = track.end[i] - track.start[i]
    share = (t - track.start[i]) / span if span > 0 else 1.0
    point: Floats = track.from_[i] + share * (track.to[i] - track.from_[i])
    return point


def _sensing_faults(record: Record) -> Iterator[Violation]:
    known = {obstacle.id for obstacle in record.mission.map.obstacles if obstacle.known}
    for seq, event in record.usable:
        if not isinstance(event, ObstacleFound):
            continue
        lives = [life for life in record.lives if life.obstacle.id == event.obstacle]
        now = (one for one in lives if one.since <= event.t <= one.until + TOLERANCE)
        life = next(now, lives[0])
        text = f"obstacle '{event.obstacle}' is found, but "
        if event.obstacle in known or life.since > record.begin:
            text += "it was known already"
        elif not shapely.equals(shapely.Polygon(event.polygon), _shape(life)):
            text += "its polygon is not the one in the mission"
        else:
            problem = _unsensed(record, record.tracks[event.robot], event.t, life.obstacle)
            if problem is None:
                known.add(event.obstacle)
                continue
            text += problem
        yield Violation(rule="sensing", seq=seq, robot=event.robot, message=text)
        known.add(event.obstacle)


def _shape(life: Life) -> Any:
    return shapely.Polygon(life.obstacle.polygon)


def _unsensed(record: Record, track: Track, t: float, obstacle: Obstacle) -> str | None:
    """Return why a robot cannot have sensed an obstacle at time `t` [s], None if it can."""
    eye, sensing = np.array(track.at(t)), track.robot.sensing
    shape = shapely.Polygon(obstacle.polygon)
    gap = float(shapely.distance(shapely.Point(eye), shape))
    blocks = record.mission.motions[track.robot.motion].blocked_by(obstacle.kind)
    if blocks and gap <= track.robot.radius + BUMPER + TOLERANCE:
        return None
    if gap > sensing + TOLERANCE:
        return f"it is {gap:.6g} m from {_xy(eye)}; the robot senses {sensing:.6g} m"
    if gap == 0.0:
        return None
    nearest = shapely.get_coordinates(shapely.shortest_line(shapely.Point(eye), shape))[1:]
    outline = shapely.get_coordinates(shapely.segmentize(shape.exterior, SIGHT_STEP))
    # The first part in sight may lie between two of the points tried, hence the step's slack.
    tried = outline[np.hypot(*(outline - eye).T) <= sensing + SIGHT_STEP]
    if _any_in_sight(record.mission.map, eye, np.concatenate([nearest, tried])):
        return None
    return f"walls hide all of it that is within {sensing:.6g} m of {_xy(eye)}"


def _any_in_sight(map: Map, eye: Floats, points: Floats) -> bool:
    # Sight ends just short of the point, which may itself lie on a wall.
    reach = points - eye
    far = eye + reach * (1 - TOLERANCE / np.maximum(np.hypot(*reach.T), TOLERANCE))[:, None]
    hidden = np.zeros(len(points), dtype=bool)
    if map.walls:
        walls = shapely.STRtree([shapely.LineString(wall) for wall in map.walls])
        rays = _lines(np.broadcast_to(eye, far.shape), far)
        hidden[walls.query(rays, predicate="intersects")[0]] = True
    if map.grid is not None:
        hidden |= _behind_cells(map.grid, eye, far)
    return not bool(hidden.all())


def _behind_cells(grid: OccupancyGrid, eye: Floats, points: Floats) -> NDArray[np.bool_]:
    """Return (n,) whether an occupied cell lies between; the last cell before a point is let off.

    Sampled at half a cell, so a ray may cut a corner: the judge errs on the robot's side.
    """
    length = np.hypot(*(points - eye).T)
    steps = np.arange(0.0, float(length.max(initial=0.0)), grid.resolution / 2)
    share = steps[None, :] / np.maximum(length, TOLERANCE)[:, None]
    samples = eye + share[..., None] * (points - eye)[:, None, :]
    cells = np.floor((samples - grid.origin) / grid.resolution).astype(int)
    rows, columns = grid.occupied.shape
    x, y = cells[..., 0], cells[..., 1]
    inside = (x >= 0) & (y >= 0) & (x < columns) & (y < rows)
    inside &= steps[None, :] < length[:, None] - grid.resolution
    hit = np.zeros(inside.shape, dtype=bool)
    hit[inside] = grid.occupied[y[inside], x[inside]]
    return np.asarray(hit.any(axis=1))


def separation(record: Record) -> Separation | None:
    """Return the least distance between two robots' centres over the whole run.

    Both move piecewise linearly, so between two neighbouring knots of either their difference is
    d + s e with s in [0, 1], and the least of it is at s = -d.e / e.e, cut to [0, 1].

    Returns
    -------
    None if there are fewer than two robots.
    """
    best: Separation | None = None
    for one, other in combinations(record.tracks.values(), 2):
        times = np.union1d(np.union1d(one.times, other.times), [record.begin, record.end])
        d = _positions(one, times) - _positions(other, times)
        e = np.diff(d, axis=0, append=d[-1:])
        share = np.clip(-(d * e).sum(axis=1) / np.maximum((e * e).sum(axis=1), 1e-300), 0.0, 1.0)
        distance = np.hypot(*(d + share[:, None] * e).T)
        k = int(distance.argmin())
        if best is None or distance[k] < best.distance:
            t = times[k] + share[k] * (times[min(k + 1, len(times) - 1)] - times[k])
            names = (one.robot.id, other.robot.id)
            best = Separation(distance=float(distance[k]), robots=names, t=float(t))
    return best


def _positions(track: Track, times: Floats) -> Floats:
    return np.stack([np.interp(times, track.times, track.points[:, i]) for i in (0, 1)], axis=1)


def _lines(a: Floats, b: Floats) -> Shapes:
    """Return (n,) segments; a point where both ends are the same, for no line has no length."""
    lines: Shapes = shapely.linestrings(np.stack([a, b], axis=1))
    still = (a == b).all(axis=1)
    if still.any():
        lines[still] = shapely.points(a[still])
    return lines


def _point(array: Floats) -> Point:
    return float(array[0]), float(array[1])


def _xy(point: Point | Floats) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


def _leg(track: Track, i: int) -> str:
    return f"{_xy(track.from_[i])} to {_xy(track.to[i])}"


def _fault(rule: Any, track: Track, seq: Any, text: str) -> Violation:
    return Violation(rule=rule, seq=int(seq), robot=track.robot.id, message=text)
