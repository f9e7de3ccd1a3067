"""The camera.yaml of `uavgram calibrate` in a project, as it is."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_photos import Sensor, look, photograph

from uavgram.cli import main
from uavgram.model.board import flat_board
from uavgram.synthetic.demo import write_demo
from uavgram.synthetic.scenario import CameraSpec, Scenario
from uavgram.synthetic.survey import simulate

TRUE = (620.0, 618.0, 322.0, 237.0, -0.15, 0.04, 8e-4, -5e-4, 0.0)
SIZE_PX = (640, 480)
BOARD = flat_board(9, 6, 0.025)


@pytest.fixture(scope="module")
def camera_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("calibration")
    for k in range(10):
        pose = look(
            BOARD, tilt_deg=20 + 2 * k, azimuth_deg=36 * k, roll_deg=90 * (k % 2),
            distance_m=0.33, shift_m=(0.03 * np.cos(k), 0.03 * np.sin(k)),
        )  # fmt: skip
        photo = photograph(BOARD, "brown", TRUE, pose, SIZE_PX, Sensor(0.7, 2.0), seed=k, step_px=4)
        cv2.imwrite(str(folder / f"{k}.png"), photo)
    arguments = [str(folder / "*.png"), "--board", "chessboard:9x6:25mm", "--coefficients", "5"]
    assert main(["calibrate", *arguments, "--output", str(folder / "out")]) == 0
    return folder / "out" / "camera.yaml"


def test_a_calibrated_camera_measures_at_once(camera_file: Path, tmp_path: Path) -> None:
    camera = CameraSpec(
        width_px=SIZE_PX[0], height_px=SIZE_PX[1], parameters=TRUE, sigma=(1e-6,) * 9
    )
    survey = simulate(Scenario(camera=camera))
    photos = (np.full((*SIZE_PX[::-1], 3), 90, np.uint8) for _ in survey.frame_id)
    project = write_demo(tmp_path / "survey", survey, photos)
    (tmp_path / "survey" / "camera.yaml").write_bytes(camera_file.read_bytes())
    assert main(["check", str(project)]) == 0
    assert main(["run", str(project)]) == 0
    results = json.loads((tmp_path / "survey" / "out" / "results.json").read_text("utf-8"))
    numbers = json.loads((camera_file.parent / "calibration.json").read_text("utf-8"))
    assert results["camera"]["parameters"] == numbers["camera"]["parameters"]
    assert results["camera"]["covariance"] == numbers["camera"]["covariance"]
    assert results["solution"]["converged"]
    checks = [check["z"] for check in results["checks"] if "z" in check]
    assert checks
    assert max(map(abs, checks)) < 4
