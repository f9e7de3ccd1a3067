"""Plates that were found are known lengths, of a tape of their own."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.observations import KnownLines, Picks
from uavgram.stages.plate_sides import PLATE_TAPE, SQUARE, add_plate_sides, own_scale_sigma

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
    ((tape, sigma),) = own_scale_sigma(0.6 * SQUARE, 0.0012)
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
