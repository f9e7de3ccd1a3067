"""Plates that were found are known lengths, of a tape of their own."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.observations import KnownLines, Picks, RejectedPlate, SeenPlate
from uavgram.stages.plates import PLATE_TAPE, SQUARE, add_plate_sides, add_targets, make_scale_prior

NO_LINES = KnownLines(
    name=(), start=(), end=(), length_m=np.empty(0), sigma_m=np.empty(0), adjust=np.empty(0, bool)
)


def _picks(*labels: str, source: str = "target") -> Picks:
    n = len(labels)
    return Picks(
        image=("a.jpg",) * n,
        label=labels,
        pixel_px=np.zeros((n, 2)),
        sigma_px=np.full(n, 0.04),
        height_m=np.full(n, np.nan),
        source=(source,) * n,  # type: ignore[arg-type]  # one of the sources
    )


def test_four_corners_are_four_sides_and_two_diagonals() -> None:
    lines = add_plate_sides(NO_LINES, _picks("T7-1", "T7-2", "T7-3", "T7-4"), 0.6 * SQUARE, 0.001)
    lengths = {
        frozenset({a, b}): m for a, b, m in zip(lines.start, lines.end, lines.length_m, strict=True)
    }
    assert len(lengths) == 6
    assert lengths[frozenset({"T7-1", "T7-4"})] == pytest.approx(0.6)
    assert lengths[frozenset({"T7-2", "T7-4"})] == pytest.approx(0.6 * 2**0.5)
    assert set(lines.tape) == {PLATE_TAPE}
    ((tape, sigma),) = make_scale_prior(0.6 * SQUARE, 0.0012)
    assert tape == PLATE_TAPE
    assert sigma == pytest.approx(0.002)


def test_what_a_person_measured_stands_and_what_a_person_picked_is_no_plate() -> None:
    own = KnownLines(
        name=("mine",),
        start=("T7-2",),
        end=("T7-1",),
        length_m=np.array([0.61]),
        sigma_m=np.array([0.002]),
        adjust=np.array([True]),
    )
    lines = add_plate_sides(own, _picks("T7-1", "T7-2"), 0.6 * SQUARE, 0.001)
    assert lines.name == ("mine",)
    by_hand = _picks("T7-1", "T7-2", source="hand")
    assert add_plate_sides(NO_LINES, by_hand, 0.6 * SQUARE, 0.001) is NO_LINES


# What is said of plates that were seen and not used.


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
