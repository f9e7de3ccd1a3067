"""Places of picks in photos without a pose: where the features around them moved."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest

from uavgram.model.camera import Calibration
from uavgram.picking.document.state import Pick, State, make_observations
from uavgram.pipeline.match.places_by_features import FeaturePlaces, fit_local_map
from uavgram.pipeline.pick.live_survey import LiveSurvey

AFFINE = np.array([[1.1, 0.2], [-0.1, 0.9]])
SHIFT = np.array([40.0, -30.0])
PHOTOS, SIZE = ("a.png", "b.png", "c.png"), (640, 480)


def test_a_pick_moves_as_the_features_around_it() -> None:
    rng = np.random.default_rng(1)
    here = rng.uniform(0, 1000, (200, 2))
    place = fit_local_map(here, here @ AFFINE.T + SHIFT, np.array([500.0, 400.0]))

    np.testing.assert_allclose(place.pixel_px, AFFINE @ [500.0, 400.0] + SHIFT)
    np.testing.assert_allclose(place.affine, AFFINE)
    assert place.covariance_px2.max() < 1e-9


def test_the_error_of_a_place_is_that_of_the_features_around_it() -> None:
    rng, squared = np.random.default_rng(2), []
    for _ in range(200):
        here = rng.uniform(0, 1000, (200, 2))
        there = here @ AFFINE.T + SHIFT + rng.normal(0, 2.0, here.shape)
        own = np.array([500.0, 400.0])
        place = fit_local_map(here, there, own)
        off = AFFINE @ own + SHIFT + rng.normal(0, 2.0, 2) - place.pixel_px
        squared.append(off @ np.linalg.solve(place.covariance_px2, off) / 2)

    assert np.mean(squared) == pytest.approx(1.0, abs=0.25)


@pytest.fixture
def survey(tmp_path: Path) -> LiveSurvey:
    """Two photos of the same ground, 60 pixels apart, and one of another."""
    rng = np.random.default_rng(3)
    grounds = []
    for _ in range(2):
        coarse = rng.uniform(0, 255, (90, 120)).astype(np.float32)
        grounds.append(cv2.resize(coarse, (840, 630), interpolation=cv2.INTER_CUBIC))
    width, height = SIZE
    cuts = grounds[0][:height, :width], grounds[0][20:, 60:], grounds[1]
    for name, cut in zip(PHOTOS, cuts, strict=True):
        cv2.imwrite(str(tmp_path / name), np.clip(cut[:height, :width], 0, 255).astype(np.uint8))
    calibration = Calibration(
        name="test",
        model="brown",
        width_px=width,
        height_px=height,
        parameters=np.array([600.0, 600.0, 319.5, 239.5, 0, 0, 0, 0, 0]),
        covariance=np.zeros((9, 9)),
    )
    photos = SimpleNamespace(frame_id=PHOTOS, path=tuple(str(tmp_path / one) for one in PHOTOS))
    inputs = SimpleNamespace(photos=photos, calibration=calibration)
    return cast("LiveSurvey", SimpleNamespace(inputs=inputs))


def test_only_photos_of_the_same_ground_are_searched(survey: LiveSurvey) -> None:
    # The second pick is not on the ground, and the third one is outside the second photo.
    places = [("A", 300.0, 200.0, None), ("B", 320.0, 230.0, 1.5), ("C", 30.0, 200.0, None)]
    picks, _ = make_observations(
        State(
            picks=tuple(
                Pick(image="a.png", label=label, u_px=u, v_px=v, height_m=height)
                for label, u, v, height in places
            )
        )
    )
    found = list(FeaturePlaces(survey.inputs).predict(picks, lambda _: True))

    (place,) = [one for one in found if one.pair]
    assert place.pair == (("b.png", "A"),)
    np.testing.assert_allclose(place.places.pixel_px, [[240.0, 180.0]], atol=0.5)
    assert place.radius_px[0] < 5.0
