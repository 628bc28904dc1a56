"""Our search against two general routing solvers on the paper's maze, at equal wall time.

The literal problem: least sum of lengths, pickup before delivery by the same robot, tasks aboard
at once limited, open routes, tasks that only some robots can do. Both solvers can express it:
OR-tools with pickup and delivery pairs and allowed vehicles (guided local search); PyVRP from 0.14
on with shipments, and with a distance matrix for each robot in which what it cannot do is far away.
Every answer is judged by `oath.allocate.checked` and measured on the same costs. Models are built
before the clock starts. Prints distances and seconds, and each solver's distance over ours.

Optional packages; in an environment of their own beside OATH: ``pip install ortools pyvrp``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from statistics import fmean
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oath.allocate import Allocator, Budget, Lns, Problem, checked, reasons
from oath.allocate.contract import to_route
from oath.allocate.lns import Params
from oath.bench.methods import figures, posed
from oath.bench.paper import random_maze
from oath.errors import ProviderError
from oath.model import Assignment, StopName

SIZES = ((21, 4), (50, 4), (100, 10))
"""Tasks and robots."""
SECONDS = (0.05, 0.2, 1.0)
FAR = 10_000_000
"""Added to the way to a stop that a robot may not go to [mm]."""

Picks = list[tuple[int, StopName]]
Solve = Callable[[float, int], list[Picks] | None]
"""(seconds, seed) to the robots' stops; None = nothing found."""


def layout(problem: Problem) -> tuple[list[int], NDArray[np.int64]]:
    """Nodes and their costs [mm]: 2 i and 2 i + 1 are task i's stops, then the starts, then home.

    Home is where all routes end, at no cost: that is how they are open.
    """
    stops = np.stack([problem.pickup, problem.delivery], axis=1).ravel().tolist()
    nodes = [*stops, *problem.start.tolist()]
    cost = np.zeros((len(nodes) + 1, len(nodes) + 1), dtype=np.int64)
    cost[:-1, :-1] = np.rint(problem.cost[0][np.ix_(nodes, nodes)] * 1000)
    return nodes, cost


