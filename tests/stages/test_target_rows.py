"""What is said of plates that were seen and not used."""

from __future__ import annotations

import numpy as np

from uavgram.model.observations import Picks, RejectedPlate, SeenPlate
from uavgram.stages.target_rows import add_targets

NO_PICKS = Picks(
    image=(), label=(), pixel_px=np.empty((0, 2)), sigma_px=np.empty(0), height_m=np.empty(0)
)


def _seen(plate: int, left_out: RejectedPlate = RejectedPlate.NO) -> SeenPlate:
    return SeenPlate(
        plate=plate,
        corner_px=np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]]),
        sigma_px=np.full(4, 0.04),
        center_px=np.array([10.0, 10.0]),
        center_sigma_px=0.02,
        score=0.99,
        left_out=left_out,
    )


def test_a_doubtful_plate_is_told_only_where_another_photo_shows_it() -> None:
    seen = {
        "a.jpg": (_seen(1), _seen(2, RejectedPlate.COVERED)),
        "b.jpg": (_seen(1, RejectedPlate.DOUBTFUL), _seen(9, RejectedPlate.DOUBTFUL)),
    }
    rows = add_targets(NO_PICKS, seen, {})
    assert set(rows.picks.image) == {"a.jpg"}
    assert rows.picks.label == ("T1-1", "T1-2", "T1-3", "T1-4")
    assert rows.plates == 1
    told = [message.text for message in rows.messages]
    assert len(told) == 2
    assert "a.jpg: plate T2" in told[0]
    assert "b.jpg: plate T1" in told[1]
