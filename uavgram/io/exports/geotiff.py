"""Writer of GeoTIFF: tiled, compressed without loss, with overviews; written window by window."""

from __future__ import annotations

import errno
import struct
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple

import cv2
import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.enums import Resampling
from rasterio.errors import NotGeoreferencedWarning
from rasterio.io import DatasetWriter
from rasterio.windows import Window as FileWindow

from uavgram.imaging.photos.decoding import halve_with_opacity
from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Bools, Floats
from uavgram.model.maps import GroundRaster

# TIFF 6.0 (1992), pages 36 and 80: tags, a value of the first, and its type
NEW_SUBFILE_TYPE, SAMPLE_FORMAT = 254, 339
REDUCED, LONG = 1, 4


class _Layout(NamedTuple):
    """Formats of a directory's numbers: TIFF 6.0, page 13; the same in 64 bits in BigTIFF."""

    first_at: int
    offset: str
    number: str
    entry: str


_LAYOUTS = {
    b"II*\0": _Layout(4, "<I", "<H", "<HHII"),
    b"II+\0": _Layout(8, "<Q", "<Q", "<HHQQ"),
}


def mark_overviews(path: Path) -> None:
    """Mark all pictures of a file but the first as reductions of it.

    The entry replaces that of the sample format, which must exist (without it, the default is
    unsigned integers): so no directory grows, and no data is moved.

    Raises
    ------
    ValueError
        The file is not a little-endian TIFF, or a picture in it has no sample format.
    OSError
        The file ends early, as where the disk was full when GDAL closed it.
    """
    with path.open("r+b") as file:
        head = file.read(4)
        if head not in _LAYOUTS:
            raise ValueError(f"{path} is no little-endian TIFF")
        layout = _LAYOUTS[head]
        for number, at in enumerate(_directories(file, layout)):
            if number:
                _mark(file, layout, at)


def _directories(file: BinaryIO, layout: _Layout) -> Iterator[int]:
    """Iterate over the positions of all directories."""
    at = _number(file, layout.first_at, layout.offset)
    while at:
        yield at
        entries = at + struct.calcsize(layout.number)
        past = entries + _number(file, at, layout.number) * struct.calcsize(layout.entry)
        at = _number(file, past, layout.offset)


def _mark(file: BinaryIO, layout: _Layout, at: int) -> None:
    count = _number(file, at, layout.number)
    first = at + struct.calcsize(layout.number)
    file.seek(first)
    written = _read(file, count * struct.calcsize(layout.entry))
    entries = list(struct.iter_unpack(layout.entry, written))
    kept = [each for each in entries if each[0] != SAMPLE_FORMAT]
    if len(kept) != count - 1:
        raise ValueError(f"the picture at byte {at} has no sample format")
    file.seek(first)
    stated = (NEW_SUBFILE_TYPE, LONG, 1, REDUCED)  # entries are sorted by tag: this is the smallest
    file.writelines(struct.pack(layout.entry, *each) for each in (stated, *kept))


def _number(file: BinaryIO, at: int, form: str) -> int:
    file.seek(at)
    return int(struct.unpack(form, _read(file, struct.calcsize(form)))[0])


def _read(file: BinaryIO, size: int) -> bytes:
    content = file.read(size)
    if len(content) < size:
        raise OSError(errno.ENOSPC, "the file ends early", file.name)
    return content


WINDOW_PX = 768
"""Side of the windows in which a picture is written most efficiently: whole tiles."""

TILE_PX = 256  # fits into the processor's cache while it is compressed
_LEAST_OVERVIEW_PX = 256
# level 1 of DEFLATE: a few per cent larger than level 6, several times faster
_PROFILE = {
    "driver": "GTiff",
    "tiled": True,
    "blockxsize": TILE_PX,
    "blockysize": TILE_PX,
    "compress": "deflate",
    "zlevel": 1,
    "predictor": 2,
    "num_threads": "all_cpus",
    "bigtiff": "if_safer",
    "endianness": "little",
}
_COLOUR = {
    "count": 4,
    "dtype": "uint8",
    "photometric": "rgb",
    "alpha": "non-premultiplied",
    "sparse_ok": True,
}

Windowed = Iterable[tuple[tuple[int, int, int, int], NDArray[np.uint8]]]


