"""How much the parameters of the adaptive sampling matter."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np

from oath.bench import paper
from oath.bench.figures import COLOURS, sheet, style
from oath.bench.sampling import grouped, reference
from oath.bench.shortest import quality
from oath.bench.study import Case, Row, Study
from oath.world.halton import Density
from oath.world.roadmap import Params, build

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SWEEPS = {
    "d_opt": (0.3, 0.4, 0.6, 0.8, 1.2),
    "sigma": (0.1, 0.25, 0.5, 1.0, 2.0),
    "beta": (0.0, 0.05, 0.1, 0.2, 0.4, 0.8),
}
DEFAULT = Density()
NAMES = {"d_opt": "d_opt [m]", "sigma": "sigma [m]", "beta": "beta"}
POINTS = 1000


def settings() -> list[tuple[float, float, float]]:
    """All d_opt x sigma at the default beta, then every other beta at the default two."""
    grid = [(d, s, DEFAULT.beta) for d in SWEEPS["d_opt"] for s in SWEEPS["sigma"]]
    rest = [(DEFAULT.d_opt, DEFAULT.sigma, beta) for beta in SWEEPS["beta"]]
    return list(dict.fromkeys(grid + rest))


def cases(quick: bool, seeds: int) -> list[Case]:
    """Every setting and seed, with and without corner nodes."""
    return [
        Case(
            f"{d_opt:g}-{sigma:g}-{beta:g}-{'corners' if corners else 'plain'}-{seed}",
            {"d_opt": d_opt, "sigma": sigma, "beta": beta, "corners": corners, "seed": seed},
        )
        for seed in range(min(seeds, 3) if quick else 4 * seeds)
        for corners in (False, True)
        for d_opt, sigma, beta in settings()
    ]


def measure(d_opt: float, sigma: float, beta: float, corners: bool, seed: int) -> list[Row]:
    """Build one roadmap without bridges and compare its paths with the shortest."""
    stops, exact = reference()
    density = Density(d_min=DEFAULT.d_min, d_opt=d_opt, sigma=sigma, beta=beta)
    params = Params(points=POINTS, density=density, corners=corners, bridges=False)
    world = build(paper.maze(), params, seed, relevant=frozenset())
    excess, connected = quality(world, stops, exact)
    return [
        {
            "d_opt": d_opt,
            "sigma": sigma,
            "beta": beta,
            "corners": corners,
            "seed": seed,
            "excess_percent": excess,
            "connected_percent": connected,
        }
    ]


def _means(rows: Sequence[Row], column: str) -> dict[tuple[float, float, float], float]:
    groups = grouped(rows, "d_opt", "sigma", "beta")
    return {
        (key[0], key[1], key[2]): fmean(row[column] for row in group)
        for key, group in groups.items()
    }


def _split(rows: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    plain = [row for row in rows if not row["corners"]]
    return plain, [row for row in rows if row["corners"]]


def table(rows: Sequence[Row]) -> list[Row]:
    """Means over the seeds for every setting."""
    plain, cornered = _split(rows)
    columns = ("excess_percent", "connected_percent")
    bare = [_means(plain, column) for column in columns]
    full = [_means(cornered, column) for column in columns]
    return [
        {
            "d_opt [m]": key[0],
            "sigma [m]": key[1],
            "beta": key[2],
            "path excess [%]": bare[0].get(key),
            "pairs connected [%]": bare[1].get(key),
            "excess with corners [%]": full[0].get(key),
            "connected with corners [%]": full[1].get(key),
        }
        for key in sorted({**bare[0], **full[0]})
    ]


def sweep(
    means: dict[tuple[float, float, float], float], name: str
) -> tuple[list[float], list[float]]:
    """Values of one parameter, the others at their defaults, and what was measured there."""
    default = (DEFAULT.d_opt, DEFAULT.sigma, DEFAULT.beta)
    index = list(SWEEPS).index(name)
    line = {
        key[index]: mean
        for key, mean in means.items()
        if all(key[i] == default[i] for i in range(3) if i != index)
    }
    return sorted(line), [line[value] for value in sorted(line)]


def plot(rows: Sequence[Row]) -> Figure:
    """One line a parameter, and a map of d_opt and sigma without corner nodes."""
    figure, axes = sheet(2, 3, width=4.0)
    plain, cornered = _split(rows)
    for one, name in zip(axes[:3], SWEEPS, strict=True):
        for index, (part, label) in enumerate(((plain, "no corners"), (cornered, "with corners"))):
            one.plot(*sweep(_means(part, "excess_percent"), name), label=label, **style(index))
        default = getattr(DEFAULT, name)
        one.axvline(default, color=COLOURS[6], linestyle=":", linewidth=1, label="default")
        one.set(xlabel=NAMES[name], ylabel="mean path excess [%]", ylim=(0, None))
    axes[0].legend(frameon=False)
    _map(figure, axes[3], _means(plain, "excess_percent"), "Excess, no corners [%]", "viridis_r")
    _map(figure, axes[4], _means(plain, "connected_percent"), "Connected, no corners [%]")
    _map(figure, axes[5], _means(cornered, "excess_percent"), "Excess, corners [%]", "viridis_r")
    return figure


def _map(
    figure: Figure,
    axes: Axes,
    means: dict[tuple[float, float, float], float],
    title: str,
    colours: str = "viridis",
) -> None:
    d_opts, sigmas = SWEEPS["d_opt"], SWEEPS["sigma"]
    values = np.array([[means.get((d, s, DEFAULT.beta), np.nan) for d in d_opts] for s in sigmas])
    shown = axes.imshow(values, cmap=colours, origin="lower", aspect="auto")
    axes.grid(False)
    axes.set(title=title, xlabel="d_opt [m]", ylabel="sigma [m]")
    axes.set_xticks(range(len(d_opts)), [f"{value:g}" for value in d_opts])
    axes.set_yticks(range(len(sigmas)), [f"{value:g}" for value in sigmas])
    low, high = np.nanmin(values), np.nanmax(values)
    digits = 1 if high > 10 else 2
    for (row, column), value in np.ndenumerate(values):
        dark = (value - low > 0.5 * (high - low)) == colours.endswith("_r")
        if np.isfinite(value):
            ink = "white" if dark else "black"
            axes.text(
                column, row, f"{value:.{digits}f}", ha="center", va="center", color=ink, fontsize=8
            )
    figure.colorbar(shown, ax=axes)


def finding(rows: Sequence[Row]) -> str:
    """Say where the best setting lies and how far the default is from it."""
    plain, cornered = _split(rows)
    parts = []
    for part, what in ((plain, "Without corner nodes"), (cornered, "With corner nodes")):
        means = _means(part, "excess_percent")
        default = means.get((DEFAULT.d_opt, DEFAULT.sigma, DEFAULT.beta))
        if default is None:
            continue
        best = min(means, key=lambda key: means[key])
        spread = {name: np.ptp(sweep(means, name)[1]) for name in SWEEPS}
        most = max(spread, key=lambda name: spread[name])
        joined = _means(part, "connected_percent")
        parts.append(
            f"{what} the excess is {min(means.values()):.2f} to {max(means.values()):.2f} %, least "
            f"at d_opt {best[0]:g} m, sigma {best[1]:g} m, beta {best[2]:g}; the defaults give "
            f"{default:.2f} %. One at a time, {most} matters most ({spread[most]:.2f} percentage "
            f"points). Without bridges, at least {min(joined.values()):.1f} % of the stop pairs "
            "are connected."
        )
    return " ".join(parts) or "The defaults were not measured."


STUDY = Study(
    name="tuning",
    title="Parameters of the adaptive sampling",
    asked=(
        f"How do path excess and connectivity at {POINTS} points depend on d_opt, sigma and beta, "
        "without corner nodes, which is what the paper tunes, and with them?"
    ),
    paper=(
        "The paper tunes the same three parameters on roadmaps without corner nodes. No published "
        "number of that is at hand, so none is compared."
    ),
    cases=cases,
    measure=measure,
    table=table,
    plot=plot,
    finding=finding,
)
