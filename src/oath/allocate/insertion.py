"""What it costs to put one more task into a path, for all tasks and places at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
    cost: Matrix, path: Locations, first: Locations, last: Locations, visit: NDArray[np.bool_]
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
    """
    gaps = len(path)
    way = np.where(visit, 0.0, cost[first, last])
    apart = (
        detours(cost, path, path[1:], first, first)[:, None]
        + detours(cost, path, path[1:], last, last)[None]
    )
    apart[np.tril_indices(gaps)] = np.inf
    apart[:, :, visit] = np.inf
    apart[np.diag_indices(gaps)] = detours(cost, path, path[1:], first, last) + way
    flat = apart.reshape(gaps * gaps, -1)
    best = np.argmin(flat, axis=0)
    i, j = np.divmod(best, gaps)
    return flat[best, np.arange(len(first))], i, j
