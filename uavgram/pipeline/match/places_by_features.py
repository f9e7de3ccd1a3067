"""Predicted places of picks in photos without a good pose, by features that both photos show.

Without a log, nothing but the photos themselves relates one that has no picks to the others, and a
receiver's metres are hundreds of pixels. The features near a pick move from photo to photo as the
ground there does: an affine map of them predicts the pick's place, and their residuals from it give
its error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from uavgram.errors import InputError
from uavgram.estimation.measuring.predicted_pixels import TransferredPixels
from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.ties import Features, read_features
from uavgram.model.arrays import Floats
from uavgram.model.observations import Picks
from uavgram.model.work import report_work
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.pipeline.ties import PairComparison, scale_of
from uavgram.stages.match import MAX_RADIUS_PX, Candidates, Pair, compute_radii

NEIGHBOURS = 24
"""Number of features about a pick from which its place is predicted: four for each unknown of the
affine map, and few enough to be of the ground nearby."""

NEARBY = 8
"""Number of photos that a photo is compared with, the nearest in the list first: these were mostly
taken near it. Comparing one takes about a second of computing."""

KEPT_BYTES = 100_000_000
"""Memory for the features of photos: of 250 photos."""

_PARAMETERS = 3  # of the affine map, for each coordinate


class LocalMap(NamedTuple):
    """Place of a pick in another photo.

    Attributes
    ----------
    pixel_px, covariance_px2
        (2,), (2, 2) predicted pixel and its covariance.
    affine
        (2, 2) d pixel there / d pixel here.
    """

    pixel_px: Floats
    covariance_px2: Floats
    affine: Floats


def fit_local_map(here_px: Floats, there_px: Floats, pixel_px: Floats) -> LocalMap:
    """Fit an affine map to the features nearest to a pixel, and map that pixel.

    Parameters
    ----------
    here_px, there_px
        (n, 2), (n, 2) matched features in its photo and in the other one, n > 3.
    pixel_px
        (2,) the pixel.
    """
    away = np.linalg.norm(here_px - pixel_px, axis=1)
    near = np.argsort(away, kind="stable")[:NEIGHBOURS]
    design = np.column_stack([np.ones(len(near)), here_px[near] - pixel_px])
    found, _, rank, _ = np.linalg.lstsq(design, there_px[near], rcond=None)
    residual = there_px[near] - design @ found
    degrees = max(residual.size - 2 * _PARAMETERS, 1)
    variance = float((residual**2).sum()) / degrees if rank == _PARAMETERS else np.inf
    # The pick departs from the map as the features do; the map itself is less certain beside them.
    leverage = float(np.linalg.pinv(design.T @ design)[0, 0])
    covariance = variance * (1.0 + leverage) * np.eye(2)
    return LocalMap(found[0], covariance, np.asarray(found[1:].T, np.float64))


class FeaturePlaces:
    """Predictions by the features of a project's photos, each detected and compared once.

    Parameters
    ----------
    inputs
        The project.
    """

    def __init__(self, inputs: Inputs) -> None:
        self._calibration = inputs.calibration
        photos = inputs.photos
        self._names = photos.frame_id
        self._paths = dict(zip(photos.frame_id, photos.path, strict=True))
        self._features: LruCache[str, Features] = LruCache(
            lambda name: read_features(self._paths[name]), _size_bytes, KEPT_BYTES
        )
        self._matched: dict[tuple[str, str], tuple[Floats, Floats]] = {}

    def predict(self, picks: Picks, is_wanted: Callable[[Pair], bool]) -> Iterator[Candidates]:
        """Predict picks of the ground in nearby photos, photo by photo.

        Parameters
        ----------
        picks
            Present picks.
        is_wanted
            Returns whether the place of a label in a photo is to be predicted.
        """
        by_hand: dict[str, list[int]] = {}
        on_ground = ~picks.is_free & (np.nan_to_num(picks.height_m) == 0.0)
        for i in np.flatnonzero(on_ground & ~picks.of_source("match")).tolist():
            by_hand.setdefault(picks.image[i], []).append(i)
        there = set(zip(picks.image, picks.label, strict=True))
        for source, rows in by_hand.items():
            for target in self._nearby(source):
                pairs = [(target, picks.label[i]) for i in rows]
                new = [
                    i
                    for i, pair in zip(rows, pairs, strict=True)
                    if pair not in there and is_wanted(pair)
                ]
                report_work("compare the photos")
                if new:
                    yield self._predict(source, target, picks, new)

    def _nearby(self, source: str) -> list[str]:
        """List the photos nearest to a photo in the list."""
        own = self._names.index(source)
        order = sorted(range(len(self._names)), key=lambda k: abs(k - own))
        return [self._names[k] for k in order[1 : NEARBY + 1]]

    @limit_blas_threads
    def _predict(self, source: str, target: str, picks: Picks, rows: list[int]) -> Candidates:
        """Predict picks of one photo in another; those without certain features are left out."""
        here, there = self._compare(source, target)
        calibration = self._calibration
        far = MAX_RADIUS_PX * scale_of(calibration)
        maps: dict[int, LocalMap] = {}
        if len(here):
            maps = {i: fit_local_map(here, there, picks.pixel_px[i]) for i in rows}
            maps = {
                i: one
                for i, one in maps.items()
                if compute_radii(one.covariance_px2[None])[0] <= far
                and calibration.is_in_photo(one.pixel_px)
            }
        taken, n = list(maps), len(maps)
        found = TransferredPixels(
            click=np.arange(n),
            frame_id=(target,) * n,
            pixel_px=np.array([one.pixel_px for one in maps.values()]).reshape(n, 2),
            covariance_px2=np.array([one.covariance_px2 for one in maps.values()]).reshape(n, 2, 2),
            affine=np.array([one.affine for one in maps.values()]).reshape(n, 2, 2),
            rise=np.zeros((n, 2)),
            jacobian=np.empty((n, 2, 0)),
            columns=np.empty((n, 0), np.int64),
            own=np.zeros((n, 2, 6)),
        )
        pairs, none = tuple((target, picks.label[i]) for i in taken), np.zeros(n, np.bool_)
        return Candidates(found, pairs, np.array(taken, dtype=np.int64), none, none)

    def _compare(self, source: str, target: str) -> tuple[Floats, Floats]:
        """Return the verified matches (n, 2), (n, 2) of two photos; none if one is unreadable."""
        if (source, target) not in self._matched:
            try:
                both = self._features.get(source), self._features.get(target)
            except InputError:  # reported where the photo is shown
                return np.empty((0, 2)), np.empty((0, 2))
            found = PairComparison(self._calibration, both, None).compare((0, 1))
            one, other = (both[k].pixel_px[found.rows[:, k]] for k in (0, 1))
            self._matched[source, target] = one, other
        return self._matched[source, target]


def _size_bytes(features: Features) -> int:
    return features.pixel_px.nbytes + features.size_px.nbytes + features.descriptor.nbytes
