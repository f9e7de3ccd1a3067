"""Cells of studies: prediction, draws, and the program's own prediction agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uavgram.estimation.repeated.predicted_lengths import PredictedLengths, predict_lengths
from uavgram.model.study.scene import StudyScene
from uavgram.pipeline.simulate.repeat import predicted
from uavgram.pipeline.simulate.worlds import ScenarioWorld
from uavgram.pipeline.study.grids import GRIDS
from uavgram.pipeline.study.photo_cell import Place, photo_cell
from uavgram.pipeline.study.photo_scene import exact_draw, photo_of
from uavgram.pipeline.study.survey_cells import SurveyPlace, survey_cell, survey_of

SURVEY = SurveyPlace(curve="", at=1, label="1", photos=1, base_m=1.0)


def place(scene: StudyScene) -> Place:
    return Place(curve="", at=0.0, label="", scene=scene)


@pytest.mark.parametrize(
    "scene",
    [
        StudyScene(),
        StudyScene(log="none", lines=4, focal_share=0.02, centre_px=50.0),
        StudyScene(lines=4, tape_scale=3e-3, tape_m=0.03, tilt_deg=45.0),
        StudyScene(layout="plates", lines=4, line_m=0.5, tape_m=5e-4, mark_px=0.1),
    ],
)
def test_errors_are_as_predicted_where_the_world_is_the_model(scene: StudyScene) -> None:
    cell = photo_cell(place(scene), 3000)
    assert scene.is_model
    assert cell.lost == 0
    assert cell.ratio == pytest.approx(1.0, abs=0.05)
    assert cell.ratio_range[0] < cell.ratio < cell.ratio_range[1]
    assert sum(cell.shares) == pytest.approx(1.0, abs=1e-9)
    assert cell.told < 0.01


@pytest.mark.parametrize(
    "amiss",
    [
        {"relief_m": 0.1},
        {"readout_ms": 60.0},
        {"bulge": -0.05},
        {"blunder_m": 0.5},
    ],
)
def test_what_nobody_states_makes_them_larger(amiss: dict[str, float]) -> None:
    cell = photo_cell(place(replace(StudyScene(), **amiss)), 400)  # type: ignore[arg-type]
    assert not cell.is_model
    assert cell.ratio_range[0] > 1.1


def test_the_prediction_is_that_of_the_program() -> None:
    """Six lengths, no log, a calibrated camera: by its own likelihood, over all unknowns."""
    world = ScenarioWorld(survey_of(SURVEY))
    truth = world.exact()
    _, _, sigma = predicted(world)
    photo = photo_of(StudyScene(tilt_deg=0.0, log="none"))
    root = np.asarray(np.linalg.cholesky(truth.inputs.calibration.covariance), dtype=np.float64)
    design = replace(photo.design, camera_root=root)
    ours = predict_lengths(design, exact_draw(photo), photo.place_m, photo.pairs)
    # The simulated photo wobbles: it is nearly, not exactly, straight down from 40 m.
    assert np.sqrt(ours.variance) == pytest.approx(sigma, rel=0.1)
    assert np.sqrt(ours.variance).mean() == pytest.approx(sigma.mean(), rel=0.03)


def test_the_part_of_the_readings_is_what_the_variance_gains_by_theirs() -> None:
    """The adjustment is optimal: to first order its weights do not matter (envelope theorem)."""
    photo = photo_of(StudyScene(focal_share=0.01, tape_scale=1e-3))

    def predicted_at(factor: float) -> PredictedLengths:
        sigma = photo.design.length_sigma_m * np.sqrt(factor)
        design = replace(photo.design, length_sigma_m=sigma)
        return predict_lengths(design, exact_draw(photo), photo.place_m, photo.pairs)

    step = 1e-4
    gained = (predicted_at(1 + step).variance - predicted_at(1 - step).variance) / (2 * step)
    assert predicted_at(1.0).lengths == pytest.approx(gained, rel=1e-5)
    whole = predicted_at(1.0)
    assert np.sum(whole.parts, axis=0) == pytest.approx(whole.variance, rel=1e-9)


def test_every_scene_of_the_grids_is_in_its_photo() -> None:
    for grid in GRIDS.values():
        for one in grid.places:
            photo_of(one.scene)
        curves: dict[str, list[float]] = {}
        for one in grid.places:
            curves.setdefault(one.curve, []).append(one.at)
        assert all(at == sorted(set(at)) for at in curves.values())


def test_what_lies_outside_the_photo_is_refused() -> None:
    with pytest.raises(ValueError, match="not everything is in the photo"):
        photo_of(StudyScene(height_m=10.0))


def test_a_survey_of_several_photos_is_a_cell_too() -> None:
    cell = survey_cell(replace(SURVEY, photos=2, base_m=20.0), 4)
    assert cell.lost == 0
    assert 0.3 < cell.ratio < 2.0
    assert cell.is_model
    assert not cell.shares
