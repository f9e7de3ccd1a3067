"""Picks and taped lengths of a synthetic survey, with their errors, where a photo shows them."""

from __future__ import annotations

from typing import Any

import numpy as np

from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import Calibration
from uavgram.model.naming import MIN_SIDE_PX, PLATE_CORNERS
from uavgram.model.observations import KnownLines, KnownPoints, Picks
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.truth import Surface, SurveyTruth, project_rolling_shutter

EDGE_PX = 12.0
"""Distance from the photo's edge within which marks are not picked."""

MIN_SINE_BELOW_HORIZON = 0.05
"""Smallest sine of the angle below the horizon at which measuring is possible: 3 degrees."""


def is_inside(camera: Calibration, pixel_px: Floats, room_px: Floats | float = 0.0) -> Bools:
    """Return a mask of pixels (..., 2) that are at least `EDGE_PX` inside a photo's edge.

    Parameters
    ----------
    camera
        Camera of the photos.
    pixel_px
        NaN for points that are not visible.
    room_px
        (..., 2) additional distance from the edge.
    """
    return camera.is_in_photo(pixel_px, -(EDGE_PX + 0.5 + room_px))


def find_large_plates(corner_px: Floats) -> Bools:
    """Return a mask of corners (F, 4N) of plates that are large enough in a photo to be found.

    `corner_px` is (F, 4N, 2), plate by plate.
    """
    corner = corner_px.reshape(len(corner_px), -1, PLATE_CORNERS, 2)
    side = np.linalg.norm(np.roll(corner, -1, axis=2) - corner, axis=-1)
    with np.errstate(invalid="ignore"):
        return np.repeat(side.min(axis=2) >= MIN_SIDE_PX, PLATE_CORNERS, axis=1)


def compute_corner_rays(camera: Calibration, intrinsics: Floats, rotation: Floats) -> Floats:
    """Return unit vectors (F, 4, 3) in the world of a photo's corners.

    Parameters
    ----------
    camera, intrinsics
        Size and lens model; its parameters.
    rotation
        (F, 3, 3) of the camera in the world.
    """
    w, h = camera.width_px - 1.0, camera.height_px - 1.0
    corner = np.array([[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]])
    ray = back_project(camera.model, intrinsics, corner)
    ray = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    return np.asarray(np.einsum("fij,kj->fki", rotation, ray))


def shows_horizon(ray: Floats, slope: Floats) -> Bools:
    """Return a mask of photos (F,) with a corner that looks along the ground, or upwards.

    Parameters
    ----------
    ray
        (F, 4, 3) of the corners, in the world; NaN beyond the lens model.
    slope
        (2,) of the ground to the east and to the north.
    """
    above = ray @ [*-slope, 1.0]
    return np.asarray((np.isnan(above) | (above > -MIN_SINE_BELOW_HORIZON)).any(axis=1))


class MeanGenerator(np.random.Generator):
    """Generator that returns means instead of draws, for the methods used by a simulated survey."""

    def __init__(self) -> None:
        super().__init__(np.random.PCG64(0))

    def standard_normal(self, size: Any = None, *_: Any, **__: Any) -> Any:  # noqa: ANN401
        """Return zeros."""
        return 0.0 if size is None else np.zeros(size)

    def uniform(self, low: Any = 0.0, high: Any = 1.0, size: Any = None) -> Any:  # noqa: ANN401
        """Return the middle of the range.

        Parameters
        ----------
        low, high, size
            As of numpy's.
        """
        middle = 0.5 * (low + high)
        return middle if size is None else np.full(size, middle)

    def random(self, size: Any = None, *_: Any, **__: Any) -> Any:  # noqa: ANN401
        """Return ones: an event with a smaller probability never occurs."""
        return 1.0 if size is None else np.ones(size)

    def multivariate_normal(self, mean: Any, *_: Any, **__: Any) -> Floats:  # noqa: ANN401
        """Return the mean."""
        return np.array(mean, dtype=np.float64)


TAIL_FACTOR = 5.0  # factor of the errors of picks in the heavy tail


def compute_pixels(
    scenario: Scenario,
    calibration: Calibration,
    truth: SurveyTruth,
    surface: Surface,
    rng: np.random.Generator,
) -> Floats:
    """Compute the pixels of the points that people pick in each photo, (F, K, 2) px.

    Parameters
    ----------
    scenario, calibration, truth
        Of the survey.
    surface
        The ground, on which the picked point is displaced.
    rng
        Draws the displacements.
    """
    errors = scenario.errors
    places = np.repeat(truth.point_world_m[None], len(truth.frame_id), axis=0)
    if errors.identification_m:
        offset = places[..., :2] - surface.middle_m
        by_person = np.arange(offset.shape[1]) < len(scenario.points)
        size = errors.identification_m * by_person[:, None]
        moved = offset + size * rng.standard_normal(offset.shape)
        rise = surface.up(moved.reshape(-1, 2)) - surface.up(offset.reshape(-1, 2))
        up = places[..., 2] + rise.reshape(offset.shape[:2])
        places = np.concatenate([moved + surface.middle_m, up[..., None]], axis=2)
    return project_rolling_shutter(calibration, truth, places)


