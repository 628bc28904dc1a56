"""Maps of ROS map_server: a YAML file beside a picture (PGM, PNG or BMP).

The meaning of pixels follows map_server of ROS 1 and Nav2: how black a pixel is says how occupied
its cell is; between the thresholds it is unknown. A robot drives only where the map says free.
"""

from __future__ import annotations

import difflib
import warnings
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFile
from pydantic import BeforeValidator, PlainValidator

from oath.formats.fields import (
    SMALLEST,
    Section,
    Text,
    choice,
    finite,
    number,
    show,
    validate,
    wrong,
)
from oath.formats.yaml_document import Document, read_document
from oath.model import OccupancyGrid, Point

MAX_CELLS = 150_000_000
PICTURES = ("PPM", "PNG", "BMP")
"""Pillow's names of the picture formats; PPM reads PGM."""


def _origin(value: object) -> Point:
    if not isinstance(value, list) or len(value) != 3:
        raise wrong(f"{show(value)} must be [x, y, yaw]", "give three numbers: m, m, rad")
    x, y, yaw = (finite(item) for item in value)
    if abs(yaw) > SMALLEST:
        remedy = "rotate the picture and set yaw to 0"
        raise wrong(f"{show(value)} has yaw {yaw:g}, only 0 can be read", remedy)
    return x, y


def _negate(value: object) -> bool:
    if isinstance(value, bool) or value in (0, 1):
        return bool(value)
    raise wrong(f"{show(value)} must be 0 or 1", "give 0 if black is occupied, else 1")


class RosMap(Section):
    """The YAML file of map_server."""

    image: Text
    resolution: Annotated[float, number("m", above=0)]
    origin: Annotated[Point, PlainValidator(_origin)]
    negate: Annotated[bool, BeforeValidator(_negate)] = False
    occupied_thresh: Annotated[float, number("", least=0, most=1)] = 0.65
    free_thresh: Annotated[float, number("", least=0, most=1)] = 0.196
    mode: Annotated[Literal["trinary", "scale", "raw"], choice("trinary", "scale", "raw")] = (
        "trinary"
    )


def read(path: Path) -> OccupancyGrid:
    """Return the cells of a map_server YAML file; unknown cells count as occupied.

    Raises
    ------
    BadInput
        If the YAML file or its picture is missing or broken, or the map is rotated.
    """
    document = _without_foreign_keys(read_document(path, what="map_server map"))
    map = validate(RosMap, document)
    if map.free_thresh > map.occupied_thresh:
        raise document.error(
            ("free_thresh",),
            f"free_thresh {map.free_thresh:g} is above occupied_thresh {map.occupied_thresh:g}",
            remedy="swap or correct them",
        )
    occupied = ~_free(_pixels(document, path.parent / map.image), map)
    return OccupancyGrid(
        occupied=np.ascontiguousarray(occupied[::-1]),
        resolution=map.resolution,
        origin=map.origin,
    )


def picture(path: Path) -> Path:
    """Return the path of the picture that a map_server YAML file names."""
    named = read_document(path, what="map_server map").value.get("image")
    return path.parent / str(named)


def _without_foreign_keys(document: Document) -> Document:
    """Drop keys of other tools (map_server ignores them), but not those that look misspelt."""
    known = list(RosMap.model_fields)
    kept = {
        key: value
        for key, value in document.value.items()
        if key in known or difflib.get_close_matches(key, known, n=1, cutoff=0.8)
    }
    return Document(file=document.file, value=kept, root=document.root)


def _pixels(document: Document, path: Path) -> NDArray[np.generic]:
    """Return the picture as (rows, columns) or (rows, columns, channels), 8 or 16 bits."""
    field = ("image",)
    try:
        found = path.is_file()
    except (OSError, ValueError):  # a name too long, or a NUL in it
        found = False
    if not found:
        raise document.error(
            field,
            f"image {document.value['image']!r}: no such file {path}",
            remedy="give its path relative to the YAML file",
        )
    try:
        with warnings.catch_warnings():
            # Pillow warns of large pictures; the limit here is on the size, below.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path, formats=PICTURES) as picture:
                _check_length(picture, path.stat().st_size)
                return _decoded(picture)
    except Exception as error:  # Pillow's decoders fail in many ways on broken files
        reason = str(error) or type(error).__name__
        raise document.error(
            field,
            f"image {path} cannot be read ({reason})",
            remedy="save it again as an 8-bit PGM or PNG",
        ) from None


def _check_length(picture: ImageFile.ImageFile, length: int) -> None:
    """Refuse a PGM with more pixels than its header says: the rows would be cut at wrong places."""
    if picture.format == "PPM" and picture.mode == "L" and picture.tile[0].codec_name == "raw":
        excess = length - picture.tile[0].offset - picture.width * picture.height
        if excess > 2:  # some writers end the file with a line break
            size = f"{picture.width} x {picture.height}"
            raise ValueError(f"it holds {excess} bytes more than the {size} pixels of its header")


def _decoded(picture: Image.Image) -> NDArray[np.generic]:
    if picture.width * picture.height > MAX_CELLS:
        raise ValueError(f"it has more than {MAX_CELLS} pixels")
    if picture.mode in ("1", "P"):
        picture = picture.convert("RGBA" if "transparency" in picture.info else "RGB")
    if picture.mode not in ("L", "LA", "RGB", "RGBA", "I", "I;16", "I;16B"):
        raise ValueError(f"pixels of the kind {picture.mode} have no meaning in a map")
    return np.asarray(picture)


def _free(pixels: NDArray[Any], map: RosMap) -> NDArray[np.bool_]:
    """Return which pixels are known to be free."""
    top = 255 if pixels.dtype == np.uint8 else 65535
    opaque = None
    if pixels.ndim == 3:
        if map.mode != "trinary" and pixels.shape[2] in (2, 4):
            opaque = pixels[:, :, -1] == top
            pixels = pixels[:, :, :-1]
        # In trinary mode map_server averages alpha in with the colours.
        pixels = np.rint(pixels.mean(axis=2)).astype(pixels.dtype)
    shade = np.arange(top + 1)
    if map.mode == "raw":
        # The value is the occupancy in percent; above 100 means unknown.
        occupancy = shade * (255 / top) / 100
    else:
        occupancy = shade / top if map.negate else 1 - shade / top
    free: NDArray[np.bool_] = (occupancy < map.free_thresh)[pixels]
    return free if opaque is None else free & opaque
