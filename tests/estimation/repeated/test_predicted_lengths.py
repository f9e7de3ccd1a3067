"""Predicted accuracy of lengths, to first and second order, against moved observations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uavgram.estimation.repeated.single_photo import (
    add_errors,
    adjust_photos,
    compute_slopes,
    predict_lengths,
)
from uavgram.synthetic.single_photos import (
    StudyCell,
    StudyPhoto,
    StudyScene,
    make_photo,
    simulate_cell,
)

EVERYTHING = StudyScene(focal_share=0.01, centre_px=30.0, tape_scale=2e-3, tilt_deg=30.0)
SMALL = 1e-3
NO_LOG_SIGMA = np.array([100.0, 100.0, 1000.0, 10.0, 10.0, 10.0])
"""Of the pose [m, rad]: so weak that it moves no length."""


def lengths(photo: StudyPhoto, moved: np.ndarray) -> np.ndarray:
    draws = add_errors(photo.shared, photo.exact, moved)
    found = adjust_photos(photo.shared, draws, (photo.exact.center[0], photo.exact.rotation[0]))
    assert found.converged.all()
    ends = found.place_m[:, np.concatenate([photo.exact.line[0], photo.pairs])]
    return np.asarray(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2))


@pytest.mark.parametrize("has_log", [True, False])
def test_slopes_are_what_each_error_does(*, has_log: bool) -> None:
    photo = make_photo(EVERYTHING)
    if not has_log:
        information = np.diag(NO_LOG_SIGMA**-2)[None]
        photo = replace(
            photo,
            shared=photo.shared._replace(ground_root=np.zeros((3, 0))),
            exact=photo.exact._replace(information=information),
        )
    slopes = compute_slopes(photo.shared, photo.exact, photo.pairs)
    size = slopes.by_error.shape[1]
    known = photo.exact.line.shape[1] + 2 * len(photo.place_m)
    errors = np.arange(size)
    if not has_log:  # where the pose is free, its priors hold it, and are no observation
        errors = np.r_[:known, known + 6 : size]
    step = SMALL * np.eye(size)[errors]
    ends = lengths(photo, np.concatenate([step, -step]))
    ahead, behind = np.split(ends, 2)
    found = (ahead - behind).T / (2 * SMALL)
    # A known length is read, and the tape's scale is no error of the length itself.
    measured = slice(photo.exact.line.shape[1], None)
    expected = slopes.by_error[measured][:, errors]
    scale = np.sqrt(slopes.variance)[:, None]
    assert found[measured] / scale == pytest.approx(expected / scale, abs=1e-5)


def test_few_lengths_are_predicted_to_second_order() -> None:
    """Errors there are larger than first-order sigmas by more than 5 %."""
    scene = StudyScene(lines=2)
    photo = make_photo(scene)
    found = predict_lengths(photo.shared, photo.exact, photo.pairs)
    ratio = np.sqrt(np.mean(found.error_m**2 / found.variance))
    assert ratio > 1.06
    cell = simulate_cell(StudyCell(curve="", at=0.0, label="", scene=scene), 1500)
    assert cell.ratio == pytest.approx(1.0, abs=0.04)
    assert cell.lost < 0.03 * cell.repetitions
