"""Answers to questions of the page."""

from __future__ import annotations

import numpy as np

from uavgram.model.survey.ties import TiePicks
from uavgram.picking.document.commands import Ties
from uavgram.picking.protocol.encode_answers import ties_json


def test_ties_are_those_of_the_photo() -> None:
    ties = TiePicks(
        image=("a.jpg", "b.jpg", "a.jpg"),
        tie=("1", "1", "2"),
        pixel_px=np.array([[10.04, 20.0], [1.0, 2.0], [30.0, 40.06]]),
        sigma_px=np.ones(3),
    )

    assert ties_json(ties, Ties(image="a.jpg")) == {"places_px": [[10.0, 20.0], [30.0, 40.1]]}
    assert ties_json(ties, Ties(image="c.jpg")) == {"places_px": []}
