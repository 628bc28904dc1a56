"""Paths that grow task by task, each put where it adds least."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from oath.allocate.problem import Problem
from oath.allocate.selection import Picks
from oath.model import StopName

Matrix = NDArray[np.float64]
Locations = NDArray[np.integer]


def detours(
    cost: Matrix, leave: Locations, enter: Locations, first: Locations, last: Locations
) -> Matrix:
    """Return (m + 1, n): how much longer an open path gets, but for the ways from first to last.

    Gap g of the path leads from leave[g] to enter[g], the last gap from leave[m] to nowhere. What
    is put into it is entered at `first` and left at `last`.

    Parameters
    ----------
    cost
        (L, L) travel cost [m]; that of the path's own gaps is finite.
    leave, enter
        (m + 1,) and (m,) locations.
    first, last
        (n,) locations.

    Examples
    --------
    On a line, from 0 to 4; a point at 6 is 2 further before it or after, one at 3 lies on the way:

    >>> x = np.array([0.0, 4.0, 6.0, 3.0])
    >>> cost, point = abs(x[:, None] - x), np.array([2, 3])
    >>> detours(cost, np.array([0, 1]), np.array([1]), point, point)
    array([[4., 0.],
           [2., 1.]])
    """
    increase: Matrix = cost[np.ix_(leave, first)]
    increase[:-1] += cost[np.ix_(last, enter)].T
    increase[:-1] -= cost[leave[:-1], enter][:, None]
    return increase


def best_places(
    cost: Matrix,
    path: Locations,
    first: Locations,
    last: Locations,
    visit: NDArray[np.bool_],
    whole: NDArray[np.bool_] | None = None,
) -> tuple[Matrix, NDArray[np.intp], NDArray[np.intp]]:
    """Return where both stops of each task go best: the increase [m], and two places (n,).

    The first stop goes behind path[i], the last behind path[j], i <= j; behind the first stop if
    i = j. Ties go to the earlier places. A visit has one stop, i = j; inf = nowhere.

    Parameters
    ----------
    path
        (m + 1,) locations, the robot's own first.
    first, last, visit
        (n,) locations of the stops; whether there is only one.
    whole
        (m + 1,) where a task may go if its stops must stay together; None = anywhere, apart too.
    """
    gaps = len(path)
    way = np.where(visit, 0.0, cost[first, last])
    together = detours(cost, path, path[1:], first, last) + way
    if whole is not None:
        together[~whole] = np.inf
        i = np.argmin(together, axis=0)
        return together[i, np.arange(len(first))], i, i
    apart = (
        detours(cost, path, path[1:], first, first)[:, None]
        + detours(cost, path, path[1:], last, last)[None]
    )
    apart[np.tril_indices(gaps)] = np.inf
    apart[:, :, visit] = np.inf
    apart[np.diag_indices(gaps)] = together
    flat = apart.reshape(gaps * gaps, -1)
    best = np.argmin(flat, axis=0)
    i, j = np.divmod(best, gaps)
    return flat[best, np.arange(len(first))], i, j


class GrowingPath:
    """The path of one robot, and what each task would add to it.

    Parameters
    ----------
    together
        A task's delivery follows its pickup at once; otherwise loads may overlap.
    tasks
        Inserted one after the other.
    """

    def __init__(
        self, problem: Problem, robot: int, tasks: Iterable[int] = (), *, together: bool = False
    ) -> None:
        self.problem, self.together = problem, together
        self.cost = problem.cost[problem.mode[robot]]
        self.path = [int(problem.start[robot])]
        self.stops: list[int] = []
        self.tasks: set[int] = set()
        self._price()
        for task in tasks:
            self.insert(task)

    def _price(self) -> None:
        problem = self.problem
        whole = None
        if self.together:
            whole = np.ones(len(self.path), dtype=np.bool_)
            for place, (a, b) in enumerate(pairwise(self.stops)):
                whole[place + 1] = a != b
        self.prices, self._i, self._j = best_places(
            self.cost, np.array(self.path), problem.pickup, problem.delivery, problem.visit, whole
        )
        """(P,) how much longer the path would get by each task [m], inf = impossible."""

    def insert(self, task: int) -> None:
        """Put a task where it costs least."""
        problem, i, j = self.problem, int(self._i[task]), int(self._j[task])
        self.tasks.add(task)
        if not problem.visit[task]:
            self.path.insert(j + 1, int(problem.delivery[task]))
            self.stops.insert(j, task)
        self.path.insert(i + 1, int(problem.pickup[task]))
        self.stops.insert(i, task)
        self._price()

    def picks(self) -> Picks:
        """Return the stops in order."""
        picks: list[tuple[int, StopName]] = []
        seen: set[int] = set()
        for task in self.stops:
            name: StopName = "delivery" if task in seen else "pickup"
            picks.append((task, "visit" if self.problem.visit[task] else name))
            seen.add(task)
        return tuple(picks)
