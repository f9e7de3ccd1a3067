"""Corners off the ground found in several photos at once: truth from where they were put."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.stats import norm
from textures import BLUR_PX, Texture

from uavgram.imaging.matching import line_of_sight
from uavgram.imaging.matching.least_squares import RefusalReason
from uavgram.imaging.matching.line_of_sight import (
    LineMatches,
    SightLine,
    choose_line_place,
    compute_corner_strength,
    match_along_line,
)
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

SHAPE = (120, 160)
CORNER = np.array([70.3, 60.8])
BASES = np.array([[12.0, 1.0], [-14.0, 2.0], [20.0, -1.0]])
"""By how many pixels a height of one moves things in each photo."""
HEIGHT = np.linspace(-0.5, 4.0, 190)
GROUND, ROOF = Texture.random(1, contrast=12.0), Texture.random(2, contrast=6.0)


def photo(height: float, base: Floats, seed: int, *, thing: bool = True) -> Image:
    """A roof right of and below its corner, at a height, over the ground."""
    rng = np.random.default_rng(seed)
    ground = GROUND.photo(SHAPE, np.eye(2), np.zeros(2), 0.0, rng).astype(np.float64)
    moved = height * base
    roof = ROOF.photo(SHAPE, np.eye(2), -moved, 0.0, rng) + 60.0
    v, u = np.mgrid[: SHAPE[0], : SHAPE[1]]
    right, below = (
        norm.cdf((u - CORNER[0] - moved[0]) / BLUR_PX),
        norm.cdf((v - CORNER[1] - moved[1]) / BLUR_PX),
    )
    share = right * below * thing
    grey = ground * (1 - share) + roof * share + rng.normal(0, 1.5, SHAPE)
    return np.asarray(np.clip(np.rint(grey), 0, 255), np.uint8)


def line(bases: Floats = BASES) -> SightLine:
    return SightLine(
        source_px=CORNER,
        pixel_px=CORNER + HEIGHT[:, None, None] * bases,
        affine=np.tile(np.eye(2), (len(HEIGHT), len(bases), 1, 1)),
        lowest=int(np.searchsorted(HEIGHT, 0.25)),
    )


def looked(height: float, hidden: tuple[int, ...] = (), bases: Floats = BASES) -> LineMatches:
    source = photo(height, np.zeros(2), 10)
    others = [photo(height, base, 11 + k, thing=k not in hidden) for k, base in enumerate(bases)]
    return match_along_line(source, others, line(bases))


def why(found: LineMatches) -> list[RefusalReason]:
    return [RefusalReason(number) for number in found.refused.tolist()]


def test_a_corner_is_found_although_what_lies_behind_it_is_another_thing_in_each_photo() -> None:
    found = looked(1.4)

    assert why(found) == [RefusalReason.NONE] * 3
    np.testing.assert_allclose(found.pixel_px, CORNER + 1.4 * BASES, atol=0.3)


def test_a_photo_that_hides_the_corner_is_left_out() -> None:
    found = looked(1.4, hidden=(1,))

    assert [reason == RefusalReason.NONE for reason in why(found)] == [True, False, True]
    assert np.isnan(found.pixel_px[1]).all()


def test_two_photos_that_agree_are_not_enough_where_most_that_should_show_it_do_not() -> None:
    bases = np.vstack([BASES, -1.2 * BASES, 0.7 * BASES])

    assert RefusalReason.NONE not in why(looked(1.4, hidden=(0, 2, 3, 4, 5, 7), bases=bases))


def test_a_corner_at_the_edge_of_its_own_photo_is_not_compared_with_what_lies_beyond() -> None:
    at_edge = line()._replace(source_px=np.array([8.0, 60.0]))
    source, other = photo(1.4, np.zeros(2), 10), photo(1.4, BASES[0], 11)

    assert why(match_along_line(source, [other] * 3, at_edge)) == [RefusalReason.OUTSIDE] * 3


def test_one_other_photo_says_nothing_as_it_agrees_somewhere_on_any_line() -> None:
    assert why(looked(1.4, bases=BASES[:1])) == [RefusalReason.NOT_LIKE]


def test_a_corner_on_the_ground_is_not_taken_for_one_above() -> None:
    assert RefusalReason.NONE not in why(looked(0.0))
    assert RefusalReason.NONE not in why(looked(0.2))


def test_what_repeats_along_the_line_is_refused() -> None:
    stripes, rng = Texture.stripes(11.0), np.random.default_rng(5)
    source, *others = (
        stripes.photo(SHAPE, np.eye(2), -1.4 * base, 1.5, rng)
        for base in np.vstack([np.zeros(2), [[11.0, 0.0], [-11.0, 0.0]]])
    )
    level = np.array([[11.0, 0.0], [-11.0, 0.0]])

    assert why(match_along_line(source, others, line(level))) == [RefusalReason.NOT_UNIQUE] * 2


@pytest.mark.parametrize(
    ("other", "reason"), [(0.97, RefusalReason.NOT_UNIQUE), (0.5, RefusalReason.NONE)]
)
def test_where_another_place_shares_as_much_of_a_corner_there_is_none(
    other: float, reason: RefusalReason
) -> None:
    strength = np.full(len(HEIGHT), 0.1)
    strength[80], strength[130] = 1.5, 1.5 * other

    assert choose_line_place(strength, line()) == (80, reason)


def test_a_corner_that_is_strongest_on_the_ground_is_none_above() -> None:
    strength = np.full(len(HEIGHT), 0.1)
    strength[[20, 130]] = 1.5, 1.2

    assert choose_line_place(strength, line()) == (20, RefusalReason.NOT_UNIQUE)


@pytest.mark.parametrize("aside", [(0.0, 12.0), (14.0, 0.0), (2.5, 2.5), (-2.5, -2.5)])
def test_a_pick_beside_a_corner_is_not_taken_for_it(aside: tuple[float, float]) -> None:
    """On a straight edge of the roof, and where a corner is seen but is not what was picked."""
    beside = line()._replace(
        source_px=CORNER + aside, pixel_px=CORNER + aside + HEIGHT[:, None, None] * BASES
    )
    source, *others = (photo(1.4, base, 10 + k) for k, base in enumerate([np.zeros(2), *BASES]))

    assert RefusalReason.NONE not in why(match_along_line(source, others, beside))


def test_a_pick_at_the_edge_of_a_coarse_roof_is_no_corner(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every point of such an edge is the same in all photos, with the roof beside it."""
    monkeypatch.setattr(sys.modules[__name__], "ROOF", Texture.random(2, contrast=35.0))
    at_edge = CORNER + np.array([16.0, 0.0])
    beside = line()._replace(source_px=at_edge, pixel_px=at_edge + HEIGHT[:, None, None] * BASES)
    source, *others = (photo(1.4, base, 10 + k) for k, base in enumerate([np.zeros(2), *BASES]))

    assert why(match_along_line(source, others, beside)) == [RefusalReason.NOT_UNIQUE] * 3


