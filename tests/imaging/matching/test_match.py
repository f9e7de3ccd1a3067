"""Points found in another photo: truth from textures known at every place."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.stats import chi2
from textures import Texture

from uavgram.imaging.matching.least_squares import (
    PATCHES,
    REASON_TEXTS,
    Matches,
    MatchOptions,
    RefusalReason,
    SoughtPoints,
    fit_patches,
)
from uavgram.imaging.matching.match import (
    HALF_SQUARE,
    REGION,
    compute_worst_quarter_correlation,
    find_unoccluded,
    match_points,
)
from uavgram.imaging.patches import Grey
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

SHAPE = (200, 260)
MIDDLE = np.array([130.0, 100.0])
SOURCE = MIDDLE + np.random.default_rng(7).uniform(-45, 45, (12, 2))
LEVEL = np.eye(2)
SHIFT = np.array([3.37, -2.71])


def turned(angle_deg: float, stretch_u: float, stretch_v: float) -> Floats:
    angle = np.deg2rad(angle_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return turn @ np.diag([stretch_u, stretch_v])


def photos(
    texture: Texture, affine: Floats, seed: int = 1, noise: float = 1.5
) -> tuple[Image, Image]:
    """Target pixel = affine (source pixel - MIDDLE) + MIDDLE + SHIFT."""
    rng = np.random.default_rng(seed)
    back: Floats = np.asarray(np.linalg.inv(affine), np.float64)
    return (
        texture.photo(SHAPE, LEVEL, np.zeros(2), noise, rng),
        texture.photo(SHAPE, back, MIDDLE - back @ (MIDDLE + SHIFT), noise, rng),
    )


def truth(source: Floats, affine: Floats) -> Floats:
    return np.asarray((source - MIDDLE) @ affine.T + MIDDLE + SHIFT)


def sought(
    source: Floats, affine: Floats, sigma: float = 2.0, off: ArrayLike = 0.0
) -> SoughtPoints:
    n = len(source)
    return SoughtPoints(
        source_px=source,
        target_px=truth(source, affine) + np.asarray(off),
        covariance_px2=np.tile(sigma**2 * np.eye(2), (n, 1, 1)),
        affine=np.tile(affine, (n, 1, 1)),
        rise=np.zeros((n, 2)),
        is_confirmed=np.zeros(n, dtype=np.bool_),
    )


def why(found: Matches) -> set[RefusalReason]:
    return {RefusalReason(number) for number in found.refused.tolist()}


@pytest.mark.parametrize(
    "affine",
    [
        LEVEL,
        turned(35.0, 1.0, 1.0),
        turned(-160.0, 1.1, 0.95),
        turned(10.0, 0.5, 0.45),
        turned(0.0, 1.0, 0.55),
        turned(-20.0, 1.9, 1.0),
        LEVEL[::-1] * np.array([[1.0], [-1.0]]),
    ],
)
def test_points_are_found_to_hundredths_of_a_pixel(affine: Floats) -> None:
    source = MIDDLE + 0.8 * (SOURCE - MIDDLE)
    texture = Texture.random(3, finest=0.3)
    off = np.random.default_rng(2).normal(0, 2, (12, 2))
    found = match_points(*photos(texture, affine), sought(source, affine, 2.0, off))
    assert why(found) == {RefusalReason.NONE}
    step = float(np.linalg.svd(affine, compute_uv=False).max(initial=1.0))
    error = found.pixel_px - truth(source, affine)
    assert np.sqrt(np.mean(error**2)) < 0.04 * step
    assert found.score.min() > 0.9


def test_a_map_that_is_a_little_wrong_is_found_right() -> None:
    affine = turned(3.0, 1.04, 0.97)
    off = truth(SOURCE, affine) - truth(SOURCE, LEVEL)
    found = match_points(*photos(Texture.random(4), affine), sought(SOURCE, LEVEL, 2.0, off))
    assert why(found) == {RefusalReason.NONE}
    assert np.abs(found.pixel_px - truth(SOURCE, affine)).max() < 0.15


def test_the_covariance_is_that_of_repeated_noise() -> None:
    # No ground bends in these photos, and nothing was sharpened: noise alone.
    options = MatchOptions(patches=PATCHES[:1], bend=0.0, floor=0.0)
    affine = turned(20.0, 1.2, 0.9)
    squared = []
    for seed in range(10):
        pair = photos(Texture.random(seed, 15.0), affine, seed, noise=3.0)
        found = match_points(*pair, sought(SOURCE, affine), options)
        error = found.pixel_px - truth(SOURCE, affine)
        some = found.refused == RefusalReason.NONE
        weight = np.linalg.inv(found.covariance_px2[some])
        squared.append(np.einsum("ni,nij,nj->n", error[some], weight, error[some]))
    values = np.concatenate(squared)
    assert len(values) > 100
    low, high = (float(chi2.ppf(p, 2 * len(values))) / (2 * len(values)) for p in (1e-3, 0.999))
    assert low < values.mean() / 2 < high


def test_brighter_and_stronger_light_changes_nothing() -> None:
    near, far = photos(Texture.random(5), LEVEL)
    lit = np.clip(0.7 * far + 40, 0, 255).astype(np.uint8)
    plain, other = (match_points(near, photo, sought(SOURCE, LEVEL)) for photo in (far, lit))
    assert why(other) == {RefusalReason.NONE}
    assert np.abs(plain.pixel_px - other.pixel_px).max() < 0.05


def test_a_repeated_marking_is_found_where_the_prediction_decides() -> None:
    period = 24.0
    pair = photos(Texture.stripes(period), LEVEL)
    off = np.array([2.0, -1.5])
    # The region's radius is a third of the period.
    found = match_points(*pair, sought(SOURCE, LEVEL, period / 3 / REGION**0.5, off))
    assert why(found) == {RefusalReason.NONE}
    assert np.abs(found.pixel_px - truth(SOURCE, LEVEL)).max() < 0.1


@pytest.mark.parametrize("periods", [1.2, 3.0, 8.0])
def test_a_repeated_marking_is_refused_where_it_does_not(periods: float) -> None:
    period = 24.0
    pair = photos(Texture.stripes(period), LEVEL)
    off = np.array([0.45 * period, 0.0])
    found = match_points(*pair, sought(SOURCE, LEVEL, periods * period / REGION**0.5, off))
    # The largest region reaches beyond the photo.
    assert why(found) <= {RefusalReason.NOT_UNIQUE, RefusalReason.OUTSIDE}


def test_a_neighbour_that_happens_to_lie_on_a_step_is_not_the_better_for_it() -> None:
    # Sharp bars lose much of their likeness half a step beside their place.
    period = 24.5
    odd = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
    wave = np.concatenate([np.column_stack([odd, 0 * odd]), [[0.0, 1.0], [0.0, 2.0]]]) / period
    bars = Texture(wave, np.array([0.0, np.pi, 0.0, np.pi, 0.0, 1.0, 2.0]), 60.0)
    pair = photos(bars, LEVEL, noise=0.5)
    places = np.array([[105.0, 100.0], [130.0, 90.0], [151.0, 112.0]])
    on_step = np.array([period / 2 - 0.25, 0.0])  # the true place lies between, the next one not
    asked = sought(places, LEVEL, 18.0 / REGION**0.5, on_step)
    assert why(match_points(*pair, asked)) == {RefusalReason.NOT_UNIQUE}


def test_a_repetition_is_seen_in_the_source_where_the_target_hides_the_true_place() -> None:
    near, far = photos(Texture.stripes(24.0), LEVEL)
    point = truth(SOURCE[:1], LEVEL)[0]
    hidden, _ = photos(Texture.random(9), LEVEL)
    far = far.copy()
    u, v = np.round(point).astype(int)
    hide = np.ones(SHAPE, bool)
    hide[v - 16 : v + 17, u + 8 : u + 41] = False  # one repetition is left, not the true place
    far[hide] = hidden[hide]
    found = match_points(near, far, sought(SOURCE[:1], LEVEL, 30.0 / REGION**0.5))
    assert found.refused[0] == RefusalReason.NOT_UNIQUE


def test_so_it_is_where_the_next_one_lies_beyond_a_large_region() -> None:
    near, far = photos(Texture.random(5), LEVEL)
    hidden, _ = photos(Texture.random(9), LEVEL)
    near, far = near.copy(), far.copy()
    apart, reach, place = 92, 58.0, np.array([[80.0, 100.0]])
    # The source shows the same thing twice; the target the wrong one of both alone.
    thing = near[60:141, 40:121].copy()
    near[60:141, 40 + apart : 121 + apart] = thing
    u, v = np.round(truth(place, LEVEL)[0]).astype(int)
    shown = far[v - 32 : v + 33, u - 32 : u + 33].copy()
    far[v - 32 : v + 33, u + apart - 32 : u + apart + 33] = shown
    far[v - 34 : v + 35, u - 40 : u + 41] = hidden[v - 34 : v + 35, u - 40 : u + 41]
    found = match_points(near, far, sought(place, LEVEL, reach / REGION**0.5, [apart / 2, 0.0]))
    assert found.refused[0] == RefusalReason.NOT_UNIQUE


def test_what_is_not_there_is_not_found() -> None:
    near, _ = photos(Texture.random(1), LEVEL)
    _, far = photos(Texture.random(2), LEVEL)
    found = match_points(near, far, sought(SOURCE, LEVEL))
    assert why(found) <= {RefusalReason.NOT_LIKE, RefusalReason.NOT_UNIQUE}
    assert np.isnan(found.pixel_px).all()
    assert np.isnan(found.sigma_px).all()


def test_half_of_the_patch_hidden_moves_nothing() -> None:
    near, far = photos(Texture.random(6), LEVEL)
    hidden, _ = photos(Texture.random(9), LEVEL)
    far = far.copy()
    point = truth(SOURCE[:1], LEVEL)[0]
    edge = int(point[0]) + 4  # what hides begins beside the point
    far[:, edge:] = hidden[:, edge:]
    found = match_points(near, far, sought(SOURCE[:1], LEVEL))
    moved = found.pixel_px[0] - point
    assert found.refused[0] != RefusalReason.NONE or np.abs(moved).max() < 4 * found.sigma_px[0]


def test_an_even_picture_is_too_weak() -> None:
    even = np.full(SHAPE, 90, np.uint8)
    assert why(match_points(even, even, sought(SOURCE, LEVEL))) == {RefusalReason.WEAK}


def test_an_edge_tells_no_place_along_itself() -> None:
    edge = np.full(SHAPE, 60, np.uint8)
    edge[100:] = 180
    at = np.array([[130.0, 100.0]])
    found = match_points(edge, edge, sought(at, LEVEL, 2.0, -SHIFT))
    assert found.refused[0] in {RefusalReason.NOT_UNIQUE, RefusalReason.WEAK}


def test_a_weak_texture_is_found_by_smoothing() -> None:
    weak = Texture.random(8, contrast=12.0, finest=0.12)
    pair = photos(weak, LEVEL, noise=6.0)
    found = match_points(*pair, sought(SOURCE, LEVEL))
    some = found.refused == RefusalReason.NONE
    assert some.mean() > 0.6
    error = (found.pixel_px - truth(SOURCE, LEVEL))[some] / found.sigma_px[some, None]
    assert np.sqrt(np.mean(error**2)) < 1.6


def test_outside_and_too_far() -> None:
    near, far = photos(Texture.random(5), LEVEL)
    at = np.array([[2.0, 100.0], [130.0, 100.0], [130.0, 100.0]])
    one = sought(at, LEVEL)
    target = one.target_px + np.array([[0, 0], [400, 0], [0, 0]])
    covariance = one.covariance_px2 * np.array([1, 1, 1e5])[:, None, None]
    asked = SoughtPoints(
        source_px=at,
        target_px=target,
        covariance_px2=covariance,
        affine=one.affine,
        rise=one.rise,
        is_confirmed=one.is_confirmed,
    )
    found = match_points(near, far, asked)
    assert found.refused.tolist() == [
        RefusalReason.OUTSIDE,
        RefusalReason.OUTSIDE,
        RefusalReason.TOO_FAR,
    ]


def test_something_like_it_is_not_taken_where_the_point_is_likely_outside() -> None:
    texture = Texture.random(5)
    near, far = photos(texture, LEVEL)
    copy = far.copy()
    own = np.round(truth(SOURCE[:1], LEVEL)[0]).astype(int)
    copy[own[1] - 20 : own[1] + 21, 3:44] = far[
        own[1] - 20 : own[1] + 21, own[0] - 20 : own[0] + 21
    ]
    copy[:, 60:] = 255 - copy[:, 60:]
    asked = sought(SOURCE[:1], LEVEL, 10.0, np.array([8.0 - own[0], 0.0]))
    found = match_points(near, copy, asked)
    assert found.refused[0] == RefusalReason.OUTSIDE


def test_nothing_sought_is_nothing_found() -> None:
    near, far = photos(Texture.random(5), LEVEL)
    assert len(match_points(near, far, sought(np.empty((0, 2)), LEVEL))) == 0


def test_each_reason_has_words() -> None:
    assert set(REASON_TEXTS) == set(RefusalReason)


# Occlusions about a point: shifted windows, and quarters of its surroundings.


SIDE, HALF = 51, 10
ALONG = np.array([[0.0, 1.0]])
ONCE = np.zeros(1, dtype=np.bool_)  # clicked in one photo alone
NOISE = 2.5


def blot(rng: np.random.Generator) -> Grey:
    """A dark, nearly even spot on rough ground, as a manhole is."""
    grain = cv2.GaussianBlur(rng.normal(0.0, 40.0, (SIDE, SIDE)), (0, 0), 1.8)
    spot = np.zeros((SIDE, SIDE))
    cv2.circle(spot, (SIDE // 2, SIDE // 2), 7, 1.0, -1)
    inside = cv2.GaussianBlur(spot, (0, 0), 1.0)
    ground = 120.0 + grain * (1.0 - 0.4 * inside) - 20.0 * inside
    return np.asarray(cv2.GaussianBlur(ground, (0, 0), 0.8), np.float32)


def edge(rng: np.random.Generator) -> Grey:
    """An edge along the line of sight, both sides even: it may be anywhere."""
    beside = np.where(np.arange(SIDE) < SIDE // 2, 60.0, 150.0) + np.zeros((SIDE, 1))
    beside += rng.normal(0.0, 0.2, beside.shape)
    return np.asarray(cv2.GaussianBlur(beside, (0, 0), 0.8), np.float32)


def share_fixed(make: object, rng: np.random.Generator, count: int = 60) -> float:
    """Of pairs of noisy photos of one thing."""
    fixed = []
    for _ in range(count):
        ground = make(rng)  # type: ignore[operator]
        near, far = (
            (ground + rng.normal(0.0, NOISE, ground.shape)).astype(np.float32) for _ in range(2)
        )
        pair = near[None], far[None]
        there = fit_patches(*pair, np.zeros((1, 2)), np.eye(2)[None], HALF, 12)
        fixed.append(find_unoccluded(*pair, there, ALONG, ONCE)[0])
    return float(np.mean(fixed))


@pytest.mark.parametrize(("make", "least", "most"), [(blot, 0.8, 1.0), (edge, 0.0, 0.05)])
def test_noise_hides_no_side_and_an_edge_along_the_line_fixes_none(
    make: object, least: float, most: float
) -> None:
    assert least <= share_fixed(make, np.random.default_rng(5)) <= most


BESIDE_PX = 2
"""Distance of a click from the corner of a thing, on either axis."""


def test_ground_is_not_found_for_a_click_beside_a_corner_that_looks_like_it() -> None:
    rng = np.random.default_rng(6)
    fixed = []
    for _ in range(60):
        ground, roof = (
            cv2.GaussianBlur(rng.normal(120.0, 30.0, (SIDE, SIDE)), (0, 0), 1.5) for _ in range(2)
        )
        corner = SIDE // 2 + BESIDE_PX
        seen = ground.copy()
        seen[corner:, :-corner] = roof[corner:, :-corner]
        near, far = (
            (one + rng.normal(0.0, NOISE, ground.shape)).astype(np.float32)[None]
            for one in (seen, ground)
        )
        there = fit_patches(near, far, np.zeros((1, 2)), np.eye(2)[None], HALF, 12)
        fixed.append(find_unoccluded(near, far, there, ALONG, ONCE)[0])
    assert np.mean(fixed) < 0.3


@pytest.mark.parametrize(("thing", "least", "most"), [(True, 0.0, 0.6), (False, 0.9, 1.0)])
def test_weak_ground_at_a_click_is_not_recognised_where_a_thing_as_dark_hides_part_of_it(
    *, thing: bool, least: float, most: float
) -> None:
    """Ground in a thing's shadow, whose edge matches at once and hides what differs."""
    rng, middle, fixed = np.random.default_rng(7), SIDE // 2, []
    for _ in range(60):
        ground = 35.0 + cv2.GaussianBlur(rng.normal(0.0, 26.0, (SIDE, SIDE)), (0, 0), 1.5)
        ground[: middle - 4] += 60.0
        seen = ground.copy()
        if thing:
            seen[middle:, : middle + 1] = 33.0
        near, far = (
            (cv2.GaussianBlur(one, (0, 0), 0.8) + rng.normal(0.0, 1.0, one.shape)).astype(
                np.float32
            )[None]
            for one in (seen, ground)
        )
        there = fit_patches(near, far, np.zeros((1, 2)), np.eye(2)[None], HALF, 12)
        fixed.append(find_unoccluded(near, far, there, ALONG, ONCE)[0])
    assert least <= np.mean(fixed) <= most


