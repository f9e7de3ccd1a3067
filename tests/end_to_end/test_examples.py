"""configs/: each example runs as it lies there, and says what is true.

The survey is the first six photos of our twin `calm_nadir` that fall into logs/twin_short.BIN, at
2/5 of their size. Its truth is that of the twin: points in metres east and north of the true place
of take-off, which the log's home is not (the receiver's error), on level ground.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import uavgram
from uavgram.cli import main
from uavgram.geometry.earth.geodesy import enu_from_geodetic
from uavgram.io.photos.size import image_size
from uavgram.model.arrays import Floats

TAKE_OFF_DEG = (-35.363261, 149.1652299)
POINTS_M = {
    "P9": (129.93814, 78.53778),
    "P12": (159.82736, 52.06116),
    "P15": (139.37542, 48.97913),
    "R4": (140.62152, 54.01559),
    "R5": (134.79073, 76.61929),
    "R6": (144.94629, 62.54276),
    "R7": (132.19774, 53.45469),
    "R8": (133.32363, 64.45086),
}


def at(*labels: str) -> Floats:
    return np.array([POINTS_M[label] for label in labels])


def true_values() -> dict[str, float]:
    """Of measure.csv, by schoolbook geometry."""
    steps = np.diff(at("R6", "R4", "P15"), axis=0)
    ring = at("R7", "R8", "R5", "R6", "R4")
    x, y = ring.T
    one, two = at("R7", "R6") - at("R4")
    along = np.subtract(*at("R6", "R5"))
    aside = np.subtract(*at("P9", "R5"))
    return {
        "across": np.linalg.norm(np.subtract(*at("P12", "P15"))),
        "skid": np.linalg.norm(steps, axis=1).sum(),
        "crossing": abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2,
        "corner": np.degrees(np.arccos(one @ two / np.linalg.norm(one) / np.linalg.norm(two))),
        "debris to kerb": abs(along[0] * aside[1] - along[1] * aside[0]) / np.linalg.norm(along),
    }


@pytest.fixture(scope="module")
def examples(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clone")
    for name in ("configs", "logs"):
        out = shutil.ignore_patterns("out")
        shutil.copytree(repository / name, folder / name, ignore=out)
    return folder / "configs"


@pytest.mark.parametrize("name", ["project", "lengths_only", "photo_poses"])
def test_an_example_is_checked_and_run_and_agrees_with_the_truth(
    examples: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = examples / f"{name}.yaml"
    assert main(["check", str(path)]) == 0
    assert "every input can be read" in capsys.readouterr().out
    result = uavgram.run(path, output=path.parent / "out" if name == "project" else None)

    values = result.measurements
    assert not [message for message in result.messages if message.code == "frame-left-out"]
    assert set(result.frames.status) == {"refined"}
    for measured, true in true_values().items():
        k = values.name.index(measured)
        assert abs(values.value[k] - true) < 3 * values.sigma[k], measured
        assert values.sigma[k] < 0.01 * true, measured
    assert 0.3 < result.solution.variance_factor < 1.6


def test_the_examples_coordinates_are_true_where_the_log_or_the_photos_give_them(
    examples: Path,
) -> None:
    for name, within_sigmas in (("project", 3.5), ("photo_poses", 3.0)):
        result = uavgram.run(examples / f"{name}.yaml", output=None)
        assert result.world.origin is not None
        home = (*result.world.origin[:2], 0.0)
        latitude, longitude, height = (np.array([v]) for v in (*TAKE_OFF_DEG, 0.0))
        shift = enu_from_geodetic(latitude, longitude, height, home)[0, :2]
        k = result.points.label.index("P15")
        error = result.points.position_world_m[k, :2] - shift - POINTS_M["P15"]
        sigma = np.sqrt(np.diag(result.points.covariance_m2[k]))
        assert (np.abs(error) < within_sigmas * sigma).all(), (name, error, sigma)


def test_a_run_leaves_nothing_that_git_would_see(examples: Path, repository: Path) -> None:
    ignored = (repository / ".gitignore").read_text(encoding="utf-8").split()
    assert "out/" in ignored
    assert all(path.name in {"out", "photos"} for path in examples.iterdir() if path.is_dir())


def test_the_photos_are_small(repository: Path) -> None:
    photos = sorted((repository / "configs" / "photos").glob("*.jpg"))
    assert [image_size(photo) for photo in photos] == [(1200, 900)] * 6
    assert sum(photo.stat().st_size for photo in photos) < 1_000_000
