"""Grid maps of the MovingAI path finding benchmarks (``type octile``).

N. Sturtevant, Benchmarks for Grid-Based Pathfinding, 2012. A header of four lines, then one
character a cell, the first line at the top. One cell is one metre here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from oath.errors import BadInput
from oath.formats.yaml_document import read_bytes
from oath.model import OccupancyGrid

PASSABLE = ".GS"
"""Floor, floor, swamp."""
BLOCKED = "@OTW"
"""Outside, outside, trees, water."""
LARGEST_SIDE = 20_000


def read(path: Path) -> OccupancyGrid:
    """Return the cells of a ``.map`` file, 1 m each, the lower left corner at (0, 0).

    Raises
    ------
    BadInput
        If the file is missing, or its header, size or characters are wrong.
    """
    file = str(path)
    lines = read_bytes(path).replace(b"\r\n", b"\n").split(b"\n")
    while lines and not lines[-1].strip():
        lines.pop()
    height, width = _header(lines[:4], file)
    rows = lines[4 : 4 + height]
    for number, row in enumerate(rows, start=5):
        if len(row) != width:
            raise BadInput(
                f"row has {len(row)} cells, the header says width {width}",
                file=f"{file}:{number}",
                remedy="correct the row or the width",
            )
    if len(lines) != 4 + height:
        raise BadInput(
            f"map has {len(lines) - 4} rows, the header says height {height}",
            file=file,
            field="height",
            remedy="correct the rows or the height",
        )
    codes = np.frombuffer(b"".join(rows), dtype=np.uint8).reshape(height, width)
    return OccupancyGrid(occupied=_occupied(codes, file), resolution=1.0, origin=(0.0, 0.0))


def _header(lines: list[bytes], file: str) -> tuple[int, int]:
    """Return height and width; they may come in either order."""
    words = [line.decode("ascii", "replace").split() for line in lines]
    if len(words) < 4 or words[0] != ["type", "octile"] or words[3] != ["map"]:
        raise BadInput(
            "the first four lines are not the header of a MovingAI map",
            file=f"{file}:1",
            field="header",
            remedy="start with `type octile`, `height H`, `width W`, `map`",
        )
    sizes = {line[0]: line[1] for line in words[1:3] if len(line) == 2}
    found = []
    for field in ("height", "width"):
        text = sizes.get(field, "(missing)")
        if not (text.isascii() and text.isdigit() and len(text) < 8):
            text = text[:20]
        elif 1 <= int(text) <= LARGEST_SIDE:
            found.append(int(text))
            continue
        raise BadInput(
            f"{field} {text} must lie in [1, {LARGEST_SIDE}]",
            file=file,
            field=field,
            remedy=f"give the number of cells, e.g. `{field} 24`",
        )
    return found[0], found[1]


def _occupied(codes: np.ndarray[tuple[int, int], np.dtype[np.uint8]], file: str) -> np.ndarray:
    meaning = np.full(256, 2, dtype=np.uint8)  # 0 passable, 1 blocked, 2 neither
    meaning[[ord(c) for c in PASSABLE]] = 0
    meaning[[ord(c) for c in BLOCKED]] = 1
    cells = meaning[codes]
    if (cells == 2).any():
        row, column = np.argwhere(cells == 2)[0]
        raise BadInput(
            f"unknown cell {chr(codes[row, column])!r} in column {column + 1}",
            file=f"{file}:{row + 5}",
            remedy=f"known: {' '.join(PASSABLE + BLOCKED)}",
        )
    return np.ascontiguousarray(cells[::-1] == 1)