OCCLUDED_SHAPE = (120, 140)
AT = np.array([66.0, 58.0])
TURN = np.array([[0.96, -0.28], [0.28, 0.96]])


def photo(affine: Floats, shift: Floats, seed: int, texture_seed: int = 5) -> Image:
    """Pixels of the texture at affine (pixel) + shift."""
    return Texture.random(texture_seed).photo(
        OCCLUDED_SHAPE, affine, shift, 1.5, np.random.default_rng(seed)
    )


def test_flat_ground_is_alike_all_around_also_in_a_turned_photo() -> None:
    source = photo(np.eye(2), np.zeros(2), 1)
    there = np.array([60.0, 63.0])
    target = photo(TURN.T, AT - TURN.T @ there, 2)

    assert compute_worst_quarter_correlation(source, target, AT, there, TURN) > 0.9


@pytest.mark.parametrize("quarter", range(4))
def test_another_thing_in_one_quarter_is_seen(quarter: int) -> None:
    source, target = (photo(np.eye(2), np.zeros(2), seed) for seed in (1, 2))
    other = photo(np.eye(2), np.zeros(2), 3, texture_seed=6)
    u, v = AT.astype(int)
    rows = slice(v - HALF_SQUARE, v) if quarter < 2 else slice(v + 1, v + HALF_SQUARE + 1)
    columns = slice(u - HALF_SQUARE, u) if quarter % 2 else slice(u + 1, u + HALF_SQUARE + 1)
    target[rows, columns] = other[rows, columns]

    assert compute_worst_quarter_correlation(source, target, AT, AT, np.eye(2)) < 0.5


def test_what_is_too_even_to_compare_is_not_alike() -> None:
    even = np.full(OCCLUDED_SHAPE, 90, np.uint8)

    assert compute_worst_quarter_correlation(even, even, AT, AT, np.eye(2)) == -1.0
