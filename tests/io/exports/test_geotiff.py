"""GeoTIFFs read back by rasterio: place, tiles, overviews, opacity and missing numbers."""

from __future__ import annotations

import errno
import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.enums import ColorInterp, MaskFlags

from uavgram.io.exports.geotiff import (
    mark_overviews,
    read_reduced,
    write_colour_geotiff,
    write_float_geotiff,
    write_turned_picture,
)
from uavgram.model.maps import GroundRaster

Pixels = NDArray[np.uint8]

CRS = "EPSG:32632"
WIDTH, HEIGHT = 1300, 900


def raster(crs: str | None = CRS) -> GroundRaster:
    return GroundRaster(
        west_m=691000.2, north_m=5334000.6, pixel_m=0.05, width=WIDTH, height=HEIGHT, crs=crs
    )


@pytest.fixture(scope="module")
def picture() -> Pixels:
    """(H, W, 4) opaque left of a slanting line, nothing right of it."""
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    rgba = np.stack([column % 256, row % 256, np.full_like(row, 200), np.full_like(row, 255)], -1)
    rgba[column > 700 + row // 3] = 0
    return rgba.astype(np.uint8)


def windows(picture: Pixels) -> Iterator[tuple[tuple[int, int, int, int], Pixels]]:
    """In an order of their own, as threads may hand them over."""
    for row in range(0, HEIGHT, 512)[::-1]:
        for column in range(0, WIDTH, 512):
            part = picture[row : row + 512, column : column + 512]
            yield (column, row, part.shape[1], part.shape[0]), part


@pytest.fixture(scope="module")
def path(picture: Pixels, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tiff") / "a.tif"
    write_colour_geotiff(raster(), windows(picture), {"survey": "crossing"}, path)
    return path


def test_place_and_coordinate_system_are_read_back(path: Path) -> None:
    with rasterio.open(path) as file:
        assert file.crs.to_string() == CRS
        assert (file.width, file.height) == (WIDTH, HEIGHT)
        affine = [0.05, 0, 691000.2, 0, -0.05, 5334000.6]
        np.testing.assert_allclose(file.transform[:6], affine, rtol=1e-12, atol=1e-12)
        assert file.tags()["survey"] == "crossing"


def test_pixels_come_back_as_they_were(path: Path, picture: Pixels) -> None:
    with rasterio.open(path) as file:
        assert file.dtypes == ("uint8",) * 4
        np.testing.assert_array_equal(np.moveaxis(file.read(), 0, 2), picture)


def test_it_is_tiled_compressed_and_has_overviews_down_to_a_tile(path: Path) -> None:
    with rasterio.open(path) as file:
        assert file.block_shapes == [(256, 256)] * 4
        assert file.profile["tiled"]
        assert file.compression.value == "DEFLATE"
        for band in range(1, 5):
            assert file.overviews(band) == [2, 4]
    assert path.stat().st_size < WIDTH * HEIGHT


def test_the_fourth_band_is_opacity(path: Path, picture: Pixels) -> None:
    with rasterio.open(path) as file:
        assert file.colorinterp[3] == ColorInterp.alpha
        assert MaskFlags.alpha in file.mask_flag_enums[0]
        np.testing.assert_array_equal(file.dataset_mask(), picture[..., 3])


def test_overviews_are_not_darker_where_the_picture_ends(path: Path) -> None:
    with rasterio.open(path, overview_level=0) as file:
        blue, alpha = file.read(3), file.read(4)
    assert alpha.shape == (HEIGHT // 2, WIDTH // 2)
    assert set(np.unique(blue[alpha > 0])) <= set(range(199, 202))
    assert not blue[alpha == 0].any()


def test_a_picture_to_print_comes_from_the_smallest_overview_that_will_do(path: Path) -> None:
    assert read_reduced(path, 2000).shape == (HEIGHT, WIDTH, 4)
    assert read_reduced(path, 651).shape == (HEIGHT, WIDTH, 4)
    assert read_reduced(path, 650).shape == (HEIGHT // 2, WIDTH // 2, 4)
    assert read_reduced(path, 10).shape == (HEIGHT // 4, WIDTH // 4, 4)


def test_a_picture_that_lies_turned_has_the_same_overviews(
    picture: Pixels, path: Path, tmp_path: Path
) -> None:
    corners = np.array([[10.0, 20.0], [70.0, 45.0], [-7.0, 61.0]])
    write_turned_picture(picture, corners, CRS, {}, tmp_path / "t.tif")

    with rasterio.open(tmp_path / "t.tif") as file:
        assert file.overviews(1) == [2, 4]
        np.testing.assert_array_equal(np.moveaxis(file.read(), 0, 2), picture)
        np.testing.assert_allclose(file.xy(0, WIDTH, offset="ul"), corners[1])
    for level in (0, 1):
        with (
            rasterio.open(tmp_path / "t.tif", overview_level=level) as turned,
            rasterio.open(path, overview_level=level) as straight,
        ):
            np.testing.assert_array_equal(turned.read(), straight.read())


def test_local_metres_have_a_place_but_no_coordinate_system(
    picture: Pixels, tmp_path: Path
) -> None:
    write_colour_geotiff(raster(crs=None), windows(picture), {}, tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.crs is None
        assert (file.transform.c, file.transform.f) == pytest.approx((691000.2, 5334000.6))


def test_numbers_come_back_with_their_name_and_nothing_where_there_is_none(tmp_path: Path) -> None:
    small = GroundRaster(west_m=10, north_m=20, pixel_m=0.5, width=70, height=50, crs=CRS)
    sigma = np.linspace(0.01, 3.0, 3500).reshape(50, 70)
    sigma[:, 60:] = np.nan
    write_float_geotiff(small, {"sigma_m": sigma}, {"sigma": "one"}, tmp_path / "s.tif")

    with rasterio.open(tmp_path / "s.tif") as file:
        assert np.isnan(file.nodata)
        assert file.descriptions == ("sigma_m",)
        assert file.tags()["sigma"] == "one"
        assert file.overviews(1) == [2]
        band = file.read(1, masked=True)
    np.testing.assert_array_equal(band.mask, np.isnan(sigma))
    np.testing.assert_allclose(band.filled(np.nan), sigma, rtol=1e-7)


def test_windows_without_a_picture_are_transparent(tmp_path: Path) -> None:
    nothing = np.zeros((512, 512, 4), np.uint8)
    some = nothing + np.uint8(255)
    pairs = [((0, 0, 512, 512), nothing), ((512, 0, 512, 512), some)]
    write_colour_geotiff(raster(), iter(pairs), {}, tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif") as file:
        alpha = file.read(4)
    assert not alpha[:, :512].any()
    assert (alpha[:512, 512:1024] == 255).all()
    assert not alpha[512:].any()


def test_gdalinfo_reads_coordinate_system_and_overviews(path: Path) -> None:
    program = shutil.which("gdalinfo")
    if program is None:
        pytest.skip("gdalinfo is not installed (Debian: gdal-bin)")
    run = subprocess.run(
        [program, "-json", "-checksum", str(path)], capture_output=True, text=True, check=True
    )
    said = json.loads(run.stdout)

    assert run.stderr == ""
    assert 'ID["EPSG",32632]' in said["coordinateSystem"]["wkt"]
    assert [band["colorInterpretation"] for band in said["bands"]] == [
        "Red", "Green", "Blue", "Alpha",
    ]  # fmt: skip
    for band in said["bands"]:
        assert [level["size"] for level in band["overviews"]] == [[650, 450], [325, 225]]


pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")


def write(path: Path, **options: str) -> None:
    """Two pictures, of which the second is half the size and twice as bright."""
    for size, grey, further in ((64, 50, {}), (32, 100, {"append_subdataset": True})):
        profile = {"driver": "GTiff", "width": size, "height": size, "count": 1, "dtype": "uint8"}
        with rasterio.open(path, "w", **profile, **options, **further) as file:
            file.write(np.full((1, size, size), grey, np.uint8))


@pytest.mark.parametrize("bigtiff", ["no", "yes"])
def test_the_second_picture_becomes_an_overview(tmp_path: Path, bigtiff: str) -> None:
    path = tmp_path / "a.tif"
    write(path, bigtiff=bigtiff)
    with rasterio.open(path) as file:
        assert not file.overviews(1)
    size = path.stat().st_size

    mark_overviews(path)

    assert path.stat().st_size == size
    with rasterio.open(path) as file:
        assert file.overviews(1) == [2]
        assert (file.read() == 50).all()
    with rasterio.open(path, overview_level=0) as file:
        assert file.shape == (32, 32)
        assert file.dtypes == ("uint8",)
        assert (file.read() == 100).all()


def test_a_file_that_is_declared_already_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    write(path)
    mark_overviews(path)
    with pytest.raises(ValueError, match="no sample format"):
        mark_overviews(path)


def test_a_big_endian_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    write(path, endianness="big")
    with pytest.raises(ValueError, match="little-endian"):
        mark_overviews(path)


def test_a_file_that_ends_early_means_a_full_disk(path: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.tif"
    whole = path.read_bytes()
    for size in (6, len(whole) // 2):
        cut.write_bytes(whole[:size])
        with pytest.raises(OSError, match="ends early") as fault:
            mark_overviews(cut)
        assert fault.value.errno == errno.ENOSPC
