"""A target that was clicked a little beside its centre is proposed elsewhere at its very centre."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest

from uavgram.imaging.photos.cache import GreyPhotos
from uavgram.imaging.raster import Image
from uavgram.picking.document.commands import Place
from uavgram.picking.session.picked_targets import PickedTargets
from uavgram.pipeline.pick.live_survey import LiveSurvey

FINER = 16
HERE, THERE = (60.21875, 55.46875), (70.96875, 64.71875)
CLICK = (61.21875, 54.46875)
"""Beside the centre by a pixel each way."""

TURN = np.array([[0.0, -1.2], [1.2, 0.0]])
"""From the first photo to the second: turned by 90 degrees, and larger."""

MATCH = Place(
    image="b.jpg",
    label="P1",
    u_px=THERE[0] + 1.2,
    v_px=THERE[1] + 1.2,
    sigma_px=0.05,
    source="match",
    score=0.9,
    from_image="a.jpg",
    from_u_px=CLICK[0],
    from_v_px=CLICK[1],
)


def disc(place: tuple[float, float]) -> Image:
    finer = np.full((120 * FINER, 130 * FINER), 70, np.uint8)
    u, v = (round((one + 0.5) * FINER - 0.5) for one in place)
    cv2.circle(finer, (u, v), 9 * FINER, 200, -1)
    small = cv2.resize(finer, (130, 120), interpolation=cv2.INTER_AREA)
    return cast("Image", cv2.GaussianBlur(small, (0, 0), 0.7))


@pytest.fixture
def targets() -> Iterator[PickedTargets]:
    pictures = {"a.jpg": disc(HERE), "b.jpg": disc(THERE), "bare.jpg": np.full_like(disc(HERE), 70)}
    photos = GreyPhotos(dict.fromkeys(pictures, 15_600), pictures.__getitem__)
    calibration = SimpleNamespace(parameters=np.array([400.0]))
    survey = SimpleNamespace(inputs=SimpleNamespace(calibration=calibration))
    yield PickedTargets(cast("LiveSurvey", survey), photos)
    photos.stop()


def test_the_target_itself_is_proposed_where_its_surroundings_were_found(
    targets: PickedTargets,
) -> None:
    found = targets.target_at(MATCH, TURN)

    assert found.source == "target"
    assert (found.u_px, found.v_px) == pytest.approx(THERE, abs=0.05)
    assert (found.from_image, found.from_u_px, found.from_v_px) == ("", None, None)
    assert found.sigma_px is not None
    assert 0.02 < found.sigma_px < 0.25


def test_a_match_stays_one_where_there_is_no_clear_target(targets: PickedTargets) -> None:
    hidden = replace(MATCH, image="bare.jpg")
    no_target = replace(MATCH, from_image="bare.jpg")
    beside = replace(MATCH, u_px=THERE[0] + 6.0)

    for one in (hidden, no_target, beside):
        assert targets.target_at(one, TURN) == one
