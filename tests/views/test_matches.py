"""What a search for picks came to, in words."""

from __future__ import annotations

import numpy as np

from uavgram.model.observations import Picks
from uavgram.stages.match import Matches, Record
from uavgram.views.terminal import match_lines


def nothing(turned_rad: float) -> Matches:
    none = np.zeros(0)
    picks = Picks(
        image=(),
        label=(),
        pixel_px=np.zeros((0, 2)),
        sigma_px=none,
        height_m=none,
        height_sigma_m=none,
    )
    return Matches(
        path="picks.csv", record=Record(), labels=(), picks=picks, replaced=0, turned_rad=turned_rad
    )


def test_a_log_that_contradicts_the_photos_is_told_and_what_to_do() -> None:
    told = " ".join(match_lines(nothing(float(np.deg2rad(14.2)))))
    assert "some 14 degrees away from its direction by the flight log and `mount`" in told
    assert "`ties: auto`" in told
    assert "--undo" in told


def test_it_is_not_told_of_a_log_that_fits() -> None:
    assert "degrees" not in " ".join(match_lines(nothing(0.0)))