@pytest.mark.parametrize(
    ("photos", "reason"), [(1, RefusalReason.NONE), (3, RefusalReason.UNSTABLE)]
)
def test_a_corner_that_the_line_passes_in_all_photos_is_another_one(
    monkeypatch: pytest.MonkeyPatch, photos: int, reason: RefusalReason
) -> None:
    """As that of the roof beside one of a wall that is seen from its edge: 1.3 px away in each."""
    strength = np.where(np.arange(len(HEIGHT)) == np.abs(HEIGHT - 1.4).argmin(), 1.5, 0.0)

    def given(_source: Image, _targets: Sequence[Image], at: SightLine) -> Floats:
        return strength if len(at.pixel_px) == len(HEIGHT) else np.zeros(len(at.pixel_px))

    monkeypatch.setattr(line_of_sight, "compute_corner_strength", given)
    passing = line()
    passing.pixel_px[:, :photos] += (0.0, 1.3)
    source, *others = (photo(1.4, base, 10 + k) for k, base in enumerate([np.zeros(2), *BASES]))

    assert why(match_along_line(source, others, passing)) == [reason] * 3


def test_the_shared_corner_is_where_the_roof_is_however_bright_what_lies_beyond() -> None:
    """In one photo half the light, in another dark for bright: edges stay where they are."""
    source, *others = (photo(1.4, base, 10 + k) for k, base in enumerate([np.zeros(2), *BASES]))
    others[0] = np.asarray(others[0] // 2, np.uint8)
    others[1] = np.asarray(255 - others[1], np.uint8)

    strength = compute_corner_strength(source, others, line())

    place = int(strength.argmax())
    assert HEIGHT[place] == pytest.approx(1.4, abs=0.06)
    assert strength[place] > 1.0
    assert strength[np.abs(HEIGHT - 1.4) > 0.4].max() < 0.7 * strength[place]
