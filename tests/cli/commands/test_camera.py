"""``uavgram camera``: shows, converts, scales and compares, or says what is wrong."""

import json
import re
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
import pytest
from camera_photos import camera_photo

from uavgram.cli import main
from uavgram.config.camera import load_camera_file

CAMERA = """\
name: test
model: brown
width_px: 4000
height_px: 3000
parameters: [2300, 2310, 2010, 1480, -0.05, 0.02, 1e-3, -5e-4, 0.01]
sigma: [6, 6, 4, 4, 0.002, 0.004, 1e-4, 1e-4, 0.002]
"""


class Run(Protocol):
    """The command ``uavgram camera``: status, and what it said."""

    def __call__(self, *arguments: object) -> tuple[int, str, str]: ...


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "camera.yaml"
    path.write_text(CAMERA)
    return path


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*arguments: object) -> tuple[int, str, str]:
        status = main(["camera", *map(str, arguments)])
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


def test_a_camera_is_shown_with_what_it_means(run: Run, file: Path) -> None:
    status, out, _ = run(file)

    assert status == 0
    assert re.search(r"fx +2300\.000 px +6\.000 px +0\.261 %", out)
    assert "principal point    (+10.50 ± 4.00) (-19.50 ± 4.00) px" in out
    for words in ("correlations", "field of view", "focal length", "distortion", "folds back"):
        assert words in out


def test_a_photo_shows_what_its_tags_say(run: Run, tmp_path: Path) -> None:
    photo = camera_photo(
        tmp_path / "p.jpg", (4000, 3000), make="DJI", model="FC220", focal=(473, 100)
    )
    status, out, _ = run(photo)

    assert status == 0
    assert "4.730 mm on its sensor" in out
    assert "warning: Camera 'DJI FC220' is assumed, not calibrated" in out


def test_opencv_reads_what_is_converted_for_it(run: Run, file: Path, tmp_path: Path) -> None:
    status, out, _ = run(file, "--to", "opencv", "--output", tmp_path / "c.yml")
    storage = cv2.FileStorage(str(tmp_path / "c.yml"), cv2.FILE_STORAGE_READ)

    assert status == 0
    assert "written:" in out
    np.testing.assert_array_equal(
        storage.getNode("camera_matrix").mat(), [[2300, 0, 2010], [0, 2310, 1480], [0, 0, 1]]
    )


def test_there_and_back_by_way_of_opencv_is_the_same_camera(
    run: Run, file: Path, tmp_path: Path
) -> None:
    run(file, "--to", "opencv", "--output", tmp_path / "c.yml")
    status, _, _ = run(tmp_path / "c.yml", "--output", tmp_path / "back.yaml")
    (back, provenance), (first, _) = (
        load_camera_file(path) for path in (tmp_path / "back.yaml", file)
    )

    assert status == 0
    np.testing.assert_array_equal(back.parameters, first.parameters)
    np.testing.assert_array_equal(back.covariance, first.covariance)
    assert provenance is not None
    assert provenance.inputs[0].path.endswith("c.yml")


def test_without_an_output_the_file_goes_to_the_terminal(run: Run, file: Path) -> None:
    status, out, _ = run(file, "--to", "colmap")

    assert status == 0
    assert out.splitlines()[-1].startswith("1 FULL_OPENCV 4000 3000 2300.0 2310.0 2010.5 1480.5 ")


def test_a_cropped_and_resized_camera_says_so_in_its_file(
    run: Run, file: Path, tmp_path: Path
) -> None:
    output = tmp_path / "small.yaml"
    status, _, _ = run(file, "--crop", "0,375,4000x2250", "--size", "2000x1125", "--output", output)
    camera, provenance = load_camera_file(output)

    assert status == 0
    assert (camera.width_px, camera.height_px) == (2000, 1125)
    np.testing.assert_allclose(camera.parameters[:4], [1150, 1155, 1004.75, 552.25])
    assert provenance is not None
    assert dict(provenance.options) == {"crop": "0,375,4000x2250", "size": "2000x1125"}


def test_the_provenance_of_a_converted_file_keeps_what_came_before(
    run: Run, file: Path, tmp_path: Path
) -> None:
    run(file, "--size", "2000x1500", "--output", tmp_path / "a.yaml")
    run(tmp_path / "a.yaml", "--size", "1000x750", "--output", tmp_path / "b.yaml")
    _, provenance = load_camera_file(tmp_path / "b.yaml")

    assert provenance is not None
    assert provenance.source == "converted; before that, converted"
    assert "made by uavgram" in run(tmp_path / "b.yaml")[1]


def test_two_cameras_are_compared(run: Run, file: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.yaml"
    other.write_text(CAMERA.replace("2300, 2310", "2330, 2340").replace("test", "other"))
    status, out, _ = run(file, "--compare", other)
    said = re.search(r"rms ([\d.]+) px, largest ([\d.]+) px", out)
    assert said is not None
    rms, largest = map(float, said.groups())

    assert status == 0
    assert "other minus test" in out
    # 30 px of focal length: up to a hundredth of the distance from the centre, no turn helps
    assert 10 < rms < largest < 60
    assert "sigmas (rms)" in out
    assert run(file, "--compare", other, "--distance", "20")[1].count("shift that fits best") == 1


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["--size", "2000"], 2, "must be WIDTHxHEIGHT"),
        (["--crop", "1,2,3"], 2, "must be LEFT,TOP,WIDTHxHEIGHT"),
        (["--crop", "0,0,5000x10"], 1, "does not lie inside 4000 x 3000"),
        (["--camera", "x"], 1, "holds one camera: leave out --camera 'x'"),
        (["--to", "matlab"], 2, "matlab"),
    ],
)
def test_wrong_arguments_are_told(
    run: Run, file: Path, arguments: list[str], status: int, words: str
) -> None:
    got, _, err = run(file, *arguments)

    assert got == status
    assert words in err


def test_sizes_must_agree_to_compare(run: Run, file: Path, tmp_path: Path) -> None:
    run(file, "--size", "2000x1500", "--output", tmp_path / "half.yaml")
    status, _, err = run(file, "--compare", tmp_path / "half.yaml")

    assert status == 1
    assert "different image sizes" in err


def test_one_of_several_cameras_is_chosen_by_name(run: Run, tmp_path: Path) -> None:
    entry = {"projection_type": "perspective", "width": 400, "height": 300, "focal": 0.8}
    path = tmp_path / "cameras.json"
    path.write_text(
        json.dumps({"a": entry | {"k1": 0.0, "k2": 0.0}, "b": entry | {"k1": 0.1, "k2": 0.0}})
    )

    assert run(path)[0] == 1
    assert "--camera 'a'" in run(path)[2]
    assert "b: brown lens, 400 x 300 px" in run(path, "--camera", "b")[1]


def test_a_file_that_is_none_is_told(run: Run, tmp_path: Path) -> None:
    assert run(tmp_path / "none.yaml")[0] == 1
    assert "cannot be read" in run(tmp_path / "none.yaml")[2]


def test_a_flight_log_is_named_as_one_with_the_files_that_hold_a_camera(
    run: Run, repository: Path
) -> None:
    for name in ("twin_short.tlog", "twin_short.BIN"):
        status, _, error = run(repository / "logs" / name)

        assert status == 1
        assert f"{name}: is a flight log: name camera.yaml, a calibration of OpenCV" in error