def draw_picks(
    scenario: Scenario,
    calibration: Calibration,
    truth: SurveyTruth,
    pixel_px: Floats,
    rngs: tuple[np.random.Generator, np.random.Generator],
) -> Picks:
    """Draw the picks of all complete marks in a photo, and of the corners of complete plates.

    Parameters
    ----------
    scenario, calibration, truth
        Of the survey.
    pixel_px
        (F, K, 2) true pixels of the marks.
    rngs
        Draw the noise, and the picks in the heavy tail.
    """
    habits, corners = scenario.habits, len(scenario.plates.labels)
    sigmas = np.repeat(
        [scenario.errors.pick_px, scenario.plates.corner_px], _count_corners(scenario)
    )
    shown, people = is_inside(calibration, pixel_px), len(scenario.points)
    # corners of a plate are found together, if all are inside the photo and it is large enough
    whole = shown[:, people:].reshape(len(shown), -1, PLATE_CORNERS).all(axis=2)
    shown[:, people:] = np.repeat(whole, PLATE_CORNERS, axis=1) & find_large_plates(
        pixel_px[:, people:]
    )
    frame, point = np.nonzero(shown)
    sigma = sigmas[point]
    # normal noise, with a share of picks in the heavy tail
    noise = sigma[:, None] * rngs[0].standard_normal((len(frame), 2))
    if habits.heavy_tails:
        noise *= np.where(rngs[1].random((len(frame), 1)) < habits.heavy_tails, TAIL_FACTOR, 1.0)
    points = scenario.points
    stated = np.array(
        [p.height_m if p.stated == "height" else 0.0 for p in points] + [0.0] * corners
    )
    free = np.array([p.stated == "free" for p in points] + [False] * corners)
    # labels with swaps; the stated heights follow the labels
    label = [truth.label[i] for i in point]
    for first, second in habits.swapped:
        _swap(label, frame.tolist(), first, second)
    row = {name: k for k, name in enumerate(truth.label)}
    at = [row[name] for name in label]
    return Picks(
        image=tuple(truth.frame_id[i] for i in frame),
        label=tuple(label),
        pixel_px=pixel_px[shown] + habits.pick_factor * noise,
        sigma_px=sigma,
        height_m=np.where(stated[at] != 0.0, stated[at], np.nan),
        is_free=free[at],
        source=tuple("target" if i >= len(points) else "hand" for i in point) if corners else (),
    )


def _count_corners(scenario: Scenario) -> tuple[int, int]:
    """Return the numbers of points and of corners of plates."""
    return len(scenario.points), len(scenario.plates.labels)


def _swap(label: list[str], frame: list[int], first: str, second: str) -> None:
    """Exchange two labels in the first photo that shows both."""
    place = {pair: i for i, pair in enumerate(zip(frame, label, strict=True))}
    for photo in sorted(set(frame)):
        if (photo, first) in place and (photo, second) in place:
            one, other = place[photo, first], place[photo, second]
            label[one], label[other] = second, first
            return


def draw_tape_readings(
    scenario: Scenario,
    truth: SurveyTruth,
    rngs: tuple[np.random.Generator, np.random.Generator],
) -> KnownLines:
    """Draw the tape reading of every line.

    Parameters
    ----------
    scenario, truth
        Of the survey.
    rngs
        Draw the readings' errors, and the tape's.
    """
    errors, habits = scenario.errors, scenario.habits
    noise = errors.tape_m * rngs[0].standard_normal(len(scenario.lines))
    length = truth.line_length_m
    if habits.level_tape:
        row = {label: i for i, label in enumerate(truth.label)}
        ends = [[row[line.start], row[line.end]] for line in scenario.lines]
        leg = np.diff(truth.point_world_m[np.reshape(ends, (-1, 2))], axis=1)[:, 0]
        length = np.linalg.norm(leg[:, :2], axis=1)
    # reading = length (1 + scale) + noise + gross error
    scale = errors.tape_scale * rngs[1].standard_normal() + habits.tape_long
    wrong = {one.name: one.by_m for one in habits.wrong_lengths}
    blunder = np.array([wrong.get(line.name, 0.0) for line in scenario.lines])
    return KnownLines(
        name=tuple(line.name for line in scenario.lines),
        start=tuple(line.start for line in scenario.lines),
        end=tuple(line.end for line in scenario.lines),
        length_m=length * (1.0 + scale) + noise + blunder,
        sigma_m=np.full(len(noise), errors.tape_m),
        adjust=np.array([line.use == "adjust" for line in scenario.lines], dtype=bool),
    )


def draw_surveyed_points(
    truth: SurveyTruth, rows: list[int], noise_m: Floats, sigma_m: float
) -> KnownPoints:
    """Return points with surveyed coordinates.

    Parameters
    ----------
    truth, rows
        The truth, and rows of its points.
    noise_m, sigma_m
        (n, 3) their errors, and the sigma of each axis.
    """
    return KnownPoints(
        label=tuple(truth.label[i] for i in rows),
        kind="local",
        coordinates=truth.point_world_m[rows] + noise_m,
        sigma_m=np.full((len(rows), 3), sigma_m),
    )
