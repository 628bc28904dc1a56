"""Problems to test allocators with."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from oath.allocate import Problem


def line(
    starts: list[float],
    tasks: list[tuple[float, float]],
    *,
    capacity: int = 2,
    capability: list[list[float]] | None = None,
    types: list[int] | None = None,
    cost: NDArray[np.float64] | None = None,
) -> Problem:
    """Robots and tasks on a line; a task whose ends are equal is a visit.

    Locations are the starts, then the pickups, then the deliveries.
    """
    r, p = len(starts), len(tasks)
    x = np.array([*starts, *(a for a, _ in tasks), *(b for _, b in tasks)])
    capability = [[1.0]] * r if capability is None else capability
    visit = np.array([a == b for a, b in tasks], dtype=np.bool_)
    pickup = np.arange(r, r + p, dtype=np.int32)
    return Problem(
        robots=tuple(f"r{i}" for i in range(r)),
        tasks=tuple(f"t{i}" for i in range(p)),
        start=np.arange(r, dtype=np.int32),
        pickup=pickup,
        delivery=np.where(visit, pickup, pickup + p).astype(np.int32),
        visit=visit,
        service_time=np.zeros(p),
        type=np.array(types if types else [0] * p, dtype=np.int32),
        capability=np.array(capability, dtype=float).reshape(r, -1 if r else 1),
        capacity=np.full(r, capacity, dtype=np.int32),
        speed=np.ones(r),
        cost=(abs(x[:, None] - x[None]) if cost is None else cost)[None],
        points=np.stack([x, np.zeros_like(x)], axis=1).astype(np.float64),
        mode=np.zeros(r, dtype=np.int32),
        busy=np.zeros(r, dtype=np.bool_),
        routes=((),) * r,
        types=tuple("abcdefg"[: len(capability[0]) if r else 1]),
        priority=np.zeros(p, dtype=np.int8),
        refused=np.zeros((r, p), dtype=np.bool_),
        max_tasks=np.full(r, max(1, p), dtype=np.int32),
        load=np.zeros(r, dtype=np.int32),
        ready=np.zeros(r),
        aboard=((),) * r,
        previous=((),) * r,
    )


@st.composite
def problems(draw: st.DrawFn, *, robots: int = 4, tasks: int = 12, wild: bool = False) -> Problem:
    """Random problems with several modes, types, visits and parts that cannot be reached.

    `wild` costs are one-sided and break the triangle inequality; otherwise they are distances
    within each of two parts of the world. Points are no guide where costs are wild.
    """
    r = draw(st.integers(1, robots))
    p = draw(st.integers(0, tasks))
    t, m = draw(st.integers(1, 3)), draw(st.integers(1, 2))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    size = r + 2 * p
    points = rng.integers(0, 20, (size, 2)).astype(float)
    if wild:
        cost = rng.integers(0, 30, (m, size, size)).astype(float)
        cost[rng.random(cost.shape) < draw(st.sampled_from([0.0, 0.1, 0.4]))] = np.inf
        cost[:, np.arange(size), np.arange(size)] = 0.0
    else:
        legs = points[:, None] - points[None]
        part = rng.random((m, size)) < draw(st.sampled_from([0.0, 0.2]))
        apart = part[:, :, None] != part[:, None]
        cost = np.where(apart, np.inf, np.hypot(legs[..., 0], legs[..., 1]))
    visit = rng.random(p) < 0.3
    pickup = np.arange(r, r + p, dtype=np.int32)
    return Problem(
        robots=tuple(f"r{i}" for i in range(r)),
        tasks=tuple(f"t{i}" for i in range(p)),
        start=np.arange(r, dtype=np.int32),
        pickup=pickup,
        delivery=np.where(visit, pickup, pickup + p).astype(np.int32),
        visit=visit,
        service_time=rng.integers(0, 3, p).astype(float),
        type=rng.integers(0, t, p).astype(np.int32),
        capability=rng.choice([0.0, 0.5, 1.0], (r, t)),
        capacity=rng.integers(0, 4, r).astype(np.int32),
        speed=rng.choice([0.5, 1.0, 2.0], r),
        cost=cost,
        points=points,
        mode=rng.integers(0, m, r).astype(np.int32),
        busy=np.zeros(r, dtype=np.bool_),
        routes=((),) * r,
        types=tuple("abc"[:t]),
        priority=np.zeros(p, dtype=np.int8),
        refused=np.zeros((r, p), dtype=np.bool_),
        max_tasks=np.full(r, max(1, p), dtype=np.int32),
        load=np.zeros(r, dtype=np.int32),
        ready=np.zeros(r),
        aboard=((),) * r,
        previous=((),) * r,
    )
