"""Features of photos: where they are, that they are spread, and what is no photo."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from tied_photos import HEIGHT_PX, WIDTH_PX, flight, photo

from uavgram.errors import InputError
from uavgram.imaging.ties.features import KEPT, WORKING_PX, find_features, read_features
from uavgram.imaging.ties.matching import match_features


def test_a_photo_turned_by_half_a_turn_has_its_features_at_the_turned_places() -> None:
    # OpenCV's SIFT has its places a quarter of a pixel off, if nobody asks it not to
    upright = photo(flight(), 0)
    one, other = find_features(upright), find_features(np.ascontiguousarray(upright[::-1, ::-1]))
    rows = match_features(one, other)
    turned = np.array([WIDTH_PX - 1, HEIGHT_PX - 1]) - other.pixel_px[rows[:, 1]]
    off = one.pixel_px[rows[:, 0]] - turned

    assert len(rows) > 300
    np.testing.assert_allclose(np.median(off, axis=0), 0.0, atol=0.02)
    assert np.median(np.abs(off)) < 0.05


def test_a_reduced_photo_has_its_features_where_the_original_has_them() -> None:
    small = photo(flight(), 0)
    large = cv2.resize(small, None, fx=4.0, fy=4.0, interpolation=cv2.INTER_CUBIC)
    one, other = find_features(small), find_features(np.asarray(large, np.uint8))
    rows = match_features(one, other)
    off = other.pixel_px[rows[:, 1]] - ((one.pixel_px[rows[:, 0]] + 0.5) * 4.0 - 0.5)

    assert max(large.shape) > WORKING_PX
    assert len(rows) > 200
    np.testing.assert_allclose(np.median(off, axis=0), 0.0, atol=0.1)
    assert np.median(one.size_px[rows[:, 0]] * 4.0 / other.size_px[rows[:, 1]]) == pytest.approx(
        1.0, abs=0.1
    )


def test_jpegs_that_are_decoded_at_half_size_have_them_there_too(tmp_path: Path) -> None:
    small = photo(flight(), 0)
    large = cv2.resize(small, None, fx=6.0, fy=6.0, interpolation=cv2.INTER_CUBIC)
    cv2.imwrite(str(tmp_path / "large.jpg"), large, [cv2.IMWRITE_JPEG_QUALITY, 95])
    one, other = find_features(small), read_features(tmp_path / "large.jpg")
    rows = match_features(one, other)
    off = other.pixel_px[rows[:, 1]] - ((one.pixel_px[rows[:, 0]] + 0.5) * 6.0 - 0.5)

    assert len(rows) > 200
    np.testing.assert_allclose(np.median(off, axis=0), 0.0, atol=0.15)


def test_strong_texture_in_one_corner_leaves_features_for_the_rest() -> None:
    weak = 120.0 + (photo(flight(), 0).astype(np.float64) - 120.0) * 0.5
    weak[:160, :200] = photo(flight(), 1)[:160, :200]
    grey = cv2.resize(np.clip(weak, 0, 255).astype(np.uint8), None, fx=2.5, fy=2.5)
    found = find_features(np.asarray(grey, np.uint8))
    in_corner = ((found.pixel_px < [500, 400]).all(axis=1)).mean()

    assert len(found.pixel_px) <= KEPT
    assert in_corner < 0.25


def test_an_even_photo_has_none_and_is_no_mistake() -> None:
    found = find_features(np.full((120, 160), 90, np.uint8))

    assert found.pixel_px.shape == (0, 2)
    assert len(match_features(found, found)) == 0


def test_what_is_no_photo_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.jpg").write_bytes(b"no photo")

    with pytest.raises(InputError, match=r"x\.jpg: is no photo that can be decoded"):
        read_features(tmp_path / "x.jpg")
