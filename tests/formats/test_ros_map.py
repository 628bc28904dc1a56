"""What map_server's pictures mean, and what is wrong with broken ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from oath.errors import BadInput
from oath.formats import ros_map

HEAD = "image: a.png\nresolution: 0.1\norigin: [0, 0, 0]\n"


def occupied(folder: Path, pixels: np.ndarray, extra: str = "", name: str = "a.png") -> list[bool]:
    """Write one row of pixels as a picture and return which of them came out occupied."""
    Image.fromarray(pixels[np.newaxis]).save(folder / name)
    path = folder / "a.yaml"
    path.write_text(HEAD.replace("a.png", name) + extra)
    cells: list[bool] = ros_map.read(path).occupied[0].tolist()
    return cells


GREY = np.array([0, 100, 205, 206, 254, 255], dtype=np.uint8)


def test_only_free_cells_are_free(tmp_path: Path) -> None:
    # 205 is the grey of unknown cells: 1 - 205 / 255 = 0.196078, just not below 0.196
    assert occupied(tmp_path, GREY) == [True, True, True, False, False, False]


def test_thresholds(tmp_path: Path) -> None:
    extra = "free_thresh: 0.61\noccupied_thresh: 0.7\n"
    assert occupied(tmp_path, GREY, extra) == [True, False, False, False, False, False]


@pytest.mark.parametrize("negate", ["1", "true"])
def test_negate(negate: str, tmp_path: Path) -> None:
    found = occupied(tmp_path, GREY, f"negate: {negate}\n")
    assert found == [False, True, True, True, True, True]


def test_raw_values_are_percent(tmp_path: Path) -> None:
    values = np.array([0, 10, 19, 20, 50, 100, 101, 255], dtype=np.uint8)
    found = occupied(tmp_path, values, "mode: raw\n")
    assert found == [False, False, False, True, True, True, True, True]


def test_colours_are_averaged(tmp_path: Path) -> None:
    colours = np.array([[255, 255, 255], [255, 255, 120], [255, 255, 90]], dtype=np.uint8)
    assert occupied(tmp_path, colours) == [False, False, True]


def test_transparent_is_unknown_in_scale_mode(tmp_path: Path) -> None:
    colours = np.array([[255, 255, 255, 255], [255, 255, 255, 254]], dtype=np.uint8)
    assert occupied(tmp_path, colours, "mode: scale\n") == [False, True]
    assert occupied(tmp_path, colours, "mode: trinary\n") == [False, False]


def test_16_bit_and_1_bit_pictures(tmp_path: Path) -> None:
    assert occupied(tmp_path, np.array([0, 30000, 65535], dtype=np.uint16)) == [True, True, False]
    Image.fromarray(np.array([[0, 255]], dtype=np.uint8)).convert("1").save(tmp_path / "b.png")
    (tmp_path / "a.yaml").write_text(HEAD.replace("a.png", "b.png"))
    assert ros_map.read(tmp_path / "a.yaml").occupied.tolist() == [[True, False]]


@pytest.mark.parametrize("name", ["a.pgm", "a.bmp", "a.png"])
def test_picture_formats(name: str, tmp_path: Path) -> None:
    assert occupied(tmp_path, GREY, name=name) == [True, True, True, False, False, False]


def test_plain_pgm_with_comment(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("P2\n# by hand\n2 2\n255\n0 255\n255 255\n")
    (tmp_path / "a.yaml").write_text(HEAD)
    assert ros_map.read(tmp_path / "a.yaml").occupied.tolist() == [[False, False], [True, False]]


def test_image_paths_are_relative_to_the_yaml_file_or_absolute(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    picture = tmp_path / "deep" / "a.png"
    Image.fromarray(GREY[np.newaxis]).save(picture)
    path = tmp_path / "a.yaml"
    for image in ("deep/a.png", str(picture)):
        path.write_text(HEAD.replace("a.png", image))
        assert ros_map.read(path).occupied.shape == (1, 6)


def test_keys_of_other_tools_are_ignored(tmp_path: Path) -> None:
    assert occupied(tmp_path, GREY[-1:], "map_type: 2\nlayers: [a, b]\n") == [False]


def test_a_large_picture(tmp_path: Path) -> None:
    pixels = np.full((4000, 4000), 254, dtype=np.uint8)
    pixels[0, 0] = 0
    (tmp_path / "a.pgm").write_bytes(b"P5 4000 4000 255\n" + pixels.tobytes())
    (tmp_path / "a.yaml").write_text(HEAD.replace("a.png", "a.pgm"))
    grid = ros_map.read(tmp_path / "a.yaml")
    assert np.argwhere(grid.occupied).tolist() == [[3999, 0]]


BAD = [
    ("resolution: 0.1\norigin: [0, 0, 0]\n", "image", ["missing"], "add"),
    ("image: a.pgm\norigin: [0, 0, 0]\n", "resolution", ["missing"], "add"),
    ("image: a.pgm\nresolution: 1\n", "origin", ["missing"], "add"),
    ("image: a.pgm\nresoluton: 1\norigin: [0, 0, 0]\n", "resoluton", ["unknown"], "'resolution'"),
    ("image: a.pgm\nresolution: 0\norigin: [0, 0, 0]\n", "resolution", ["0 must"], "positive"),
    ("image: a.pgm\nresolution: -1\norigin: [0, 0, 0]\n", "resolution", ["-1"], "positive"),
    ("image: a.pgm\nresolution: .nan\norigin: [0, 0, 0]\n", "resolution", ["nan"], "finite"),
    ("image: a.pgm\nresolution: 1\norigin: [0, 0]\n", "origin", ["[0, 0]", "yaw"], "three"),
    ("image: a.pgm\nresolution: 1\norigin: [0, 0, 0.5]\n", "origin", ["yaw 0.5"], "rotate"),
    ("image: a.pgm\nresolution: 1\norigin: [0, .inf, 0]\n", "origin", ["inf"], "finite"),
    ("image: 3\nresolution: 1\norigin: [0, 0, 0]\n", "image", ["3 is not text"], "quotes"),
    (HEAD + "negate: 2\n", "negate", ["2 must be 0 or 1"], "occupied"),
    (HEAD + "mode: trinry\n", "mode", ["'trinry'"], "'trinary'"),
    (HEAD + "free_thresh: 1.5\n", "free_thresh", ["1.5", "at most 1"], "valid"),
    (HEAD + "free_thresh: 0.7\n", "free_thresh", ["0.7", "0.65"], "swap"),
    (HEAD, "image", ["'a.png'", "no such file"], "relative"),
    (HEAD.replace("a.png", "."), "image", ["'.'", "no such file"], "relative"),
    (HEAD.replace("a.png", "junk.pgm"), "image", ["cannot be read"], "PGM"),
    (HEAD.replace("a.png", "short.pgm"), "image", ["cannot be read"], "PGM"),
    (HEAD.replace("a.png", "long.pgm"), "image", ["3 bytes more", "10 x 10"], "PGM"),
    (HEAD.replace("a.png", "flat.pgm"), "image", ["cannot be read"], "PGM"),
    (HEAD.replace("a.png", "huge.pgm"), "image", ["cannot be read", "pixels"], "PGM"),
    (HEAD.replace("a.png", "vast.pgm"), "image", ["cannot be read"], "PGM"),
    (HEAD.replace("a.png", "float.pgm"), "image", ["cannot be read", "F"], "PGM"),
]


@pytest.mark.parametrize(("text", "field", "parts", "remedy"), BAD)
def test_bad_maps(text: str, field: str, parts: list[str], remedy: str, tmp_path: Path) -> None:
    (tmp_path / "junk.pgm").write_bytes(bytes(range(256)))
    (tmp_path / "short.pgm").write_bytes(b"P5 10 10 255\n" + b"\0" * 99)
    (tmp_path / "long.pgm").write_bytes(b"P5 10 10 255\n" + b"\0" * 103)
    (tmp_path / "flat.pgm").write_bytes(b"P5 0 10 255\n")
    (tmp_path / "huge.pgm").write_bytes(b"P5 13000 13000 255\n")
    (tmp_path / "vast.pgm").write_bytes(b"P5 1000000 1000000 255\n")
    (tmp_path / "float.pgm").write_bytes(b"Pf 1 1 -1.0\n\0\0\0\0")
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(BadInput) as caught:
        ros_map.read(path)
    error = caught.value
    assert error.field == field
    assert str(error.file).startswith(str(path))
    for part in parts:
        assert part in error.problem
    assert remedy in error.remedy


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_any_damaged_picture_reads_or_is_bad_input(data: st.DataObject, tmp_path: Path) -> None:
    name = data.draw(st.sampled_from(["a.pgm", "a.png", "a.bmp"]))
    picture = tmp_path / name
    Image.fromarray(GREY.reshape(2, 3)).save(picture)
    content = picture.read_bytes()
    at = data.draw(st.integers(0, len(content)))
    until = data.draw(st.integers(at, min(at + 4, len(content))))
    picture.write_bytes(content[:at] + data.draw(st.binary(max_size=4)) + content[until:])
    (tmp_path / "a.yaml").write_text(HEAD.replace("a.png", name))
    try:
        ros_map.read(tmp_path / "a.yaml")
    except BadInput as error:
        assert error.field == "image"
