"""Coded plates in rendered photos: found, measured as well as their sigmas say, or left out."""

from __future__ import annotations

import numpy as np
import pytest
from plate_pictures import photo_of, plate_samples, quad, shadowed
from scipy.stats import chi2

from uavgram.imaging.targets.plate_fit import Window, fit_plate, fit_with_shadows, render_plate
from uavgram.imaging.targets.plates import count_plates, detect_plates, read_cells
from uavgram.model.arrays import Floats
from uavgram.model.naming import FAMILIES
from uavgram.model.observations import RejectedPlate

ARUCO = "aruco-4x4-50"
SHAPE = (48, 48)


def test_every_family_has_a_black_border_and_white_cells_inside() -> None:
    for family in FAMILIES:
        cells = read_cells(family, count_plates(family) - 1)
        assert not cells[[0, -1]].any()
        assert not cells[:, [0, -1]].any()
        assert cells.any()


def test_the_picture_is_that_of_many_samples() -> None:
    corner = quad((23.3, 24.1), 19.0, 31.0, 0.8)
    cells = read_cells(ARUCO, 7)
    drawn = render_plate(cells, corner, 0.7, Window(0, 0, 48, 48)).share
    samples = plate_samples(cells, corner, SHAPE, margin=50.0)
    photo = photo_of(samples, np.random.default_rng(0), noise=0.0)
    off = np.abs(22.0 + 203.0 * drawn - photo)[8:-8, 8:-8]
    assert off.max() < 0.01 * 203.0 + 0.5  # rounding to whole grey values


def test_derivatives_are_central_differences() -> None:
    corner = quad((23.3, 24.1), 19.0, 31.0, 0.8)
    cells, window, step = read_cells(ARUCO, 7), Window(0, 0, 48, 48), 1e-3
    picture = render_plate(cells, corner, 0.7, window)
    for k in range(6):
        move = np.zeros(8)
        move[k] = step
        ahead, behind = (
            render_plate(cells, corner + sign * move.reshape(4, 2), 0.7, window).share
            for sign in (1, -1)
        )
        difference = (ahead - behind) / (2 * step)
        # the gradient is that of halves of pixels: some per cent where the picture bends most
        assert (
            np.abs(picture.by_corner[..., k] - difference).max() < 0.08 * np.abs(difference).max()
        )


@pytest.mark.statistical
def test_corners_are_as_good_as_their_sigmas_say() -> None:
    rng = np.random.default_rng(16)
    errors, sigmas = [], []
    for trial in range(8):
        family = (ARUCO, "apriltag-25h9")[trial % 2]
        side = rng.uniform(20.0, 26.0) * (1.0 if trial % 2 == 0 else 1.2)
        center = 28 + rng.uniform(-1, 1), 28 + rng.uniform(-1, 1)
        corner = quad(center, side, rng.uniform(0, 360), 0.85)
        plate = int(rng.integers(count_plates(family)))
        photo = photo_of(
            plate_samples(read_cells(family, plate), corner, (56, 56)), rng, noise=6.0, quality=85
        )
        (seen,) = detect_plates(photo, family)
        assert (seen.plate, seen.left_out) == (plate, RejectedPlate.NO)
        errors.append(seen.corner_px - corner)
        sigmas.append(seen.sigma_px)
    error, sigma = np.array(errors), np.array(sigmas)[..., None]
    assert np.sqrt((error**2).mean()) < 0.06
    count = error.size
    z2 = float(((error / sigma) ** 2).sum())
    assert z2 < chi2.ppf(0.9999, count)
    assert z2 > count / 9  # they hold besides what a plate does that is not quite flat


def test_a_shadow_across_a_plate_is_fitted() -> None:
    rng = np.random.default_rng(3)
    window = Window(0, 0, 48, 48)
    for angle, away in ((20.0, 1.0), (140.0, 4.0)):
        corner = quad((24.2, 23.7), 20.0, 33.0)
        samples = shadowed(plate_samples(read_cells(ARUCO, 3), corner, SHAPE), angle, away)
        photo = photo_of(samples, rng).astype(np.float64)
        start = corner + rng.uniform(-0.7, 0.7, (4, 2))
        plain = fit_plate(photo, window, read_cells(ARUCO, 3), start)
        fitted = fit_with_shadows(photo, window, read_cells(ARUCO, 3), start)
        assert fitted is not None
        assert len(fitted.edges) == 1
        assert np.abs(fitted.corner_px - corner).max() < 0.1
        assert plain is None or np.abs(plain.corner_px - corner).max() > 0.2  # or it needs none


def test_texture_is_no_plate() -> None:
    rng = np.random.default_rng(5)
    grey = np.asarray(128 + 60 * np.sign(np.kron(rng.standard_normal((40, 40)), np.ones((4, 4)))))
    assert detect_plates(np.clip(grey, 0, 255).astype(np.uint8), ARUCO) == ()


def test_a_plate_with_another_cell_is_no_plate() -> None:
    cells = np.array(read_cells(ARUCO, 7))
    row, column = np.argwhere(cells)[0]
    cells[row, column] = False  # OpenCV corrects one bit of this dictionary
    photo = photo_of(
        plate_samples(cells, quad((24, 24), 22.0, 10.0), SHAPE), np.random.default_rng(1)
    )
    assert detect_plates(photo, ARUCO) == ()


def test_one_number_twice_in_a_photo_is_told() -> None:
    cells = read_cells(ARUCO, 9)
    one, other = (plate_samples(cells, quad((24, 24), 20.0, turn), SHAPE) for turn in (5.0, 40.0))
    photo = photo_of(np.hstack([one, other]), np.random.default_rng(2))
    assert [seen.left_out for seen in detect_plates(photo, ARUCO)] == [
        RejectedPlate.TWICE,
        RejectedPlate.TWICE,
    ]


def test_a_large_plate_is_measured_as_well() -> None:
    corner: Floats = quad((80.3, 79.6), 110.0, 12.0, 0.9)
    samples = plate_samples(read_cells(ARUCO, 2), corner, (160, 160))
    (seen,) = detect_plates(photo_of(samples, np.random.default_rng(4)), ARUCO)
    assert np.abs(seen.corner_px - corner).max() < 0.1
    assert np.abs(seen.corner_px - corner).max() < 4 * seen.sigma_px.max()
