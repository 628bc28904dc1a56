"""One contract for every map format, and formats that break it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from oath.errors import BadInput, OathError, ProviderError
from oath.formats import maps, moving_ai, ros_map
from oath.formats.maps import MapFormat
from oath.model import OccupancyGrid

# Row 0 at the top, as one sees it: not the same under any flip or turn.
PICTURE = np.array([[1, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]], dtype=bool)


def write_moving_ai(folder: Path, picture: np.ndarray) -> Path:
    rows = ["".join("@" if cell else "." for cell in row) for row in picture]
    height, width = picture.shape
    path = folder / "world.map"
    path.write_text(f"type octile\nheight {height}\nwidth {width}\nmap\n" + "\n".join(rows) + "\n")
    return path


def write_ros(folder: Path, picture: np.ndarray) -> Path:
    height, width = picture.shape
    pixels = np.where(picture, 0, 254).astype(np.uint8)
    (folder / "world.pgm").write_bytes(f"P5 {width} {height} 255\n".encode() + pixels.tobytes())
    path = folder / "world.yaml"
    path.write_text("image: world.pgm\nresolution: 0.5\norigin: [1, 2, 0]\n")
    return path


@dataclass(frozen=True)
class Case:
    """A format, how to write a picture in it, and the files that hold its bytes."""

    format: MapFormat
    write: Callable[[Path, np.ndarray], Path]
    data: str


def has_the_shape(case: Case, folder: Path) -> None:
    grid = case.format.read(case.write(folder, PICTURE))
    assert grid.occupied.shape == PICTURE.shape
    assert grid.occupied.dtype == np.bool_
    assert grid.occupied.flags.c_contiguous


def has_the_lowest_row_first(case: Case, folder: Path) -> None:
    grid = case.format.read(case.write(folder, PICTURE))
    assert np.array_equal(grid.occupied, PICTURE[::-1])


def has_metres(case: Case, folder: Path) -> None:
    grid = case.format.read(case.write(folder, PICTURE))
    assert isinstance(grid.resolution, float)
    assert grid.resolution > 0
    assert all(isinstance(x, float) for x in grid.origin)


def reads_the_same_twice(case: Case, folder: Path) -> None:
    path = case.write(folder, PICTURE)
    assert np.array_equal(case.format.read(path).occupied, case.format.read(path).occupied)


def reads_all_free_and_all_occupied(case: Case, folder: Path) -> None:
    for value in (False, True):
        grid = case.format.read(case.write(folder, np.full((2, 3), value)))
        assert (grid.occupied == value).all()


def refuses_what_is_not_there(case: Case, folder: Path) -> None:
    path = case.write(folder, PICTURE)
    for missing in (path.with_stem("other"), folder):
        with pytest.raises(BadInput):
            case.format.read(missing)


def refuses_junk(case: Case, folder: Path) -> None:
    path = case.write(folder, PICTURE)
    for junk in (b"", b"\0\1\2", bytes(range(256)), b"type: octile\n"):
        path.write_bytes(junk)
        with pytest.raises(BadInput) as caught:
            case.format.read(path)
        assert str(path) in str(caught.value)


def refuses_a_cut_file(case: Case, folder: Path) -> None:
    path = case.write(folder, PICTURE)
    data = folder / case.data
    whole = data.read_bytes()
    for length in range(0, len(whole) - 2, 3):
        data.write_bytes(whole[:length])
        with pytest.raises(BadInput):
            case.format.read(path)


CONTRACT = [
    has_the_shape,
    has_the_lowest_row_first,
    has_metres,
    reads_the_same_twice,
    reads_all_free_and_all_occupied,
    refuses_what_is_not_there,
    refuses_junk,
    refuses_a_cut_file,
]

CASES = {
    "ros": Case(ros_map, write_ros, "world.pgm"),
    "moving_ai": Case(moving_ai, write_moving_ai, "world.map"),
}


@pytest.mark.parametrize("law", CONTRACT, ids=lambda law: law.__name__)
@pytest.mark.parametrize("name", CASES)
def test_contract(name: str, law: Callable[[Case, Path], None], tmp_path: Path) -> None:
    law(CASES[name], tmp_path)


def test_every_registered_format_is_under_contract() -> None:
    assert set(map(id, maps.FORMATS.values())) == {id(case.format) for case in CASES.values()}


class UpsideDown:
    def read(self, path: Path) -> OccupancyGrid:
        grid = moving_ai.read(path)
        return OccupancyGrid(
            occupied=grid.occupied[::-1], resolution=grid.resolution, origin=grid.origin
        )


class Mirrored:
    def read(self, path: Path) -> OccupancyGrid:
        grid = moving_ai.read(path)
        return OccupancyGrid(
            occupied=np.ascontiguousarray(grid.occupied[:, ::-1]), resolution=1.0, origin=(0.0, 0.0)
        )


class Careless:
    def read(self, path: Path) -> OccupancyGrid:
        rows = [r for r in path.read_text(errors="replace").splitlines()[4:] if r]
        cells = np.array([[c != "." for c in row] for row in rows[::-1]], dtype=bool)
        return OccupancyGrid(occupied=cells, resolution=1.0, origin=(0.0, 0.0))


BROKEN = [
    (UpsideDown(), "has_the_lowest_row_first"),
    (Mirrored(), "has_the_lowest_row_first"),
    (Careless(), "refuses_junk"),
    (Careless(), "refuses_what_is_not_there"),
]


@pytest.mark.parametrize(("broken", "law"), BROKEN)
def test_the_contract_catches_broken_formats(broken: MapFormat, law: str, tmp_path: Path) -> None:
    check = next(item for item in CONTRACT if item.__name__ == law)
    with pytest.raises((AssertionError, OSError, pytest.fail.Exception)):
        check(Case(broken, write_moving_ai, "world.map"), tmp_path)


class Returns:
    def __init__(self, **values: Any) -> None:
        good: dict[str, Any] = {"occupied": PICTURE, "resolution": 1.0, "origin": (0.0, 0.0)}
        self.grid = OccupancyGrid(**(good | values))

    def read(self, path: Path) -> OccupancyGrid:
        return self.grid


@pytest.mark.parametrize(
    "values",
    [
        {"occupied": PICTURE.astype(int)},
        {"occupied": PICTURE[0]},
        {"occupied": PICTURE[:0]},
        {"resolution": 0.0},
        {"resolution": float("nan")},
        {"origin": (0.0,)},
        {"origin": (0.0, float("inf"))},
    ],
)
def test_what_a_format_returns_is_checked(
    values: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(maps.FORMATS, ".odd", Returns(**values))
    with pytest.raises(ProviderError, match=r"world\.odd"):
        maps.read("world.odd")


def test_the_suffix_picks_the_format(tmp_path: Path) -> None:
    assert maps.read(write_ros(tmp_path, PICTURE)).resolution == 0.5
    assert maps.read(str(write_moving_ai(tmp_path, PICTURE))).resolution == 1.0
    (tmp_path / "world.yaml").rename(tmp_path / "world.YML")
    assert maps.read(tmp_path / "world.YML").origin == (1.0, 2.0)
    with pytest.raises(OathError, match=r"unknown map suffix '\.mpa'; did you mean '\.map'"):
        maps.read("world.mpa")


# MovingAI


def test_moving_ai_cells(tmp_path: Path) -> None:
    path = tmp_path / "a.map"
    path.write_bytes(b"type octile\r\nwidth 7\r\nheight 1\r\nmap\r\n.GS@OTW\r\n")
    assert moving_ai.read(path).occupied.tolist() == [[False] * 3 + [True] * 4]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("type tile\nheight 1\nwidth 1\nmap\n.\n", ["header", ":1"]),
        ("height 1\nwidth 1\nmap\n.\n", ["header"]),
        ("type octile\nheight 0\nwidth 1\nmap\n", ["height 0", "[1, 20000]"]),
        ("type octile\nheight 1\nwidth x\nmap\n.\n", ["width x", "number of cells"]),
        ("type octile\nheight 1\nheight 1\nmap\n.\n", ["width (missing)"]),
        ("type octile\nheight 1\nwidth 99999999999\nmap\n.\n", ["width 99999999999"]),
        ("type octile\nheight 2\nwidth 2\nmap\n..\n.\n", [":6", "1 cells", "width 2"]),
        ("type octile\nheight 2\nwidth 2\nmap\n..\n", ["height 2"]),
        ("type octile\nheight 1\nwidth 2\nmap\n..\n..\n", ["2 rows", "height 1"]),
        ("type octile\nheight 2\nwidth 2\nmap\n..\n.x\n", [":6", "'x'", "column 2", ". G S @"]),
    ],
)
def test_bad_moving_ai(text: str, parts: list[str], tmp_path: Path) -> None:
    path = tmp_path / "a.map"
    path.write_text(text)
    with pytest.raises(BadInput) as caught:
        moving_ai.read(path)
    for part in [str(path), *parts]:
        assert part in str(caught.value)
