"""Answers to questions of the page."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from uavgram.model.survey import TiePicks
from uavgram.picking.document.commands import Place, Snap, Ties
from uavgram.picking.protocol.encode_answers import snap_json, ties_json
from uavgram.pipeline.pick.places import ExpectedPlace

LEFT, RIGHT = 90.0, 126.0


def test_ties_are_those_of_the_photo() -> None:
    ties = TiePicks(
        image=("a.jpg", "b.jpg", "a.jpg"),
        tie=("1", "1", "2"),
        pixel_px=np.array([[10.04, 20.0], [1.0, 2.0], [30.0, 40.06]]),
        sigma_px=np.ones(3),
    )

    found = ties_json(ties, Ties(image="a.jpg"))["places_px"]
    np.testing.assert_array_equal(found, [[10.0, 20.0], [30.0, 40.1]])
    assert ties_json(ties, Ties(image="c.jpg"))["places_px"] == []


def test_of_two_alike_the_match_says_which_and_else_it_only_looks_like_it() -> None:
    photo = np.full((200, 220, 3), 90, np.uint8)
    for u in (LEFT, RIGHT):
        cv2.circle(photo, (int(u), 100), 7, (220, 220, 220), -1, cv2.LINE_AA)
    photo = np.asarray(cv2.GaussianBlur(photo, (0, 0), 0.8), np.uint8)
    asked = Snap(image="a.jpg", u_px=20.0, v_px=20.0, target="target", expected="P1")
    expected = ExpectedPlace(np.array([LEFT - 6.0, 104.0]), 9.0**2 * np.eye(2))
    match = Place(image="a.jpg", label="P1", u_px=RIGHT + 1.2, v_px=99.1, source="match")

    at = Snap(image="a.jpg", u_px=LEFT + 2.0, v_px=101.0, target="target")
    alone = dict(snap_json(photo, asked, expected))
    matched = dict(snap_json(photo, asked, expected, match))
    pointed = dict(snap_json(photo, at, None))

    assert alone["u_px"] == pytest.approx(LEFT, abs=0.1)
    assert not alone["is_sure"]
    assert matched["u_px"] == pytest.approx(RIGHT, abs=0.1)
    assert matched["is_sure"]
    assert pointed["is_sure"]
