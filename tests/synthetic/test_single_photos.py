"""Cells of studies: prediction, draws, and the program's own prediction agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uavgram.estimation.first_poses.photo_problem import SharedErrors
from uavgram.estimation.repeated.single_photo import PredictedLengths, predict_lengths
from uavgram.model.observations import MeasurementRequest
from uavgram.synthetic.accident_scene import SceneLine, ScenePoint
from uavgram.synthetic.errors import ErrorSpec, StatedSpec
from uavgram.synthetic.scenario import CameraSpec, FlightPlan, Scenario, Site, Station
from uavgram.synthetic.simulate import predict_sigmas
from uavgram.synthetic.single_photos import (
    LENS,
    SIZE_PX,
    StudyCell,
    StudyPhoto,
    StudyScene,
    make_photo,
    simulate_cell,
)
from uavgram.synthetic.study import STUDY_GRIDS
from uavgram.synthetic.survey import ScenarioWorld

NO_LOG_SIGMA = np.array([100.0, 100.0, 1000.0, 10.0, 10.0, 10.0])
"""Of the pose [m, rad]: so weak that it moves no length."""


def place(scene: StudyScene) -> StudyCell:
    return StudyCell(curve="", at=0.0, label="", scene=scene)


@pytest.mark.parametrize(
    "scene",
    [
        StudyScene(),
        StudyScene(lines=4, focal_share=0.02, centre_px=50.0),
        StudyScene(lines=4, tape_scale=3e-3, tape_m=0.03, tilt_deg=45.0),
    ],
)
def test_errors_are_as_predicted(scene: StudyScene) -> None:
    cell = simulate_cell(place(scene), 3000)
    assert cell.lost == 0
    assert cell.ratio == pytest.approx(1.0, abs=0.05)
    assert cell.ratio_range[0] < cell.ratio < cell.ratio_range[1]
    assert sum(cell.shares) == pytest.approx(1.0, abs=1e-9)


def single_photo(photo: StudyPhoto) -> Scenario:
    """The photo as a scenario without a log, with a camera file as a calibration gives it."""
    label = [f"P{i + 1}" for i in range(len(photo.place_m))]
    return Scenario(
        name="study",
        site=replace(Site(), ground_height_m=0.0, ground_slope_deg=(0.0, 0.0)),
        camera=CameraSpec(
            name="study",
            width_px=SIZE_PX[0],
            height_px=SIZE_PX[1],
            parameters=tuple(LENS.tolist()),
            sigma=(4.0, 4.0, 2.5, 2.5, 0.002, 0.004, 1e-4, 1e-4, 0.001),
        ),
        flight=FlightPlan(pattern="poses", poses=(Station(x_m=0.0, y_m=0.0, height_m=40.0),)),
        telemetry="none",
        errors=ErrorSpec(pick_px=0.8),
        stated=StatedSpec(tape_scale_sigma=0.0, noise="stated"),
        points=tuple(
            ScenePoint(label=name, x_m=x, y_m=y)
            for name, (x, y) in zip(label, photo.place_m.tolist(), strict=True)
        ),
        lines=tuple(
            SceneLine(name=f"L{i + 1}", start=label[a], end=label[b])
            for i, (a, b) in enumerate(photo.exact.line[0].tolist())
        ),
        measurements=tuple(
            MeasurementRequest(name=f"D{i + 1}", kind="distance", points=(label[a], label[b]))
            for i, (a, b) in enumerate(photo.pairs.tolist())
        ),
    )


def test_the_prediction_is_that_of_the_program() -> None:
    """Six lengths, no log, a calibrated camera: by its own likelihood, over all unknowns."""
    photo = make_photo(StudyScene(tilt_deg=0.0))
    world = ScenarioWorld(single_photo(photo))
    truth = world.exact()
    _, _, sigma = predict_sigmas(world)
    root = np.asarray(np.linalg.cholesky(truth.inputs.calibration.covariance), dtype=np.float64)
    exact = photo.exact._replace(information=np.diag(NO_LOG_SIGMA**-2)[None])
    ours = predict_lengths(SharedErrors(photo.shared.calibration, root), exact, photo.pairs)
    # The simulated photo wobbles: it is nearly, not exactly, straight down from 40 m.
    assert np.sqrt(ours.variance) == pytest.approx(sigma, rel=0.1)
    assert np.sqrt(ours.variance).mean() == pytest.approx(sigma.mean(), rel=0.03)


def test_the_part_of_the_readings_is_what_the_variance_gains_by_theirs() -> None:
    """The adjustment is optimal: to first order its weights do not matter (envelope theorem)."""
    photo = make_photo(StudyScene(focal_share=0.01, tape_scale=1e-3))

    def predicted_at(factor: float) -> PredictedLengths:
        weight = photo.exact.reading_weight / np.sqrt(factor)
        exact = photo.exact._replace(reading_weight=weight)
        return predict_lengths(photo.shared, exact, photo.pairs)

    step = 1e-4
    gained = (predicted_at(1 + step).variance - predicted_at(1 - step).variance) / (2 * step)
    assert predicted_at(1.0).lengths == pytest.approx(gained, rel=1e-5)
    whole = predicted_at(1.0)
    assert np.sum(whole.parts, axis=0) == pytest.approx(whole.variance, rel=1e-9)


def test_every_scene_of_the_grids_is_in_its_photo() -> None:
    for grid in STUDY_GRIDS.values():
        for one in grid.places:
            make_photo(one.scene)
        curves: dict[str, list[float]] = {}
        for one in grid.places:
            curves.setdefault(one.curve, []).append(one.at)
        assert all(at == sorted(set(at)) for at in curves.values())


def test_what_lies_outside_the_photo_is_refused() -> None:
    with pytest.raises(ValueError, match="not everything is in the photo"):
        make_photo(StudyScene(height_m=10.0))
