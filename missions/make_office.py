"""Draws office-map.pgm: a small office as a ROS map_server picture, always the same bytes.

Run from anywhere: ``python missions/make_office.py [FOLDER]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

RESOLUTION = 0.05
WIDTH, HEIGHT = 24.0, 16.0
FREE, UNKNOWN, OCCUPIED = 254, 205, 0
WALL = 0.2

DESKS = [  # x, y of the lower left corner, width, height [m]
    (2.0, 3.0, 1.6, 0.8),
    (4.6, 1.6, 0.8, 1.6),
    (9.0, 2.0, 1.6, 0.8),
    (9.0, 4.2, 1.6, 0.8),
    (18.0, 2.2, 2.4, 1.2),
    (2.2, 12.6, 1.6, 0.8),
    (5.2, 11.0, 0.8, 1.6),
    (10.6, 12.0, 2.0, 1.0),
    (17.4, 12.8, 1.6, 0.8),
    (20.4, 11.2, 0.8, 1.6),
]


def draw() -> np.ndarray:
    """Return the picture, (rows, columns) with row 0 at the top."""
    cells = np.full((round(HEIGHT / RESOLUTION), round(WIDTH / RESOLUTION)), UNKNOWN, np.uint8)

    def fill(x: float, y: float, width: float, height: float, value: int) -> None:
        left, right = round(x / RESOLUTION), round((x + width) / RESOLUTION)
        low, high = round(y / RESOLUTION), round((y + height) / RESOLUTION)
        cells[low:high, left:right] = value

    fill(0.8, 0.8, 22.4, 14.4, OCCUPIED)  # the building; what is outside of it stays unknown
    fill(1.0, 7.0, 22.0, 2.0, FREE)  # the corridor
    for left, right in ((1.0, 7.2), (7.4, 14.8), (15.0, 23.0)):
        for low, high, door in ((1.0, 6.8, 6.8), (9.2, 15.0, 9.0)):
            fill(left, low, right - left, high - low, FREE)
            fill((left + right) / 2 - 0.5, door, 1.0, WALL, FREE)
    for x, y, width, height in DESKS:
        fill(x, y, width, height, OCCUPIED)
    return cells[::-1]


def main(folder: Path) -> None:
    """Write the picture into a folder."""
    cells = draw()
    rows, columns = cells.shape
    header = f"P5\n# made by make_office.py\n{columns} {rows}\n255\n".encode()
    (folder / "office-map.pgm").write_bytes(header + cells.tobytes())


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
