"""Find tie points: features of every photo, compared pair by pair, verified, joined."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.projection import back_project
from uavgram.imaging.ties import (
    MIN_MATCHES,
    WORKING_PX,
    Features,
    Guide,
    compute_photo_similarity,
    match_features,
    read_features,
    verify_matches,
)
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.frames import Poses
from uavgram.model.survey import TiePicks
from uavgram.pipeline.parallel import Progress, prefetch, silent
from uavgram.stages import tie

DECIMALS = 3
"""Decimals of pixels in the table."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Inputs of the search for tie points.

    Attributes
    ----------
    frame_id, path
        (N,) names and files of the photos.
    calibration
        Calibration of the camera.
    poses
        Poses of photos with one, by their names; None where all are unknown.
    picked_image, picked_px
        (K,), (K, 2) picks by people: around them the height of the ground will be needed.
    ground_m, ground_sigma_m
        Height of the ground in the world of the poses, and its standard deviation.
    """

    frame_id: tuple[str, ...]
    path: tuple[str, ...]
    calibration: Calibration
    poses: Poses | None
    picked_image: tuple[str, ...] = ()
    picked_px: Floats = field(default_factory=lambda: np.empty((0, 2)))
    ground_m: float = 0.0
    ground_sigma_m: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class TieSearch:
    """Tie points, and their pairs of photos.

    Attributes
    ----------
    ties
        The kept sightings.
    compared, matched
        (P, 2), (Q, 2) pairs of photos that were compared, and those with matches.
    """

    ties: TiePicks
    compared: Ints
    matched: Ints


def find_ties(scene: Scene, progress: Progress = silent) -> TieSearch:
    """Find the tie points of a project's photos.

    Parameters
    ----------
    scene
        The photos, and prior information.
    progress
        Shows long loops.

    Raises
    ------
    InputError
        A photo cannot be read.
    """
    read = progress(prefetch(read_features, scene.path), "looking at photos", len(scene.path))
    features = [found for _, found in read]
    pairs, seen = _pairs(scene, features)
    work = PairComparison(scene.calibration, features, seen)
    compared = prefetch(work.compare, pairs.tolist())
    matched = [found for _, found in progress(compared, "comparing photos", len(pairs))]
    return _join(scene, features, pairs, matched)


class _Seeds(NamedTuple):
    """Photos with a usable pose, and the row of each photo among them (-1: none)."""

    seen: tie.Seen
    row: Ints


def _pairs(scene: Scene, features: Sequence[Features]) -> tuple[Ints, _Seeds | None]:
    """Choose pairs of photos to compare, and return the poses for predictions."""
    count = len(scene.frame_id)
    chosen = np.zeros((count, count), np.bool_)
    seeds = _seeds(scene)
    if seeds is not None:
        photo = np.flatnonzero(seeds.row >= 0)
        share = tie.compute_overlap(seeds.seen)[np.ix_(seeds.row[photo], seeds.row[photo])]
        one, other = photo[tie.choose_pairs(share, tie.LEAST_SHARE)].T
        chosen[one, other] = True
    unknown = range(count) if seeds is None else np.flatnonzero(seeds.row < 0).tolist()
    if len(unknown):
        one, other = tie.choose_pairs(
            compute_photo_similarity(features, unknown), MIN_MATCHES / 2
        ).T
        chosen[one, other] = True
    return np.argwhere(chosen), seeds


def _seeds(scene: Scene) -> _Seeds | None:
    if scene.poses is None:
        return None
    everything = tie.Seen(
        calibration=scene.calibration,
        poses=scene.poses,
        ground_m=scene.ground_m,
        ground_sigma_m=scene.ground_sigma_m,
    )
    at = {
        name: k
        for k, name in enumerate(scene.poses.frame_id)
        if name in scene.frame_id and not everything.is_vague[k]
    }
    row = np.array([at.get(name, -1) for name in scene.frame_id], dtype=np.int64)
    return _Seeds(everything, row) if (row >= 0).any() else None


class VerifiedMatches(NamedTuple):
    """Verified matches (M, 2) of two photos, as rows of theirs, and the distance (M,) of each."""

    rows: Ints
    across_px: Floats


class PairComparison:
    """Comparison of two photos: guided by predictions from seeds, or else by appearance only."""

    def __init__(
        self, calibration: Calibration, features: Sequence[Features], seeds: _Seeds | None
    ) -> None:
        self._calibration, self._features, self._seeds = calibration, features, seeds
        lens = calibration.model, calibration.parameters
        self._rays = [back_project(*lens, found.pixel_px) for found in features]
        self._scale = scale_of(calibration)

    def compare(self, pair: tuple[int, int]) -> VerifiedMatches:
        """Return matches of two photos, by their rows."""
        one, other = pair
        guide = self._predict(one, other)
        found = self._verify(one, other, guide)
        if guide is None:
            # an unguided comparison has a few matches by chance
            return (
                found
                if len(found.rows) >= 2 * MIN_MATCHES
                else VerifiedMatches(found.rows[:0], np.empty(0))
            )
        if len(found.rows) < 2 * MIN_MATCHES:
            # the seeds may be worse than stated
            free = self._verify(one, other, None)
            found = free if len(free.rows) > 2 * MIN_MATCHES else found
        return found

    def _predict(self, one: int, other: int) -> Guide | None:
        if self._seeds is None or min(rows := self._seeds.row[[one, other]].tolist()) < 0:
            return None
        predicted = tie.predict(self._seeds.seen, rows[0], rows[1], self._features[one].pixel_px)
        return None if predicted is None else Guide(predicted.pixel_px, predicted.radius_px)

    def _verify(self, one: int, other: int, guide: Guide | None) -> VerifiedMatches:
        rows = match_features(self._features[one], self._features[other], guide)
        rays = self._rays[one][rows[:, 0]], self._rays[other][rows[:, 1]]
        tested = verify_matches(*rays, float(self._calibration.parameters[0]), self._scale)
        return VerifiedMatches(rows[tested.good], tested.across_px[tested.good])


def scale_of(calibration: Calibration) -> float:
    """Return the pixels of a photo per pixel of the picture in which features are sought."""
    return max(1.0, max(calibration.width_px, calibration.height_px) / WORKING_PX)


def _join(
    scene: Scene, features: Sequence[Features], pairs: Ints, matched: Sequence[VerifiedMatches]
) -> TieSearch:
    """Join matches to points over all photos, and thin them out."""
    counts = [len(found.pixel_px) for found in features]
    first = np.cumsum([0, *counts])
    photo = np.repeat(np.arange(len(features)), counts)
    pixel = np.concatenate([found.pixel_px for found in features])
    scale = scale_of(scene.calibration)
    relative = tie.compute_relative_noise(
        np.concatenate([found.size_px for found in features]), scale
    )
    matches = tie.Matches(
        np.concatenate(
            [np.empty((0, 2), np.int64)]
            + [found.rows + first[pair] for pair, found in zip(pairs, matched, strict=True)]
        ),
        np.repeat(np.arange(len(pairs)), [len(found.rows) for found in matched]),
        np.concatenate([np.empty(0), *(found.across_px for found in matched)]),
    )
    # Remove outliers, estimate sigmas, and join matches to tracks.
    matches = matches.take(np.flatnonzero(tie.mark_fitting_matches(matches, relative, len(pairs))))
    sigma = tie.estimate_sigmas(matches, relative, len(pairs), scale)
    tracks = tie.join_tracks(matches, photo)
    row = {name: k for k, name in enumerate(scene.frame_id)}
    picked = [k for k, name in enumerate(scene.picked_image) if name in row]
    # Keep a part of the points, evenly spread over the photos.
    kept = tie.choose(
        tie.Sighted(
            tracks=tracks,
            photo=photo[tracks.feature],
            pixel_px=pixel[tracks.feature],
            sigma_px=sigma[tracks.feature],
            width_px=scene.calibration.width_px,
            height_px=scene.calibration.height_px,
            picked_photo=np.array([row[scene.picked_image[k]] for k in picked], dtype=np.int64),
            picked_px=scene.picked_px[picked],
        )
    )
    rows = np.flatnonzero(np.isin(tracks.point, kept))
    feature = tracks.feature[rows]
    ties = TiePicks(
        image=tuple(scene.frame_id[k] for k in photo[feature]),
        tie=tuple(_names(tracks.point[rows])),
        pixel_px=pixel[feature].round(DECIMALS),
        sigma_px=sigma[feature].round(DECIMALS),
    )
    return TieSearch(ties=ties, compared=pairs, matched=pairs[[len(m.rows) > 0 for m in matched]])


def _names(point: Ints) -> Iterator[str]:
    """Yield names of points, counted from 1."""
    number = np.unique(point, return_inverse=True)[1]
    return (f"tie{k + 1}" for k in number)
