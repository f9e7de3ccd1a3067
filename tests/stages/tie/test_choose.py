"""Which tie points are kept: few in each photo, spread, long, and each pair of photos has some."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from uavgram.model.arrays import Floats, Ints
from uavgram.stages.tie.tracks import BESIDE, ENOUGH, MOST, NEAR, SHARED, Sighted, Tracks, choose

SIZE = 1000, 800


def sighted(point: Ints, photo: Ints, pixel: Floats, sigma: Floats | None = None) -> Sighted:
    return Sighted(
        tracks=Tracks(point, np.arange(len(point))),
        photo=photo,
        pixel_px=pixel,
        sigma_px=np.full(len(point), 0.1) if sigma is None else sigma,
        width_px=SIZE[0],
        height_px=SIZE[1],
    )


def many(points: int, photos: int, seed: int = 0) -> Sighted:
    """Points that each photo shows, at places of its own."""
    rng = np.random.default_rng(seed)
    return sighted(
        np.repeat(np.arange(points), photos),
        np.tile(np.arange(photos), points),
        rng.uniform(0.0, SIZE, (points * photos, 2)),
    )


def test_thousands_become_a_hundred_in_each_photo_spread_over_it() -> None:
    everything = many(3000, 3)

    kept = np.isin(everything.tracks.point, choose(everything))

    for photo in range(3):
        pixel = everything.pixel_px[kept & (everything.photo == photo)]
        assert ENOUGH <= len(pixel) <= MOST + 1
        quarters = Counter(map(tuple, (pixel // (500, 400)).astype(int).tolist()))
        assert len(quarters) == 4
        assert min(quarters.values()) >= 12


def test_long_ones_go_first_and_the_better_of_equally_long_ones() -> None:
    # all at one place of each photo: 0 is long, 1 and 2 are short and 2 is the better
    point = np.array([0, 0, 0, 1, 1, 2, 2])
    photo = np.array([0, 1, 2, 0, 1, 3, 4])
    near = sighted(point, photo, np.full((7, 2), 500.0))
    other = sighted(
        np.array([0, 0, 1, 1]),
        np.array([0, 1, 0, 1]),
        np.full((4, 2), 500.0),
        np.array([0.3, 0.3, 0.1, 0.1]),
    )

    assert choose(near).tolist() == [0, 2]
    assert choose(other).tolist() == [1]


def test_a_pair_with_little_in_common_gets_more() -> None:
    # photos 0 and 1 share a corner of theirs, and have everything with 2 and 3 else
    rng = np.random.default_rng(3)
    full = many(400, 2)
    corner = rng.uniform(0.0, 90.0, (40 * 2, 2))
    point = np.concatenate([full.tracks.point, 400 + np.repeat(np.arange(40), 2)])
    photo = np.concatenate([2 * full.photo, np.tile([0, 1], 40)])

    kept = choose(sighted(point, photo, np.vstack([full.pixel_px, corner])))

    assert (kept >= 400).sum() >= SHARED


def test_nothing_is_chosen_of_nothing() -> None:
    empty = np.empty(0, np.int64)

    assert len(choose(sighted(empty, empty, np.empty((0, 2))))) == 0


def test_around_picks_more_are_kept_that_several_photos_show() -> None:
    rng = np.random.default_rng(3)
    place = rng.uniform(0.0, SIZE, (3000, 2))
    long = np.arange(3000) % 4 > 0  # the others are seen twice, and nearer to the picks
    seen = np.repeat(np.arange(3000), np.where(long, 3, 2))
    photo = np.concatenate([np.arange(3 if three else 2) for three in long])
    picked = np.array([[300.0, 200.0], [700.0, 600.0], [10.0, 790.0]])
    place[::150] = picked[0] + rng.uniform(-9.0, 9.0, (20, 2))
    everything = sighted(seen, photo, place[seen])
    asked = replace(everything, picked_photo=np.array([0, 0, 2]), picked_px=picked)

    before, after = (set(choose(each).tolist()) for each in (everything, asked))

    assert before < after
    added = np.array(sorted(after - before))
    away = np.linalg.norm(place[added][:, None] - picked, axis=2).min(axis=1)
    assert away.max() <= NEAR * SIZE[0]
    assert long[added].all()
    for one in picked[:2]:
        near = [k for k in after if np.linalg.norm(place[k] - one) <= NEAR * SIZE[0] and long[k]]
        assert len(near) >= BESIDE
