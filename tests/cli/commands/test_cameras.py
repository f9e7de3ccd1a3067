"""``uavgram camera``: shows, converts, scales and compares, or says what is wrong."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import board_scenes
import cv2
import numpy as np
import pytest
from board_photos import Sensor, look, photograph, true_corners
from camera_photos import camera_photo
from small_projects import Command

from uavgram.cli import main
from uavgram.config.camera import load_camera_file
from uavgram.io.cameras import read_opencv_calibration
from uavgram.model.board import Board, BoardObservations, BoardPhoto, CalibrationOptions, flat_board
from uavgram.model.camera import Calibration, CameraProvenance
from uavgram.stages.calibrate.calibration import calibrate

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


# `uavgram calibrate` as a person runs it: real photos, rendered ones, and everything wrong.


FILES = {"camera.yaml", "opencv.yml", "calibration.json", "calibration.html", "calibration.rrd"}
CHARUCO = flat_board(7, 5, 0.03, kind="charuco", marker_m=0.022, dictionary="DICT_5X5_100")
CHARUCO_TEXT = "charuco:8x6:30mm:22mm:DICT_5X5_100"
TRUE = np.array([520.0, 518, 322, 237, -0.2, 0.06, 8e-4, -5e-4, 0.0])
SIZE_PX = (640, 480)


@dataclass(frozen=True)
class Calibrated:
    """What the command wrote."""

    folder: Path
    camera: Calibration
    provenance: CameraProvenance
    numbers: dict[str, Any]
    codes: set[str]
    side: str = ""


def calibrated(folder: Path, *arguments: object) -> Calibrated:
    """Run the command into a folder; what it wrote."""
    assert main(["calibrate", *map(str, arguments), "--output", str(folder)]) == 0
    camera, provenance = load_camera_file(folder / "camera.yaml")
    assert provenance is not None
    numbers = json.loads((folder / "calibration.json").read_text(encoding="utf-8"))
    return Calibrated(
        folder=folder,
        camera=camera,
        provenance=provenance,
        numbers=numbers,
        codes={message["code"] for message in numbers["messages"]},
    )


def write_board_photos(folder: Path, count: int, board: Board = CHARUCO, *, seed: int = 0) -> Path:
    """Rendered photos of a board, tilted to all sides, rolled by turns."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(seed)
    for k in range(count):
        pose = look(
            board,
            tilt_deg=rng.uniform(15, 40),
            azimuth_deg=360 * k / count,
            roll_deg=90 * (k % 2) + rng.uniform(-10, 10),
            distance_m=rng.uniform(0.24, 0.32),
            shift_m=tuple(rng.uniform(-0.05, 0.05, 2)),
        )
        photo = photograph(
            board, "brown", TRUE, pose, SIZE_PX, Sensor(0.7, 2.0, 0.2), seed=k, step_px=4
        )
        cv2.imwrite(str(folder / f"{k:02d}.png"), photo)
    return folder


