"""Map files: one reader a format, chosen by the file's suffix."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Protocol

import numpy as np

from oath.errors import BadInput, ProviderError, did_you_mean
from oath.formats import moving_ai, ros_map
from oath.model import OccupancyGrid


class MapFormat(Protocol):
    """A module or object that reads one format."""

    def read(self, path: Path) -> OccupancyGrid:
        """Return the cells of a map file; raise `BadInput` if it is not one."""
        ...


FORMATS: dict[str, MapFormat] = {".yaml": ros_map, ".yml": ros_map, ".map": moving_ai}
"""Which format reads which suffix. A new format is one module and one row here."""


def read(path: str | Path) -> OccupancyGrid:
    """Read a map file in any known format.

    Parameters
    ----------
    path
        The file; its suffix picks the format.

    Raises
    ------
    BadInput
        If the suffix is unknown, or the file is missing or broken.
    ProviderError
        If a format returns what is no grid.
    """
    path = Path(path)
    format = FORMATS.get(path.suffix.lower())
    if format is None:
        raise BadInput(
            f"unknown map suffix {path.suffix!r}",
            file=str(path),
            remedy=did_you_mean(path.suffix, list(FORMATS)),
        )
    return _checked(format.read(path), path)


def files(path: Path) -> list[Path]:
    """Return the files that a map file consists of: itself, and what it names."""
    is_ros = FORMATS.get(path.suffix.lower()) is ros_map
    return [path, ros_map.picture(path)] if is_ros else [path]


def _checked(grid: OccupancyGrid, path: Path) -> OccupancyGrid:
    cells = grid.occupied
    if not isinstance(cells, np.ndarray) or cells.dtype != np.bool_ or cells.ndim != 2:
        raise ProviderError(f"the map format of {path} must return (rows, columns) bool cells")
    if cells.size == 0 or not (math.isfinite(grid.resolution) and grid.resolution > 0):
        raise ProviderError(f"the map format of {path} returned no cells, or cells of no size")
    if len(grid.origin) != 2 or not all(map(math.isfinite, grid.origin)):
        raise ProviderError(f"the map format of {path} returned the origin {grid.origin}")
    return grid
