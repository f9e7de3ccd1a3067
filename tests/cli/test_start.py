"""The command gives small matrices and OpenCV one thread, unless the user says otherwise."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import pytest
from small_projects import Project
from threadpoolctl import threadpool_limits

import uavgram
from uavgram.model.board import CalibrationOptions
from uavgram.pipeline.calibrate import calibrate

PROGRAM = """
import os, sys
from uavgram.cli import main
print("numpy" in sys.modules, "cv2" in sys.modules)
main(["check", "nowhere.yaml"])
print("numpy" in sys.modules, os.environ["OPENBLAS_NUM_THREADS"])
import cv2
print(cv2.getNumThreads())
"""
THREADS = ("OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


@pytest.mark.parametrize(("given", "expected"), [(None, "1"), ("3", "3")])
def test_it_is_settled_before_they_are_loaded(given: str | None, expected: str) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in THREADS}
    if given is not None:
        environment.update(dict.fromkeys(THREADS, given))
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ["False False", f"True {expected}", expected]


ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def uavgram_in(environment: dict[str, str], *words: str | Path) -> tuple[int, str]:
    """Status and error output of a command of its own process."""
    done = subprocess.run(
        [sys.executable, "-m", "uavgram", *words],
        env={**os.environ, **environment},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    return done.returncode, done.stderr


def test_names_with_umlauts_are_taken_where_the_system_knows_ascii_only(
    project: Project, tmp_path: Path
) -> None:
    folder = tmp_path / "Fälle"
    shutil.copytree(project.folder, folder)
    assert uavgram_in(ASCII, "check", folder) == (0, "")
    status, _ = uavgram_in(ASCII, "run", folder, "--output", folder / "höher", "--quiet")
    assert status == 0
    assert (folder / "höher" / "ground.tif").is_file()
    (folder / "project.yaml").unlink()
    assert uavgram_in(ASCII, "new", folder)[0] == 0
    assert "'Föhn' is neither a command nor" in uavgram_in(ASCII, "Föhn")[1]


def test_a_folder_whose_name_is_no_text_takes_no_results_and_is_one_message(
    project: Project, tmp_path: Path
) -> None:
    odd = Path(os.fsdecode(os.fsencode(tmp_path) + b"/h\xf6her"))
    status, said = uavgram_in({}, "run", project.folder, "--output", odd)
    assert status == 1
    assert r"h\xf6her: a name in this path is no text" in said
    assert said.count("\n") == 1
    assert not odd.exists()


# Same input, same output: whatever the environment, to the last digit.


ELSEWHERE = {
    "OPENBLAS_NUM_THREADS": "4",
    "OPENCV_FOR_THREADS_NUM": "4",
    "OMP_NUM_THREADS": "3",
    "TZ": "Asia/Kathmandu",
    "LC_ALL": "C",
    "PYTHONUTF8": "0",
    "PYTHONHASHSEED": "77",
}
RUN_PROGRAM = "import os, sys, uavgram; os.umask(0o077); uavgram.run(*sys.argv[1:])"


CALIBRATE = """
import sys
from uavgram.model.board import CalibrationOptions
from uavgram.pipeline.calibrate import calibrate
calibrate([sys.argv[1]], *sys.argv[2:], CalibrationOptions(coefficients=5))
"""
BOARD = "chessboard:9x6:25mm"


def results(folder: Path, name: str = "results.json") -> str:
    text = (folder / name).read_text(encoding="utf-8")
    return re.sub(r'"created_utc": *"[^"]*", ', "", text)


def test_neither_threads_nor_place_nor_language_change_a_digit(
    project: Project, tmp_path: Path
) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    with threadpool_limits(1, user_api="blas"):
        uavgram.run(project.path, here)
    subprocess.run(
        [sys.executable, "-c", RUN_PROGRAM, str(project.path), str(there)],
        env={**os.environ, **ELSEWHERE},
        check=True,
    )
    assert results(here) == results(there)
    assert (here / "measurements.csv").read_bytes() == (there / "measurements.csv").read_bytes()


def test_nor_do_they_change_a_camera(data_dir: Path, tmp_path: Path) -> None:
    photos = str(data_dir / "opencv_chess" / "left0[1-4].jpg")
    here, there = tmp_path / "here", tmp_path / "there"
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        calibrate([photos], BOARD, here, CalibrationOptions(coefficients=5))
    finally:
        cv2.setNumThreads(threads)
    subprocess.run(
        [sys.executable, "-c", CALIBRATE, photos, BOARD, str(there)],
        env={**os.environ, **ELSEWHERE},
        check=True,
    )
    assert results(here, "calibration.json") == results(there, "calibration.json")
