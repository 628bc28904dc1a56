"""
Compiled algorithms of OATH; those that take long release the interpreter lock.
"""

from collections.abc import Sequence
from typing import Annotated

import numpy
import numpy.typing
from numpy.typing import NDArray


class Workspace:
    """
    Obstacles of the plane in a uniform grid: exact clearance of points and segments [m].
    """

    def __init__(self, x_min: float, y_min: float, x_max: float, y_max: float, cell: float) -> None: ...

    def add_wall(self, ends: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], half_width: float, kind: int) -> int:
        """
        Add a polyline (n, 2) whose points within half_width are solid; return its index.
        """

    def add_polygon(self, corners: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], kind: int) -> int:
        """Add a solid polygon (n, 2); return its index."""

    def remove(self, shape: int) -> None:
        """Take a wall or polygon out again."""

    def set_cells(self, cells: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], resolution: float, x: float, y: float, kind: int, boundary: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> None:
        """
        Add a raster (rows, columns) with its lower left corner at (x, y); boundary (2 n, 2) holds the ends of the segments between free and occupied cells.
        """

    def clearance(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], kinds: Sequence[int], limit: float = float('inf')) -> NDArray[numpy.float64]:
        """
        Distance (n,) from points (n, 2) to the nearest surface of the flagged kinds, 0 inside, at most limit.
        """

    def free(self, a: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], b: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], radius: float, kinds: Sequence[int]) -> NDArray[numpy.uint8]:
        """
        Whether (n,) the segments a[i]-b[i] keep the radius from all of the flagged kinds.
        """

    def shapes_near(self, ax: float, ay: float, bx: float, by: float, radius: float, kinds: Sequence[int]) -> list[int]:
        """
        Indices of the shapes that the segment touches or comes nearer to than the radius.
        """

UNREACHABLE: int = 1152921504606846975

class Graph:
    """
    Roadmap: nodes [m], undirected edges, and a cost [um] per edge and mode.
    """

    def __init__(self, modes: int) -> None: ...

    @property
    def size(self) -> int:
        """Number of nodes."""

    @property
    def edges(self) -> int:
        """Number of edges."""

    def add_nodes(self, at: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> None:
        """Append nodes (n, 2)."""

    def add_edges(self, a: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], b: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], labels: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """Append edges, unreachable in every mode."""

    def set_costs(self, mode: int, edges: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], costs: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """
        Set the costs [um] of edges in a mode; at least 1, and no less than the straight line.
        """

    def costs(self, mode: int) -> NDArray[numpy.int64]:
        """Costs [um] of all edges in a mode."""

    def points(self) -> NDArray[numpy.float64]:
        """Positions (n, 2) of all nodes."""

    def ends(self) -> NDArray[numpy.int32]:
        """Nodes (m, 2) of all edges."""

    def labels(self) -> NDArray[numpy.int32]:
        """Label class (m,) of all edges."""

    def nearest(self, x: float, y: float, k: int) -> NDArray[numpy.int32]:
        """The k nodes nearest to a point, nearest first."""

    def travel(self, mode: int, sources: Sequence[int], targets: Sequence[int], allowed: Sequence[int]) -> NDArray[numpy.int64]:
        """
        Shortest costs (sources, targets) [um] over edges whose label is allowed; UNREACHABLE where there is no path.
        """

class Planner:
    """Layered D*-Lite over the implicit product of a graph and an automaton."""

    def __init__(self, graph: Graph, mode: int, drive: Annotated[NDArray[numpy.uint8], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], targets: Sequence[int], serve: Annotated[NDArray[numpy.uint8], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], settled: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """
        Plan the legs to the target nodes in order. drive (labels, q, q'), serve (legs, q, q') and settled (q,) flag how the rule state may move and where it may end.
        """

    def start(self, leg: int, x: float, y: float, nodes: Sequence[int], costs: Sequence[int], labels: Sequence[int], states: Sequence[int]) -> None:
        """
        The robot is at (x, y) on its way to stop `leg`; it may enter the graph at the nodes at these costs [um], driving edges of these labels.
        """

    def changed(self, edges: Sequence[int]) -> None:
        """The costs of these edges changed."""

    def plan(self) -> int:
        """Repair the plan; return its cost [um], UNREACHABLE if there is none."""

    def path(self) -> NDArray[numpy.int32]:
        """
        Steps (n, 3) of the last plan: leg, node (-1: the leg's stop is served), rule state.
        """

    @property
    def blocked(self) -> int:
        """The first leg without a way, or -1."""

    @property
    def expanded(self) -> int:
        """States expanded so far."""

def pull(path: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], workspace: Workspace, radius: float, blocked: Sequence[int], costly: Sequence[int], zones: Workspace, labelled: Sequence[int]) -> NDArray[numpy.int32]:
    """
    Indices of the points of a path (n, 2) that remain after string pulling. Shortcuts keep the radius from the blocked kinds and touch no costly kind and no labelled zone.
    """

