"""The third stage: which tasks of its cluster a robot takes, and in which order.

Source: Li, Ren, Miller, Coogan, Feigh, Zhao, "Adaptive Obstacle-Aware Task Assignment and Planning
for Heterogeneous Robot Teaming" (2025), whose MILP is the cross-check here. The default is a
dynamic program over (picked, delivered, last stop), which gives the same lengths some thousand
times sooner.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from oath import _core
from oath.allocate.problem import Problem
from oath.model import StopName

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Method = Literal["dp", "milp"]
Picks = tuple[tuple[int, StopName], ...]
"""Stops in order: index of the task, and which of its stops."""

CORE_LIMIT = 32
"""Tasks that the compiled search takes, and so the most that a robot is given at once."""

QUICK_WORK, LONG_WORK, MANY = 3_500_000, 15_000_000, 12
"""Additions of the exact search: the first for FEW to MANY tasks; fewer seldom need as much."""

FEW, CANDIDATES = 5, 24
"""Up to FEW tasks are chosen among CORE_LIMIT candidates, more of them among CANDIDATES."""


def select(
    problem: Problem, robot: int, candidates: Sequence[int], *, method: Method = "dp"
) -> Picks:
    """Choose min(Q, compatible) tasks and the shortest order of their stops.

    The path is open and begins where the robot is free. Q is the robot's capacity, or `max_tasks`
    if that is less; one without room still takes one visit, which loads nothing. If costs are so
    one-sided that no path serves that many, one less is tried.

    Parameters
    ----------
    robot
        Index of the robot.
    candidates
        Indices of tasks; those that the robot cannot do are passed over.
    method
        ``dp``: dynamic programming, exact wherever its bounds keep it within its work limit: on all
        random instances tried with 9 tasks of 9, 5 of 24 or 4 of 32. Where the limit is met, a beam
        search and ruin and recreate take over, so that 12 tasks take about 30 ms and 18 stay far
        below 0.7 s. Among more candidates than `CORE_LIMIT` or `CANDIDATES` the nearest are kept
        first (see `nearest`).
        ``milp``: the paper's program, solved by HiGHS; exact, for few tasks.

    Returns
    -------
    Picks
        Empty only if no candidate is feasible.
    """
    feasible = problem.feasible()[robot]
    tasks = np.array([task for task in candidates if feasible[task]], dtype=np.intp)
    most = min(max(1, int(problem.capacity[robot])), int(problem.max_tasks[robot]))
    take = min(most, len(tasks), CORE_LIMIT)
    if method == "dp":
        limit = CORE_LIMIT if take <= FEW else max(take, CANDIDATES)
        tasks = nearest(problem, robot, tasks, limit)
    for count in range(take, 0, -1):
        if method == "dp":
            stops, _, _ = dynamic(problem, robot, tasks, count)
        else:
            stops = program(problem, robot, tasks, count)
        if stops:
            return _picks(problem, tasks, stops)
    return ()


def nearest(problem: Problem, robot: int, tasks: NDArray[np.intp], limit: int) -> NDArray[np.intp]:
    """Keep `limit` tasks, grown one by one from where the robot is.

    Next is always the task whose stops are cheapest to reach from any stop kept so far, or from the
    robot: its cost of insertion if the way back is free.
    """
    if len(tasks) <= limit:
        return tasks
    cost = problem.cost[problem.mode[robot]]
    pickup, delivery = problem.pickup[tasks], problem.delivery[tasks]
    to_pickup = cost[problem.start[robot], pickup]
    to_delivery = cost[pickup, delivery]
    kept: list[int] = []
    for _ in range(limit):
        price = to_pickup + to_delivery
        price[kept] = np.inf
        new = int(np.argmin(price))
        kept.append(new)
        for at in (pickup[new], delivery[new]):
            to_pickup = np.minimum(to_pickup, cost[at, pickup])
            to_delivery = np.minimum(to_delivery, cost[at, delivery])
    chosen: NDArray[np.intp] = tasks[np.sort(kept)]
    return chosen


def _picks(problem: Problem, tasks: NDArray[np.intp], stops: Sequence[int]) -> Picks:
    picks: list[tuple[int, StopName]] = []
    for stop in stops:
        task = int(tasks[stop % len(tasks)])
        name: StopName = "delivery" if stop >= len(tasks) else "pickup"
        picks.append((task, "visit" if problem.visit[task] else name))
    return tuple(picks)


def dynamic(
    problem: Problem, robot: int, tasks: NDArray[np.intp], take: int, *, work: int | None = None
) -> tuple[list[int], float, bool]:
    """Choose and order that many of the tasks by dynamic programming.

    Parameters
    ----------
    work
        Additions that the exact search may spend; None = `QUICK_WORK` or `LONG_WORK`.

    Returns
    -------
    stops
        i = first stop of the i-th of the tasks, n + i = its last; [] if there is no such path.
    length
        Of the path [m].
    exact
        Whether it is proven to be the shortest.
    """
    if work is None:
        work = QUICK_WORK if FEW < take <= MANY else LONG_WORK
    order, length, exact = _core.select_tasks(
        problem.cost[problem.mode[robot]],
        int(problem.start[robot]),
        problem.pickup[tasks],
        problem.delivery[tasks],
        problem.visit[tasks],
        take,
        int(problem.capacity[robot]),
        work,
    )
    return order.tolist(), length, exact


def program(
    problem: Problem,
    robot: int,
    tasks: NDArray[np.intp],
    take: int,
    *,
    seconds: float = float("inf"),
) -> list[int]:
    """Choose and order that many of the tasks by a mixed-integer linear program.

    Parameters
    ----------
    seconds
        Wall clock after which it gives up [s].

    Returns
    -------
    list[int]
        Stops as `dynamic` numbers them; [] if there is no such path, or none proven in time.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp  # a third of a second to import

    program = _Program(problem, robot, tasks, take)
    answer = milp(
        program.objective,
        integrality=program.whole,
        bounds=Bounds(0, program.upper),
        constraints=LinearConstraint(program.matrix(), program.least, program.most),
        options={"mip_rel_gap": 0.0, "time_limit": seconds},
    )
    return program.stops(answer.x) if answer.success else []


