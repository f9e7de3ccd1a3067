"""GeoTIFF: tiled, compressed without loss, with overviews; written window by window."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.enums import ColorInterp, Resampling
from rasterio.windows import Window as FileWindow

from uavgram.model.arrays import Floats
from uavgram.model.ground_raster import GroundRaster

TILE_PX = 512
_LEAST_OVERVIEW_PX = 256
# Level 1 of DEFLATE: a few per cent larger than level 6, several times faster.
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
}

Windowed = Iterable[tuple[tuple[int, int, int, int], NDArray[np.uint8]]]


def write_colour_geotiff(
    raster: GroundRaster, windows: Windowed, tags: dict[str, str], path: Path
) -> None:
    """Write RGB and opacity.

    Parameters
    ----------
    raster
        Size and place.
    windows
        Pairs of (first column, first row, width, height) and (height, width, 4) pixels.
    tags
        Remarks to store in the file.
    path
        The file.
    """
    profile = _PROFILE | _place(raster) | {"count": 4, "dtype": "uint8", "photometric": "rgb"}
    with _on_all_cores(), rasterio.open(path, "w", **profile) as file:
        file.colorinterp = [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha]
        file.update_tags(**tags)
        for (column, row, width, height), pixels in windows:
            if pixels[..., 3].any():  # what is never written is transparent
                at = FileWindow(column, row, width, height)
                file.write(np.moveaxis(pixels, 2, 0), window=at)
        file.build_overviews(_factors(raster), Resampling.average)


def write_float_geotiff(
    raster: GroundRaster, bands: dict[str, Floats], tags: dict[str, str], path: Path
) -> None:
    """Write named bands of numbers (H, W); NaN is "no data"."""
    profile = _PROFILE | _place(raster)
    profile |= {"count": len(bands), "dtype": "float32", "nodata": np.nan, "predictor": 3}
    with _on_all_cores(), rasterio.open(path, "w", **profile) as file:
        file.update_tags(**tags)
        for number, (name, values) in enumerate(bands.items(), start=1):
            file.write(values.astype(np.float32), number)
            file.set_band_description(number, name)
        file.build_overviews(_factors(raster), Resampling.average)


def read_reduced(path: Path, shortest_px: int) -> NDArray[np.uint8]:
    """(h, w, 4) the smallest overview whose longer side is no shorter; else the picture itself."""
    with rasterio.open(path) as file:
        longer = max(file.width, file.height)
        fits = [k for k, f in enumerate(file.overviews(1)) if longer >= f * shortest_px]
    level = {"overview_level": fits[-1]} if fits else {}
    with _on_all_cores(), rasterio.open(path, **level) as file:
        return np.ascontiguousarray(np.moveaxis(file.read(), 0, 2))


def _on_all_cores() -> rasterio.Env:
    """GDAL's own threads, for overviews too."""
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


def _factors(raster: GroundRaster) -> Sequence[int]:
    """Halves until the picture fits into a tile; at least one."""
    factors = [2]
    while max(raster.width, raster.height) / factors[-1] > 2 * _LEAST_OVERVIEW_PX:
        factors.append(2 * factors[-1])
    return factors
