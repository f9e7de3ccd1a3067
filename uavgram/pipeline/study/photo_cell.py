"""A cell of a study that is one photo: predicted, then drawn and adjusted thousands of times."""

from __future__ import annotations

from dataclasses import dataclass
from zlib import crc32

import numpy as np

from uavgram.estimation.repeated.predicted_lengths import predict_lengths
from uavgram.estimation.repeated.single_photo import adjust_photos
from uavgram.model.arrays import Floats
from uavgram.model.study.scene import StudyScene
from uavgram.model.study.study import Cell
from uavgram.pipeline.study.photo_scene import draw, exact_draw, photo_of
from uavgram.pipeline.threads import one_blas_thread


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where a cell stands in its study: curve, value on the axis and its words, and the scene."""

    curve: str
    at: float
    label: str
    scene: StudyScene


def photo_cell(place: Place, repetitions: int) -> Cell:
    """Predict and simulate.

    Parameters
    ----------
    place
        Which cell.
    repetitions
        How many draws.
    """
    scene = place.scene
    with one_blas_thread():
        photo = photo_of(scene)
        expected = predict_lengths(photo.design, exact_draw(photo), photo.place_m, photo.pairs)
        rng = np.random.default_rng([19, crc32(repr(scene).encode())])
        draws, true = draw(photo, repetitions, rng)
        found = adjust_photos(photo.design, draws, (photo.center, photo.rotation))
    ends = found.place_m[:, photo.pairs]
    error = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2) - true
    good = found.converged & np.isfinite(error).all(axis=1)
    error = error[good]
    low, middle, high = ratio_of(error / expected.error_m)
    total = expected.variance.sum()
    return Cell(
        curve=place.curve,
        at=place.at,
        label=place.label,
        predicted_m=float(np.sqrt(np.mean(expected.error_m**2))),
        simulated_m=float(np.sqrt(np.mean(error**2))),
        ratio=middle,
        ratio_range=(low, high),
        bias_m=float(np.sqrt(np.mean(error.mean(axis=0) ** 2))),
        shares=tuple(float(part.sum() / total) for part in expected.parts),
        repetitions=repetitions,
        lost=int((~good).sum()),
    )


def ratio_of(z: Floats) -> tuple[float, float, float]:
    """Root mean square of (B, M), whose rows are independent, and its range of 95 %."""
    each = np.mean(z**2, axis=1)
    middle, half = float(each.mean()), 1.96 * float(each.std(ddof=1)) / np.sqrt(len(each))
    return (
        float(np.sqrt(max(middle - half, 0.0))),
        float(np.sqrt(middle)),
        float(np.sqrt(middle + half)),
    )