@pytest.fixture(scope="module", params=["left", "right"])
def chess(
    data_dir: Path, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Calibrated:
    folder = tmp_path_factory.mktemp(request.param) / "out"
    pattern = data_dir / "opencv_chess" / f"{request.param}[0-9]*.jpg"
    done = calibrated(folder, pattern, "--board", "chessboard:9x6:1m", "--coefficients", 5)
    return replace(done, side=request.param)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ChArUco photos, one of them without a board."""
    folder = write_board_photos(tmp_path_factory.mktemp("rendered") / "photos", 12)
    cv2.imwrite(str(folder / "wall.png"), np.full(SIZE_PX[::-1], 120, np.uint8))
    return folder


@pytest.fixture(scope="module")
def charuco(rendered: Path) -> Calibrated:
    return calibrated(rendered.parent / "out", rendered / "*.png", "--board", CHARUCO_TEXT)


def test_every_file_is_there_and_says_the_same(chess: Calibrated) -> None:
    assert {path.name for path in chess.folder.iterdir()} == FILES | {"found"}
    assert len(list((chess.folder / "found").glob("*.jpg"))) == 13
    numbers = chess.numbers
    assert numbers["schema"] == 1
    assert numbers["camera"]["parameters"] == chess.camera.parameters.tolist()
    np.testing.assert_array_equal(numbers["camera"]["covariance"], chess.camera.covariance)
    opencv, _ = read_opencv_calibration(chess.folder / "opencv.yml")
    np.testing.assert_array_equal(opencv.parameters, chess.camera.parameters)
    assert len(numbers["photos"]) == 13
    assert chess.provenance.source == "calibrated from 13 photos of a board"
    assert chess.provenance.board == "chessboard:9x6:1m"
    assert len(chess.provenance.inputs) == 13


def own_corners(chess: Calibrated) -> BoardObservations:
    """The corners that the command found, as the detector stated them."""
    photos = []
    for photo in chess.numbers["photos"]:
        rows = [c for c in chess.numbers["corners"] if c["photo"] == photo["file"]]
        photos.append(
            BoardPhoto(
                file=photo["file"],
                width_px=640,
                height_px=480,
                corner=np.array([c["corner"] for c in rows]),
                pixel_px=np.array([c["pixel_px"] for c in rows]),
                sigma_px=np.array([c["sigma_px"] for c in rows]),
            )
        )
    return BoardObservations(board=flat_board(9, 6, 1.0), photos=tuple(photos))


def test_the_same_corners_give_opencvs_parameters(chess: Calibrated) -> None:
    found = board_scenes.as_float32(own_corners(chess))
    equal = BoardObservations(
        board=found.board,
        photos=tuple(board_scenes.replace_pixels(p, p.pixel_px, 0.1) for p in found.photos),
    )
    ours = calibrate(equal, CalibrationOptions())
    theirs, sigma, *_ = board_scenes.opencv_calibration(equal)
    np.testing.assert_allclose(ours.calibration.parameters, theirs, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(np.sqrt(np.diag(ours.covariance_corners)), sigma, rtol=1e-3)
    # the corners' own sigmas weigh them, OpenCV does not: less than a sigma apart
    apart = (chess.camera.parameters - theirs) / np.sqrt(np.diag(chess.camera.covariance))
    assert np.abs(apart).max() < 1.0


def test_opencvs_own_corners_give_the_same_camera_within_its_sigmas(
    chess: Calibrated, data_dir: Path
) -> None:
    theirs, *_ = board_scenes.opencv_calibration(board_scenes.opencv_chess(data_dir, chess.side))
    apart = (chess.camera.parameters - theirs) / np.sqrt(np.diag(chess.camera.covariance))
    assert np.abs(apart).max() < 2.0


def test_residuals_are_those_of_opencvs_projection(chess: Calibrated) -> None:
    fx, fy, cx, cy = chess.camera.parameters[:4]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    board = flat_board(9, 6, 1.0).corner_board_m
    for photo in chess.numbers["photos"]:
        turn = np.array(photo["board_from_camera"]).T
        shift = -turn @ np.array(photo["center_board_m"])
        rows = [c for c in chess.numbers["corners"] if c["photo"] == photo["file"]]
        place = board[[c["corner"] for c in rows]]
        pixel = cv2.projectPoints(
            place, cv2.Rodrigues(turn)[0], shift, matrix, chess.camera.parameters[4:]
        )[0].reshape(-1, 2)
        found = np.array([c["pixel_px"] for c in rows])
        residual = np.array([c["residual_px"] for c in rows])
        np.testing.assert_allclose(pixel - found, residual, atol=1e-6)
        assert photo["rms_px"] == pytest.approx(
            np.sqrt(np.mean(np.sum(residual**2, axis=1))), abs=1e-9
        )


@pytest.mark.parametrize("prior", ["none", "exif"])
def test_six_photos_of_a_phantom_agree_with_the_published_camera(
    data_dir: Path, tmp_path: Path, prior: str
) -> None:
    folder = data_dir / "phantom3_lenscalib"
    published = json.loads((folder / "control.json").read_text())["camera"]
    done = calibrated(
        tmp_path / "out", folder / "*.jpg", "--board", "chessboard:9x11:60mm",
        "--coefficients", 5, "--prior", prior,
    )  # fmt: skip
    assert {"one-roll", "few-photos", "corner-common-error"} <= done.codes
    assert ("intrinsics-prior" in done.codes) == (prior == "exif")
    expected = [published[key] for key in ("fx", "fy", "cx", "cy")] + published["dist"]
    sigmas = [published[key] for key in ("fc_3sigma", "cc_3sigma", "kc_3sigma")]
    combined = np.sqrt(np.diag(done.camera.covariance) + (np.concatenate(sigmas) / 3) ** 2)
    assert (np.abs(done.camera.parameters - expected) < 3 * combined).all()
    assert done.camera.covariance[3, 3] > 4 * done.camera.covariance[2, 2]  # cy, one roll
    assert done.camera.name == "DJI FC300X"
    assert done.provenance.focal_mm == pytest.approx(3.61)


def test_a_charuco_board_gives_the_true_camera_and_a_wall_is_said(
    charuco: Calibrated, rendered: Path
) -> None:
    miss = charuco.camera.parameters - TRUE
    free = np.flatnonzero(np.diag(charuco.camera.covariance) > 0)
    covariance = charuco.camera.covariance[np.ix_(free, free)]
    assert miss[free] @ np.linalg.solve(covariance, miss[free]) < 27.9  # chi2(9), 0.1 %
    assert "photo-without-board" in charuco.codes
    assert charuco.numbers["left_out"] == [{"file": "wall.png", "reason": "no board was found"}]
    assert len(charuco.numbers["models"]) == 3  # auto compares
    assert (charuco.folder / "found" / "wall.png.jpg").is_file()
    assert len(list(rendered.iterdir())) == 13  # nothing was written beside the photos


def test_the_table_shows_every_parameter_and_the_worst_message_first(
    command: Command, rendered: Path, tmp_path: Path
) -> None:
    done = command(
        "calibrate", rendered / "*.png", "--board", CHARUCO_TEXT, "--output", tmp_path / "a",
        "--coefficients", 3, "--fix-aspect", "--name", "mine",
    )  # fmt: skip
    assert done.status == 0
    assert done.stdout.startswith("mine: brown lens, 640 x 480 px\n")
    camera, provenance = load_camera_file(tmp_path / "a" / "camera.yaml")
    for name, value in zip(camera.parameter_names[:4], camera.parameters, strict=False):
        assert f"{name}  " in done.stdout
        assert f"{value:.3f} px" in done.stdout
    assert camera.parameters[0] == camera.parameters[1]
    assert not camera.parameters[6:8].any()
    assert provenance is not None
    assert provenance.options["aspect"] == 1.0
    levels = [line.split(":")[0] for line in done.stdout.splitlines()]
    levels = [level for level in levels if level in {"error", "warning", "info"}]
    assert levels == sorted(levels, key=["error", "warning", "info"].index)
    assert "warning" in levels


def test_a_second_run_replaces_the_first_and_gives_the_same_numbers(
    charuco: Calibrated, rendered: Path, tmp_path: Path
) -> None:
    shutil.copytree(charuco.folder, tmp_path / "out")
    (tmp_path / "out" / "camera.yaml").write_text("an earlier one")
    again = calibrated(tmp_path / "out", rendered / "*.png", "--board", CHARUCO_TEXT)
    for key in ("camera", "photos", "corners", "quality", "messages", "maps"):
        assert again.numbers[key] == charuco.numbers[key], key


BOARD = ("--board", CHARUCO_TEXT)


def no_board(folder: Path) -> tuple[tuple[str, ...], str]:
    for k in range(3):
        cv2.imwrite(str(folder / f"{k}.png"), np.full((240, 320), 90 + k, np.uint8))
    return BOARD, "shows no board"


def wrong_size(folder: Path) -> tuple[tuple[str, ...], str]:
    copy_some(folder, 3)
    return ("--board", "charuco:12x9:30mm:22mm:DICT_5X5_100"), "8 x 6 squares"


def mixed_sizes(folder: Path) -> tuple[tuple[str, ...], str]:
    copy_some(folder, 3)
    cv2.imwrite(str(folder / "other.png"), np.zeros((240, 320), np.uint8))
    return BOARD, "320 x 240 pixels"


def two_cameras(folder: Path) -> tuple[tuple[str, ...], str]:
    for k, model in enumerate(("FC330", "FC330", "FC220")):
        camera_photo(folder / f"{k}.jpg", make="DJI", model=model, serial=str(k))
    return BOARD, "another camera"


def one_photo(folder: Path) -> tuple[tuple[str, ...], str]:
    copy_some(folder, 1)
    return BOARD, "1 of the 3 photos"


def identical_photos(folder: Path) -> tuple[tuple[str, ...], str]:
    copy_some(folder, 3)
    shutil.copy(folder / "00.png", folder / "03.png")
    return BOARD, "copy of"


def no_photo(folder: Path) -> tuple[tuple[str, ...], str]:
    copy_some(folder, 3)
    (folder / "03.png").write_bytes(b"\x89PNG\r\n\x1a\nand no more")
    return BOARD, "03.png"


def nothing_there(folder: Path) -> tuple[tuple[str, ...], str]:
    assert not list(folder.iterdir())
    return BOARD, "matches no file"


def unknown_board(folder: Path) -> tuple[tuple[str, ...], str]:
    copy_some(folder, 3)
    return ("--board", "chesboard:9x6:25mm"), "did you mean 'chessboard'"


def board_without_unit(folder: Path) -> tuple[tuple[str, ...], str]:
    copy_some(folder, 3)
    return ("--board", "chessboard:9x6:25"), "25mm, 2.5cm or 0.025m"


def fisheye_with_five(folder: Path) -> tuple[tuple[str, ...], str]:
    copy_some(folder, 3)
    return (*BOARD, "--model", "fisheye", "--coefficients", "5"), "a fisheye lens has 4"


def prior_without_exif(folder: Path) -> tuple[tuple[str, ...], str]:
    copy_some(folder, 3)
    return (*BOARD, "--prior", "exif"), "does not name its camera"


def copy_some(folder: Path, count: int) -> None:
    for k in range(count):
        shutil.copy(folder.parent / "good" / f"{k:02d}.png", folder)


@pytest.mark.parametrize(
    "make",
    [
        no_board, wrong_size, mixed_sizes, two_cameras, one_photo, identical_photos, no_photo,
        nothing_there, unknown_board, board_without_unit, fisheye_with_five, prior_without_exif,
    ],
    ids=lambda make: make.__name__,
)  # fmt: skip
def test_what_is_wrong_is_one_message_and_nothing_is_written(
    make: Callable[[Path], tuple[tuple[str, ...], str]],
    rendered: Path,
    command: Command,
    tmp_path: Path,
) -> None:
    shutil.copytree(rendered, tmp_path / "good")
    folder = tmp_path / "photos"
    folder.mkdir()
    arguments, words = make(folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    done = command("calibrate", folder / "*", *arguments, "--output", tmp_path / "out")
    assert done.status == 1, done
    assert done.stdout == ""
    assert done.stderr.startswith("uavgram: ")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_a_folder_that_cannot_be_written_is_one_message(
    rendered: Path, command: Command, tmp_path: Path
) -> None:
    (tmp_path / "taken").write_text("a file")
    done = command("calibrate", rendered / "*.png", *BOARD, "--output", tmp_path / "taken")
    assert done.status == 1
    assert "--output" in done.stderr
    assert (tmp_path / "taken").read_text() == "a file"


def test_the_photos_themselves_are_never_written_over(
    rendered: Path, command: Command, tmp_path: Path
) -> None:
    shutil.copytree(rendered, tmp_path / "found")
    before = {path.name: path.read_bytes() for path in (tmp_path / "found").iterdir()}
    done = command("calibrate", tmp_path / "found" / "*.png", *BOARD, "--output", tmp_path)
    assert done.status == 1
    assert "the photos themselves" in done.stderr
    assert {path.name: path.read_bytes() for path in (tmp_path / "found").iterdir()} == before


def test_photos_of_one_name_in_two_folders_keep_apart(rendered: Path, tmp_path: Path) -> None:
    for k in range(6):
        (tmp_path / "ab"[k % 2]).mkdir(exist_ok=True)
        shutil.copy(rendered / f"{k:02d}.png", tmp_path / "ab"[k % 2] / f"{k // 2}.png")
    done = calibrated(
        tmp_path / "out", tmp_path / "[ab]" / "*.png", *BOARD, "--coefficients", 3,
        "--fix-aspect", "--fix-principal-point",
    )  # fmt: skip
    files = [photo["file"] for photo in done.numbers["photos"]]
    assert files == ["a/0.png", "a/1.png", "a/2.png", "b/0.png", "b/1.png", "b/2.png"]
    assert len(list((tmp_path / "out" / "found").iterdir())) == 6


def test_found_pictures_show_the_corners(charuco: Calibrated, rendered: Path) -> None:
    plain = cv2.imread(str(rendered / "00.png"))
    drawn = cv2.imread(str(charuco.folder / "found" / "00.png.jpg"))
    assert plain is not None
    assert drawn is not None
    assert drawn.shape == plain.shape
    corners = [c["pixel_px"] for c in charuco.numbers["corners"] if c["photo"] == "00.png"]
    for u, v in np.round(corners).astype(int):
        around = drawn[v - 7 : v + 8, u - 7 : u + 8].astype(int)
        assert np.ptp(around, axis=2).max() > 60  # colour where the photo has none


def test_rendered_corners_are_where_they_were_projected(charuco: Calibrated) -> None:
    # of the first photo of the helper, drawn again: the truth is known from the geometry alone
    rng = np.random.default_rng(0)
    pose = look(
        CHARUCO, tilt_deg=rng.uniform(15, 40), azimuth_deg=0, roll_deg=rng.uniform(-10, 10),
        distance_m=rng.uniform(0.24, 0.32), shift_m=tuple(rng.uniform(-0.05, 0.05, 2)),
    )  # fmt: skip
    truth = true_corners(CHARUCO, "brown", TRUE, pose)
    rows = [c for c in charuco.numbers["corners"] if c["photo"] == "00.png"]
    error = np.array([c["pixel_px"] for c in rows]) - truth[[c["corner"] for c in rows]]
    assert len(rows) > 20
    assert np.sqrt(np.mean(error**2)) < 0.1