class _Program:
    """Stop 0 is the robot, 1 + i task i's first stop and 1 + n + i its last, unless i is a visit.

    Variables: x[a, b] = stop b follows stop a, for the legs of finite cost; y[i] = task i is taken;
    u[b] = place of stop b in the order (Miller, Tucker, Zemlin 1960); q[b] = load after it.
    """

    def __init__(self, problem: Problem, robot: int, tasks: NDArray[np.intp], take: int) -> None:
        self.n, self.take, self.capacity = len(tasks), take, int(problem.capacity[robot])
        self.visit = problem.visit[tasks]
        at = [problem.start[robot], *problem.pickup[tasks], *problem.delivery[tasks]]
        cost = problem.cost[problem.mode[robot]][np.ix_(at, at)]
        self.real = [1 + i for i in range(self.n)]
        self.real += [1 + self.n + i for i in range(self.n) if not self.visit[i]]
        self.legs = [
            (a, b) for a in [0, *self.real] for b in self.real if a != b and np.isfinite(cost[a, b])
        ]
        self.y = len(self.legs)
        self.u = self.y + self.n - 1  # u and q of stop 1 stand at u + 1 and q + 1
        self.q = self.u + 2 * self.n
        size = self.q + 2 * self.n + 1
        self.objective = np.zeros(size)
        self.objective[: self.y] = [cost[leg] for leg in self.legs]
        self.whole = np.zeros(size, dtype=np.int64)
        self.whole[: self.y + self.n] = 1
        self.upper = np.ones(size)
        self.upper[self.u + 1 : self.q + 1] = 2 * self.n
        self.upper[self.q + 1 :] = self.capacity
        self.rows: list[dict[int, float]] = []
        self.least: list[float] = []
        self.most: list[float] = []
        self._flow()
        self._order()

    def _add(self, row: dict[int, float], least: float, most: float) -> None:
        self.rows.append(row)
        self.least.append(least)
        self.most.append(most)

    def _flow(self) -> None:
        """Take that many tasks; enter each of their stops once, leave it at most once."""
        self._add({self.y + i: 1.0 for i in range(self.n)}, self.take, self.take)
        self._add({k: 1.0 for k, (a, _) in enumerate(self.legs) if a == 0}, 1.0, 1.0)
        for stop in self.real:
            taken = {self.y + (stop - 1) % self.n: -1.0}
            enter = {k: 1.0 for k, (_, b) in enumerate(self.legs) if b == stop}
            leave = {k: 1.0 for k, (a, _) in enumerate(self.legs) if a == stop}
            self._add(enter | taken, 0.0, 0.0)
            self._add(leave | taken, -np.inf, 0.0)

    def _order(self) -> None:
        """Places rise and loads change along each leg that is used; first stops come first."""
        big = 2.0 * self.n + 1.0
        room = self.capacity + 1.0
        for k, (a, b) in enumerate(self.legs):
            change = 0.0 if self.visit[(b - 1) % self.n] else 1.0 if b <= self.n else -1.0
            place = {self.u + b: 1.0, k: -big}
            load = {self.q + b: 1.0, k: -room}
            if a:
                place[self.u + a] = load[self.q + a] = -1.0
            self._add(place, 1.0 - big, np.inf)
            self._add(load, change - room, np.inf)
        for i in np.flatnonzero(~self.visit).tolist():
            first, last = self.u + 1 + i, self.u + 1 + self.n + i
            self._add({last: 1.0, first: -1.0, self.y + i: -1.0}, 0.0, np.inf)

    def matrix(self) -> csr_array[np.float64]:
        """Return the constraint matrix."""
        from scipy.sparse import csr_array

        values = [value for row in self.rows for value in row.values()]
        columns = [column for row in self.rows for column in row]
        begins = np.cumsum([0, *(len(row) for row in self.rows)])
        return csr_array((values, columns, begins), shape=(len(self.rows), len(self.objective)))

    def stops(self, x: NDArray[np.float64]) -> list[int]:
        """Follow the legs that are used: i for a first stop, n + i for a last."""
        after = {a: b for k, (a, b) in enumerate(self.legs) if x[k] > 0.5}
        path, at = [], 0
        while at in after:
            at = after[at]
            path.append(at - 1)
        return path
