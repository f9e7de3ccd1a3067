"""Points whose height is to be found: right, as uncertain as they are, or refused by name."""

from dataclasses import replace

import numpy as np
import pytest
from off_ground import with_third_coordinates
from scenes import make_scene

from uavgram.estimation.survey.adjustment import Adjustment, LeftOutCause, compute_heights
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.first_values import NO_HEIGHT

HEIGHTS = {0: 1.5, 4: 0.6, 7: 2.5}
STATED = SolveOptions(noise="stated")
SETTINGS = {
    "log": {},
    "no log": {"telemetry": False, "gauge": "plane"},
    "control": {"telemetry": False, "control": 5},
}


def adjusted(survey: Survey) -> Adjustment:
    return refine(survey, STATED)[0].adjustment


@pytest.mark.parametrize("setting", SETTINGS)
def test_exact_data_give_the_true_heights(setting: str) -> None:
    scene = make_scene(11, noise=0.0, heights=HEIGHTS, **SETTINGS[setting])  # type: ignore[arg-type]
    adjustment = adjusted(with_third_coordinates(scene, free=HEIGHTS).survey)

    height, sigma = compute_heights(adjustment)
    for label, true in HEIGHTS.items():
        assert height[label] == pytest.approx(true, abs=1e-5)
        assert 0.001 < sigma[label] < 0.5
    rest = np.setdiff1d(np.arange(len(height)), list(HEIGHTS))
    assert (height[rest] == 0).all()
    assert (sigma[rest] == 0).all()


def test_heights_are_as_uncertain_as_stated() -> None:
    z = []
    for seed in range(40):
        scene = with_third_coordinates(make_scene(seed, heights=HEIGHTS), free=HEIGHTS)
        height, sigma = compute_heights(adjusted(scene.survey))
        z += [(height[k] - true) / sigma[k] for k, true in HEIGHTS.items()]

    # 120 values that hang together by threes: within 3 sigma of 40 independent ones.
    assert 0.66 < np.sqrt(np.mean(np.square(z))) < 1.34
    assert np.abs(z).max() < 4.5


def test_a_stated_height_with_a_sigma_is_an_observation() -> None:
    scene = make_scene(11, heights=HEIGHTS)
    loose = with_third_coordinates(scene, stated={0: 100.0})
    tight = with_third_coordinates(scene, stated={0: 1e-6})
    free = with_third_coordinates(scene, free=(0,))
    exact = compute_heights(adjusted(scene.survey))[0][0]

    found = [compute_heights(adjusted(one.survey)) for one in (loose, tight, free)]
    assert found[0][0][0] == pytest.approx(found[2][0][0], abs=1e-4)
    assert found[0][1][0] == pytest.approx(found[2][1][0], rel=1e-3)
    assert found[1][0][0] == pytest.approx(exact, abs=1e-6)
    assert found[1][1][0] == pytest.approx(1e-6, rel=1e-3)


def test_a_free_point_that_one_photo_shows_is_left_out_by_name() -> None:
    scene = with_third_coordinates(make_scene(11, heights=HEIGHTS), free=HEIGHTS)
    survey = scene.survey
    keep = (survey.pick_label != 7) | (survey.pick_frame == 0)
    rows = np.flatnonzero(keep)
    one = replace(
        survey,
        pick_frame=survey.pick_frame[rows],
        pick_label=survey.pick_label[rows],
        pixel_px=survey.pixel_px[rows],
        pick_sigma_px=survey.pick_sigma_px[rows],
        line_start=np.zeros(0, int),
        line_end=np.zeros(0, int),
        length_m=np.zeros(0),
        length_sigma_m=np.zeros(0),
    )
    refined, _ = refine(one, STATED)

    assert list(refined.pick_reason.values()) == [NO_HEIGHT]
    assert NO_HEIGHT.cause is LeftOutCause.UNDETERMINED
    assert "P7" not in refined.adjustment.survey.label
    assert "P0" in refined.adjustment.survey.label


def test_a_length_to_the_ground_holds_a_point_that_one_photo_shows() -> None:
    scene = make_scene(11, frames=1, heights={0: 1.5}, ends=((0, 1), (0, 2), (3, 4)), noise=0.0)
    survey = with_third_coordinates(scene, free=(0,)).survey

    height, sigma = compute_heights(adjusted(survey))
    assert sigma[0] < 2.0  # by its ray alone it would be anywhere
    assert height[0] == pytest.approx(1.5, abs=3 * sigma[0])


def test_a_short_length_does_not_hold_a_point_on_the_wrong_side() -> None:
    # By the log's poses P4 begins 1 m too low, below the other end of its length of 0.9 m.
    scene = make_scene(3033, heights=HEIGHTS, ends=((6, 8), (6, 4), (3, 4), (1, 6), (3, 8), (3, 2)))
    adjustment = adjusted(with_third_coordinates(scene, free=HEIGHTS).survey)

    height, sigma = compute_heights(adjustment)
    assert height[4] == pytest.approx(0.6, abs=4 * sigma[4])
    assert adjustment.variance_factor < 2.0
