"""Rendered photos: are the marks where the geometry says?"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import cv2
import numpy as np
import pytest

from uavgram.geometry.camera.projection import project
from uavgram.imaging.raster import GroundRaster, Image, Painter, make_box
from uavgram.imaging.targets.plates import detect_plates
from uavgram.model.arrays import Floats
from uavgram.model.naming import corner_label
from uavgram.synthetic.accident_scene import DEMO_POINTS, Mark
from uavgram.synthetic.flight import compute_true_poses, draw_biases, simulate_motion
from uavgram.synthetic.rendering import compute_ground_map, get_whole_photo, render_photos
from uavgram.synthetic.scenario import PLATE_FAMILY, GroundSpec, PlateSpec, Scenario
from uavgram.synthetic.survey import SimulatedSurvey, simulate

FRAMES = (0, 3)


@pytest.fixture(scope="module")
def survey() -> SimulatedSurvey:
    return simulate(Scenario())


@pytest.fixture(scope="module")
def photos(survey: SimulatedSurvey) -> dict[int, Image]:
    return dict(zip(FRAMES, islice(render_photos(survey), 0, 4, 3), strict=True))


def true_marks(survey: SimulatedSurvey, index: int, kind: Mark) -> list[tuple[str, Floats]]:
    """Labels and true pixels of the marks of a kind that lie well inside a photo."""
    truth = survey.truth
    offset = truth.point_world_m - truth.center_world_m[index]
    pixel = project("brown", truth.intrinsics, offset @ truth.world_from_camera[index])
    size = np.array([survey.calibration.width_px, survey.calibration.height_px])
    inside = np.all((pixel > 40) & (pixel < size - 40), axis=1)
    return [
        (point.label, pixel[i])
        for i, point in enumerate(survey.scenario.points)
        if inside[i] and point.mark == kind
    ]


@pytest.mark.parametrize("index", FRAMES)
def test_checker_targets_lie_where_they_are_projected(
    survey: SimulatedSurvey, photos: dict[int, Image], index: int
) -> None:
    gray = cv2.cvtColor(photos[index], cv2.COLOR_BGR2GRAY)
    marks = true_marks(survey, index, "checker")
    assert len(marks) >= 2
    start = np.array([np.round(pixel) for _, pixel in marks], np.float32)[:, None]
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    found = cv2.cornerSubPix(gray, start.copy(), (6, 6), (-1, -1), criteria)[:, 0]
    error = np.linalg.norm(found - [pixel for _, pixel in marks], axis=1)
    assert error.max() < 0.15, dict(zip([label for label, _ in marks], error, strict=True))


def test_sprayed_crosses_lie_where_they_are_projected(
    survey: SimulatedSurvey, photos: dict[int, Image]
) -> None:
    photo = photos[3].astype(float)
    yellow = photo[..., 2] - photo[..., 0]
    alone = {"P5", "P7", "P8"}  # nothing yellow or red within reach
    marks = [m for m in true_marks(survey, 3, "cross") if m[0] in alone]
    assert len(marks) == 3
    for label, pixel in marks:
        u0, v0 = np.round(pixel).astype(int)
        reach = 17  # all of the cross, nothing of its label
        weight = yellow[v0 - reach : v0 + reach + 1, u0 - reach : u0 + reach + 1]
        weight = weight - np.median(weight)
        weight[np.abs(weight) < 12] = 0.0  # asphalt is not quite grey
        v, u = np.indices(weight.shape) - reach
        center = np.array(
            [u0 + np.sum(u * weight) / weight.sum(), v0 + np.sum(v * weight) / weight.sum()]
        )
        assert np.linalg.norm(center - pixel) < 0.15, label


@pytest.mark.parametrize("ground", [GroundSpec(), GroundSpec(relief_m=0.1)])
def test_the_coarse_grid_of_rays_costs_less_than_two_hundredths_of_a_pixel(
    ground: GroundSpec,
) -> None:
    survey = simulate(replace(Scenario(), ground=ground))
    truth = survey.truth
    width, height = survey.calibration.width_px, survey.calibration.height_px
    map_x, map_y = compute_ground_map(survey, 2, get_whole_photo(survey), truth.surface)
    assert map_x.shape == (height, width)
    rng = np.random.default_rng(0)
    u = np.concatenate([rng.integers(0, width, 2000), [0, 0, width - 1, width - 1]])
    v = np.concatenate([rng.integers(0, height, 2000), [0, height - 1, 0, height - 1]])
    scene = np.stack([map_x[v, u], map_y[v, u]], axis=1).astype(float)
    plane = survey.scenario.site.in_world(scene)
    up = truth.surface.up(plane - truth.surface.middle_m)
    offset = np.column_stack([plane, up]) - truth.center_world_m[2]
    back = project("brown", truth.intrinsics, offset @ truth.world_from_camera[2])
    assert np.abs(back - np.stack([u, v], axis=1)).max() < 0.02


def test_photos_read_row_after_row_show_marks_and_plates_where_each_row_saw_them() -> None:
    """The oracle is the true flight at the instants of rows, interpolated anew for each mark."""
    readout_s = 0.04
    raised = tuple(
        replace(point, height_m=0.5) if point.label == "R2" else point for point in DEMO_POINTS
    )
    usual = Scenario()
    scenario = replace(
        usual,
        errors=replace(usual.errors, readout_ms=1e3 * readout_s),
        ground=GroundSpec(shape="crown"),
        points=raised,
        plates=PlateSpec(side_m=0.6, at=((-10.0, -8.5, 20.0), (-13.0, 7.5, 75.0))),
    )
    survey = simulate(scenario)
    photo = next(render_photos(survey))
    gray = np.asarray(cv2.cvtColor(photo, cv2.COLOR_BGR2GRAY), np.uint8)
    seen = {plate.plate: plate.corner_px for plate in detect_plates(gray, PLATE_FAMILY)}
    assert set(seen) == {0, 1}
    rows = {label: row for row, label in enumerate(survey.truth.label)}
    off, swept = [], []
    for plate, corners in seen.items():
        for corner, pixel in enumerate(corners):
            own, middle = seen_by_its_row(survey, rows[corner_label(plate, corner)], readout_s)
            off.append(np.linalg.norm(pixel - own))
            swept.append(np.linalg.norm(pixel - middle))
    assert max(off) < 0.05
    assert max(swept) > 2.0
    for label in ("R1", "R2", "R5"):
        own, middle = seen_by_its_row(survey, rows[label], readout_s)
        start = np.round(own).astype(np.float32)[None, None].copy()
        criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
        found = cv2.cornerSubPix(gray, start, (6, 6), (-1, -1), criteria)[0, 0]
        assert np.linalg.norm(found - own) < 0.15, label


def test_pixels_of_which_the_lens_knows_no_ray_are_black_at_once() -> None:
    """As with the wide errors of a lens that nobody calibrated; and there is no debris either."""
    usual = Scenario()
    narrow = replace(
        usual.camera,
        width_px=400,
        height_px=300,
        parameters=(180.0, 180.0, 200.0, 150.0, -0.5, 0.0, 0.0, 0.0, 0.0),
        sigma=(0.1, 0.1, 0.1, 0.1, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5),
    )
    road = replace(usual.road, debris=())
    flight = replace(usual.flight, pattern="single", gimbal_pitch_deg=-45.0)
    survey = simulate(replace(usual, camera=narrow, road=road, flight=flight))
    photo = next(render_photos(survey))
    assert photo[0, 0].max() < 20
    assert photo[140:160, 180:220].mean() > 50


def seen_by_its_row(survey: SimulatedSurvey, row: int, readout_s: float) -> tuple[Floats, Floats]:
    """Where a point is in the first photo, by the instant of its row and by that of the middle."""
    scenario, calibration = survey.scenario, survey.calibration
    draw = np.random.SeedSequence(scenario.seed).spawn(2)
    motion = simulate_motion(scenario.flight, scenario.site, np.random.default_rng(draw[0]))
    biases = draw_biases(scenario, np.random.default_rng(draw[1]))
    exposed, height = motion.exposure_time_s[0], calibration.height_px
    pixels = []
    pixel = np.array([0.0, (height - 1) / 2])
    for _ in range(8):
        late = readout_s * (pixel[1] - (height - 1) / 2) / height
        center, rotation = compute_true_poses(motion, biases, np.array([exposed + late]))
        away = survey.truth.point_world_m[row] - center[0]
        pixel = project("brown", survey.truth.intrinsics, away @ rotation[0])
        pixels.append(pixel)
    return pixels[-1], pixels[0]


def test_photos_have_the_cameras_size_and_are_neither_dark_nor_burnt_out(
    survey: SimulatedSurvey, photos: dict[int, Image]
) -> None:
    for photo in photos.values():
        assert photo.shape == (survey.calibration.height_px, survey.calibration.width_px, 3)
        assert photo.dtype == np.uint8
        assert 50 < photo.mean() < 180
        assert np.mean(photo == 255) < 0.01


def test_the_same_survey_gives_the_same_photo(
    survey: SimulatedSurvey, photos: dict[int, Image]
) -> None:
    assert np.array_equal(next(render_photos(survey)), photos[0])


def test_shapes_are_painted_where_the_scene_has_them() -> None:
    raster = GroundRaster(
        image=np.zeros((40, 60, 3), np.uint8), x_top_m=2.0, y_left_m=3.0, resolution_m=0.1
    )
    mask = Painter(raster).polygons(make_box(0.5, 1.5, -1.0, 2.0)).astype(float)
    v, u = np.indices(mask.shape)
    center = np.array([np.sum(u * mask), np.sum(v * mask)]) / mask.sum()
    # Middle (1.0, 0.5): 1 m below the top, 2.5 m right of the left edge; pixel centres are whole.
    # OpenCV fills up to half a pixel too far.
    np.testing.assert_allclose(center, [24.5, 9.5], atol=0.5)
    assert raster.corners_m.tolist() == [[2, 3], [2, -3], [-2, -3], [-2, 3]]