def write_colour_geotiff(
    raster: GroundRaster, windows: Windowed, tags: dict[str, str], path: Path
) -> None:
    """Write RGB and opacity.

    Overviews are averaged from the given windows: reading back and averaging the written file, as
    GDAL does, takes longer than all the rest. The first overview is kept in memory until the
    picture is done: a byte for each pixel of the picture.

    Parameters
    ----------
    raster
        Size and position.
    windows
        Pairs of (first column, first row, width, height) and (height, width, 4) pixels. First
        columns and rows are even.
    tags
        Remarks to store in the file.
    path
        The file.
    """
    profile = _PROFILE | _COLOUR | _place(raster)
    half = np.zeros((-(-raster.height // 2), -(-raster.width // 2), 4), np.uint8)
    with _on_all_cores():
        with rasterio.open(path, "w", **profile) as file:
            file.update_tags(**tags)
            for (column, row, width, height), pixels in windows:
                middle = pixels[height // 2, width // 2, 3]  # usually sufficient
                if not (middle or pixels[..., 3].any()):  # unwritten tiles are transparent
                    continue
                _write_pixels(file, pixels, column, row)
                part = np.s_[row // 2 : -(-(row + height) // 2)]
                half[part, column // 2 : -(-(column + width) // 2)] = halve_with_opacity(pixels)
        _append_overviews(half, len(_factors(raster.width, raster.height)), path)


def _append_overviews(half: Pixels, count: int, path: Path) -> None:
    """Append overviews to a picture's file: `half` (H, W, 4), and each half of the last."""
    for _ in range(count):
        _append_picture(half, path)
        half = halve_with_opacity(half)
    mark_overviews(path)


def _append_picture(pixels: Pixels, path: Path) -> None:
    """Append (H, W, 4) to a file as a further picture of the same kind."""
    height, width = pixels.shape[:2]
    profile = _PROFILE | _COLOUR | {"width": width, "height": height, "append_subdataset": True}
    with warnings.catch_warnings():  # an overview has the position of its picture
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path, "w", **profile) as file:
            for row in range(0, height, WINDOW_PX):
                _write_pixels(file, pixels[row : row + WINDOW_PX], 0, row)


def _write_pixels(file: DatasetWriter, pixels: Pixels, column: int, row: int) -> None:
    height, width, count = pixels.shape
    bands = np.empty((count, height, width), np.uint8)
    cv2.split(pixels, list(bands))  # faster than numpy
    file.write(bands, window=FileWindow(column, row, width, height))


def write_float_geotiff(
    raster: GroundRaster, bands: dict[str, Floats], tags: dict[str, str], path: Path
) -> None:
    """Write named bands of numbers.

    Parameters
    ----------
    raster
        Size and position: H rows of W pixels.
    bands
        (H, W) numbers by the name of their band; NaN is "no data".
    tags
        Remarks to store in the file.
    path
        The file.
    """
    profile = _PROFILE | _place(raster)
    profile |= {"count": len(bands), "dtype": "float32", "nodata": np.nan, "predictor": 3}
    with _on_all_cores(), rasterio.open(path, "w", **profile) as file:
        file.update_tags(**tags)
        for number, (name, values) in enumerate(bands.items(), start=1):
            file.write(values.astype(np.float32), number)
            file.set_band_description(number, name)
        file.build_overviews(_factors(raster.width, raster.height), Resampling.average)


def write_turned_picture(
    rgba: NDArray[np.uint8], corners_m: Floats, crs: str | None, tags: dict[str, str], path: Path
) -> None:
    """Write a picture with overviews that may be rotated on the map, as for local metres.

    Parameters
    ----------
    rgba
        (H, W, 4) RGB and opacity.
    corners_m
        (3, 2) positions of its outer corners: first row's first and last, last row's first.
    crs
        Of the corners; None: local metres.
    tags
        Remarks to store in the file.
    path
        The file.
    """
    height, width = rgba.shape[:2]
    east, north = corners_m[0]
    right, up = (corners_m[1] - corners_m[0]) / width
    aside, below = (corners_m[2] - corners_m[0]) / height
    place = rasterio.Affine(right, aside, east, up, below, north)
    profile = _PROFILE | _COLOUR | {"width": width, "height": height, "crs": crs}
    with _on_all_cores():
        with rasterio.open(path, "w", **profile, transform=place) as file:
            file.update_tags(**tags)
            _write_pixels(file, rgba, 0, 0)
        _append_overviews(halve_with_opacity(rgba), len(_factors(width, height)), path)


def add_opacity(rgb: Pixels, covered: Bools) -> Pixels:
    """Add opacity to (H, W, 3) pixels, 0 outside the mask (H, W): (H, W, 4)."""
    opacity = np.where(covered, np.uint8(255), np.uint8(0))
    return np.asarray(cv2.merge([rgb, opacity]), np.uint8)


def read_reduced(path: Path, shortest_px: int) -> NDArray[np.uint8]:
    """Read the smallest overview whose longer side is long enough (h, w, 4); else the picture."""
    with rasterio.open(path) as file:
        longer = max(file.width, file.height)
        fits = [k for k, f in enumerate(file.overviews(1)) if longer >= f * shortest_px]
    level = {"overview_level": fits[-1]} if fits else {}
    with _on_all_cores(), rasterio.open(path, **level) as file:
        return np.ascontiguousarray(np.moveaxis(file.read(), 0, 2))


def _on_all_cores() -> rasterio.Env:
    """Return an environment in which GDAL uses all cores, for overviews too."""
    return rasterio.Env(GDAL_NUM_THREADS="ALL_CPUS")


def _place(raster: GroundRaster) -> dict[str, object]:
    return {
        "width": raster.width,
        "height": raster.height,
        "crs": raster.crs,
        "transform": rasterio.Affine(
            raster.pixel_m, 0.0, raster.west_m, 0.0, -raster.pixel_m, raster.north_m
        ),
    }


def _factors(width: int, height: int) -> Sequence[int]:
    """Return the factors of overviews until the picture fits into a tile; at least one."""
    factors = [2]
    while max(width, height) / factors[-1] > 2 * _LEAST_OVERVIEW_PX:
        factors.append(2 * factors[-1])
    return factors
