"""Pictures of a TIFF declared overviews: rasterio finds them; what is no such file is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio

from uavgram.io.exports.geotiff_overviews import mark_overviews

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