def with_ortools(problem: Problem) -> Solve:
    """The model for OR-tools; it has no seed that matters: guided local search is deterministic."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    tasks, robots = len(problem.tasks), len(problem.robots)
    nodes, cost = layout(problem)
    manager = pywrapcp.RoutingIndexManager(
        len(cost), robots, list(range(2 * tasks, len(nodes))), [len(nodes)] * robots
    )
    routing = pywrapcp.RoutingModel(manager)
    routing.SetArcCostEvaluatorOfAllVehicles(routing.RegisterTransitMatrix(cost.tolist()))
    loads = [1, -1] * tasks + [0] * (robots + 1)
    routing.AddDimensionWithVehicleCapacity(
        routing.RegisterUnaryTransitVector(loads), 0, problem.capacity.tolist(), True, "load"
    )
    routing.AddConstantDimension(1, 2 * tasks + 2, True, "place")
    place = routing.GetDimensionOrDie("place")
    feasible = problem.feasible()
    for task in range(tasks):
        first, last = manager.NodeToIndex(2 * task), manager.NodeToIndex(2 * task + 1)
        routing.AddPickupAndDelivery(first, last)
        solver = routing.solver()
        solver.Add(routing.VehicleVar(first) == routing.VehicleVar(last))
        solver.Add(place.CumulVar(first) <= place.CumulVar(last))
        able = np.flatnonzero(feasible[:, task]).tolist()
        routing.VehicleVar(first).SetValues([-1, *able])
        routing.VehicleVar(last).SetValues([-1, *able])

    def solve(seconds: float, seed: int) -> list[Picks] | None:
        search = pywrapcp.DefaultRoutingSearchParameters()
        search.first_solution_strategy = (
            routing_enums_pb2.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
        )
        search.local_search_metaheuristic = (
            routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
        )
        search.time_limit.FromMilliseconds(int(1000 * seconds))
        answer = routing.SolveWithParameters(search)
        if answer is None:
            return None
        return [list(_walk(routing, manager, answer, r, 2 * tasks)) for r in range(robots)]

    return solve


def _walk(
    routing: Any, manager: Any, answer: Any, robot: int, stops: int
) -> Iterator[tuple[int, StopName]]:
    index = routing.Start(robot)
    while not routing.IsEnd(index):
        node = manager.IndexToNode(index)
        if node < stops:
            yield node // 2, "delivery" if node % 2 else "pickup"
        index = answer.Value(routing.NextVar(index))


def with_pyvrp(problem: Problem) -> Solve:
    """The model for PyVRP: a shipment for each task, a vehicle type and a matrix for each robot."""
    import pyvrp
    from pyvrp.stop import MaxRuntime

    tasks, robots = len(problem.tasks), len(problem.robots)
    _, cost = layout(problem)
    feasible = problem.feasible()
    matrices = []
    for r in range(robots):
        own = cost.copy()
        closed = 2 * np.flatnonzero(~feasible[r])
        own[:, closed] += FAR
        own[closed, closed] = 0
        matrices.append(own)
    data = pyvrp.ProblemData(
        locations=[pyvrp.Location(0, 0) for _ in range(len(cost))],
        clients=[],
        depots=[pyvrp.Depot(node) for node in range(2 * tasks, len(cost))],
        vehicle_types=[
            pyvrp.VehicleType(
                capacity=[int(problem.capacity[r])], start_depot=r, end_depot=robots, profile=r
            )
            for r in range(robots)
        ],
        distance_matrices=matrices,
        duration_matrices=[np.zeros_like(cost)] * robots,
        shipments=[pyvrp.Shipment(2 * task, 2 * task + 1, amount=[1]) for task in range(tasks)],
    )

    def solve(seconds: float, seed: int) -> list[Picks] | None:
        result = pyvrp.solve(data, MaxRuntime(seconds), seed=seed, collect_stats=False)
        if not result.is_feasible():
            return None
        found: list[Picks] = [[] for _ in range(robots)]
        for route in result.best.routes():
            for stop in route:
                if stop.is_pickup() or stop.is_delivery():
                    name: StopName = "pickup" if stop.is_pickup() else "delivery"
                    found[route.vehicle_type()].append((stop.idx, name))
        return found

    return solve


class Outsider:
    """A solver from elsewhere as an allocator, so that `checked` can judge it."""

    reconsiders = False

    def __init__(self, solve: Solve, seed: int) -> None:
        self._solve, self._seed = solve, seed

    def allocate(self, problem: Problem, budget: Budget, rng: np.random.Generator) -> Assignment:
        found = self._solve(budget.seconds or 0.0, self._seed)
        picks = found or [[] for _ in problem.robots]
        routes = {
            robot: to_route(problem, stops)
            for robot, stops in zip(problem.robots, picks, strict=True)
        }
        done = {task for stops in picks for task, _ in stops}
        left = [task for task in range(len(problem.tasks)) if task not in done]
        return Assignment(routes=routes, unassigned=reasons(problem, left))


def timed(
    method: Allocator, problem: Problem, seconds: float, seed: int
) -> tuple[float, float] | None:
    """Distance [m] and wall clock [s]; None if a task is left or a limit is broken."""
    rng = np.random.default_rng(seed)
    begin = perf_counter()
    try:
        answer = checked(method, problem, Budget(seconds=seconds), rng)
    except ProviderError as error:
        print(f"  refused: {error}")
        return None
    spent = perf_counter() - begin
    return None if answer.unassigned else (figures(problem, answer)[0], spent)


def main() -> None:
    """Print one line per size and time."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=5)
    args = parser.parse_args()
    others: dict[str, Callable[[Problem], Solve]] = {}
    for name, build in (("ortools", with_ortools), ("pyvrp", with_pyvrp)):
        try:
            __import__(name)
        except ImportError:
            print(f"{name} is missing: pip install {name}")
        else:
            others[name] = build
    print("tasks robots   time [s]  " + "".join(f"{name:>24}" for name in ("lns", *others)))
    for tasks, robots in SIZES:
        missions = [random_maze(tasks, robots, seed=seed) for seed in range(args.seeds)]
        problems = [posed(mission, seed=seed) for seed, mission in enumerate(missions)]
        for seconds in SECONDS:
            _compare(problems, seconds, others)


def _compare(
    problems: Sequence[Problem], seconds: float, others: dict[str, Callable[[Problem], Solve]]
) -> None:
    ours: list[float] = []
    cells = []
    for name in ("lns", *others):
        runs = []
        for seed, problem in enumerate(problems):
            method: Allocator = Lns(Params(makespan_weight=0.0))
            if name in others:
                method = Outsider(others[name](problem), seed)
            runs.append(timed(method, problem, seconds, seed))
        if name == "lns":
            ours = [run[0] for run in runs if run]
        good = [(run, own) for run, own in zip(runs, ours, strict=True) if run]
        if not good:
            cells.append(f"{'nothing found':>24}")
            continue
        ratio = fmean(run[0] / own for run, own in good)
        missing = "" if len(good) == len(runs) else f" {len(good)}/{len(runs)}"
        spent = fmean(run[1] for run, _ in good)
        shown = f"{ratio:.3f} " if name in others else f"{fmean(ours):.1f} m "
        cells.append(f"{shown + f'in {spent:.2f} s' + missing:>24}")
    size = f"{len(problems[0].tasks):5} {len(problems[0].robots):6}"
    print(f"{size} {seconds:10.2f}  " + "".join(cells), flush=True)


if __name__ == "__main__":
    main()