def search(cost: Annotated[NDArray[numpy.float64], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], first: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], last: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], kind: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], owner: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], service: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], able: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], mode: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], start: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], capacity: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], aboard: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], most: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], speed: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], ready: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], makespan_weight: float, routes: Sequence[Sequence[int]], seed: int, seconds: float, iterations: int) -> tuple[list[list[int]], int]:
    """
    Ruin and recreate: better routes (lists of stops) and the iterations made. Task t has the kind 0 = delivery (stops t and n + t), 1 = visit, 2 = aboard (its delivery is stop t). A robot is given `most` tasks at most, those aboard not counted. cost (modes, n, n) [m] symmetric; negative seconds or iterations do not limit.
    """

def solve_exact(cost: Annotated[NDArray[numpy.float64], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], first: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], last: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], visit: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)], service: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], able: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], mode: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], start: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], capacity: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], most: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], speed: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], makespan_weight: float, skip: int, upper: float, seconds: float, states: int) -> tuple[list[list[int]], float, float, bool, int]:
    """
    Least sum of lengths + makespan_weight * makespan, by bounded dynamic programming.

    Parameters
    ----------
    cost
        (M, L, L) travel cost [m] per mode, row = from; inf = unreachable.
    first, last, visit, service
        (n,) locations of the tasks' stops; 1 = has only the first and loads nothing; time at each [s].
    able
        (n, R) which robot may serve which task.
    mode, start, capacity, most, speed
        (R,) cost matrix, location, tasks carried at once, tasks in all, [m/s]. Robots are filled in
        this order: the answer does not depend on it, the time does.
    makespan_weight
        [m/s].
    skip
        Serve exactly n - skip tasks.
    upper
        Only objectives below this one [m] are looked for; inf if none is known.
    seconds, states
        Limits of time and memory (24 bytes a state, 40 with a makespan; tables take up to twice that
        again).

    Returns
    -------
    routes
        Per robot its stops: t is task t's first, n + t its last. Empty if there is nothing below
        `upper`, or nothing was found within the limits.
    value
        Their objective [m]; inf without routes.
    lower
        No objective is below this one [m]; at most `upper`.
    complete
        Whether the search ended before its limits: `value`, or else `upper`, is then the optimum. Above
        32 tasks or 1000 robots there is only `lower`.
    states
        States kept.

    Raises
    ------
    ValueError
        A location or mode outside of `cost`, a negative or NaN cost, shapes that disagree.
    """

def select_tasks(cost: numpy.typing.NDArray[numpy.float64], start: int, first: numpy.typing.NDArray[numpy.int32], last: numpy.typing.NDArray[numpy.int32], visit: numpy.typing.NDArray[numpy.bool_], take: int, capacity: int, work: int = 3500000) -> tuple[numpy.typing.NDArray[numpy.int32], float, bool]:
    """
    Choose tasks and the shortest open pickup-and-delivery order, by dynamic programming.

    Parameters
    ----------
    cost
        (L, L) travel cost [m], row = from; inf = unreachable. Need not be symmetric.
    start
        Location of the robot.
    first, last
        (n,) locations of the tasks' first and last stops; n <= 32.
    visit
        (n,) the task has only its first stop and loads nothing.
    take
        Number of tasks to take, cut to n.
    capacity
        Tasks carried at once.
    work
        Additions that the wide pass may spend; about 1e9 take a second.

    Returns
    -------
    order
        Stops in order: i is task i's first stop, n + i its last; empty if `take` tasks cannot be done.
    length
        Length of the path [m]; inf if there is none.
    exact
        Whether the path is proven to be shortest. The same input always gives the same answer.

    Raises
    ------
    ValueError
        More than 32 tasks, a location outside of `cost`, a negative or NaN cost.
    """
