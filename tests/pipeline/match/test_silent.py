"""What a photo that does not show a point says of the point's height."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from uavgram.imaging.matching.least_squares import REASON_TEXTS, RefusalReason
from uavgram.model.arrays import Floats
from uavgram.pipeline.match.height_evidence import is_informative
from uavgram.stages.match import CONTRADICTED, Candidates, Found, Missed

PAIR = ("b.jpg", "CORNER")
PREDICTED, RISE = np.array([200.0, 100.0]), np.array([3.0, 4.0])
ALONG, ACROSS = np.array([0.6, 0.8]), np.array([-0.8, 0.6])


def is_told(missed: Missed) -> bool:
    """Whether one place, predicted to 1 px, counts."""
    places: Any = SimpleNamespace(
        rise=RISE[None], pixel_px=PREDICTED[None], covariance_px2=np.eye(2)[None]
    )
    none = np.zeros(1, np.bool_)
    candidates = Candidates(places, (PAIR,), np.zeros(1, np.int64), none, none)
    return is_informative(candidates, 0, missed)


@pytest.mark.parametrize(
    ("way", "expected"),
    [(12.0 * ACROSS, False), (12.0 * ALONG, True), (2.0 * ACROSS, True)],
)
def test_what_moved_beside_its_line_of_sight_says_nothing_of_a_height(
    way: Floats, *, expected: bool
) -> None:
    u, v = (PREDICTED + way).tolist()
    found = Found(0, (u, v), 0.1, 0.9, 8.0)

    assert is_told(found.revoke(CONTRADICTED)) is expected


def test_the_end_of_a_photo_says_nothing_and_another_thing_there_does() -> None:
    assert not is_told(Missed(0, 8.0, REASON_TEXTS[RefusalReason.OUTSIDE]))
    assert is_told(Missed(0, 8.0, REASON_TEXTS[RefusalReason.NOT_LIKE]))
