"""What a survey taught of its camera, in numbers and in words."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.result.result import CameraUpdate, Estimate, compare_cameras
from uavgram.stages.camera import report_learnt_camera

VALUE = np.array([2300.0, 2300, 2000, 1500, 0, 0, 0, 0, 0])
PRIOR = np.array([40.0, 40, 20, 20, 0.02, 0.1, 0.006, 0.006, 0.0])


def learnt(value: Floats = VALUE, sigma: Floats = PRIOR, prior: Floats = PRIOR) -> CameraUpdate:
    calibration = Calibration(
        name="c",
        model="brown",
        width_px=4000,
        height_px=3000,
        parameters=VALUE,
        covariance=np.diag(np.square(prior)),
    )
    return compare_cameras(calibration, Estimate(value=value, sigma=sigma))


def changed(at: int, by: float, array: Floats) -> Floats:
    array = array.copy()
    array[at] = by
    return array


def test_what_was_learnt_is_told_by_its_sigmas_and_its_shift() -> None:
    camera = learnt(changed(0, 2340.0, VALUE), changed(0, 10.0, PRIOR))
    (message,) = report_learnt_camera(camera)

    assert (camera.ratio[0], camera.shift[0]) == (0.25, 1.0)
    assert camera.learnt.tolist() == [True, *[False] * 8]
    assert (message.level, message.code) == ("info", "camera-learnt")
    assert "fx from ± 40 px to ± 10 px (moved by +1.0 of the calibration's sigmas)" in message.text
    assert "fy cx cy k1 k2 p1 p2 cannot be learnt" in message.text


def test_a_parameter_that_the_calibration_holds_fixed_is_neither() -> None:
    camera = learnt()

    assert np.isnan([camera.ratio[8], camera.shift[8]]).all()
    assert "k3" not in report_learnt_camera(camera)[0].text


def test_where_nothing_was_learnt_it_says_so() -> None:
    (message,) = report_learnt_camera(learnt(sigma=0.95 * PRIOR))

    assert message.code == "camera-not-learnt"
    assert "add no information on the camera" in message.text


def test_a_fixed_camera_needs_no_words() -> None:
    assert report_learnt_camera(learnt(prior=np.zeros(9), sigma=np.zeros(9))) == ()


@pytest.mark.parametrize(("shift_px", "count"), [(119.0, 1), (121.0, 2), (-121.0, 2)])
def test_a_survey_that_contradicts_its_calibration_is_a_warning(
    shift_px: float, count: int
) -> None:
    messages = report_learnt_camera(
        learnt(changed(0, 2300 + shift_px, VALUE), changed(0, 10.0, PRIOR))
    )

    assert len(messages) == count
    if count == 2:
        assert (messages[1].level, messages[1].code) == ("warning", "camera-contradicted")
        assert f"fx by {shift_px / 40:+.1f}" in messages[1].text


def test_a_camera_that_was_only_assumed_is_not_called_a_calibration() -> None:
    camera = learnt(changed(0, 2300 + 121.0, VALUE), changed(0, 10.0, PRIOR))
    refined, contradicted = report_learnt_camera(camera, is_assumed=True)

    assert "moved by +3.0 of the assumed camera's sigmas" in refined.text
    assert "calibration" not in refined.text
    assert "farther than was assumed of it (fx by +3.0 of the assumed sigmas)" in contradicted.text
