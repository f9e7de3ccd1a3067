"""configs/: the files that a user copies load, say the real defaults, and belong together."""

from __future__ import annotations

import re
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from uavgram.config.camera import load_camera
from uavgram.config.project import load_project
from uavgram.io.cameras import is_opencv_calibration, read_opencv_calibration
from uavgram.io.tables.known import read_known, read_known_points, read_lines
from uavgram.io.tables.measure import read_measure
from uavgram.io.tables.picks import read_picks
from uavgram.model.observations import MeasurementKind
from uavgram.model.options import Project


@pytest.fixture
def project(repository: Path) -> Project:
    return load_project(repository / "configs" / "project.yaml")


def test_the_example_project_states_the_real_defaults(project: Project) -> None:
    plain = Project(name="x", images=("x",), camera="x", picks="x")

    for key in ("world", "ground", "mount", "telemetry", "picks_sigma_px", "solve"):
        assert getattr(project, key) == getattr(plain, key)
    assert project.time == replace(plain.time, offset_s=0.0)  # the log's events come at equal steps


def test_the_example_project_names_every_key(repository: Path, project: Project) -> None:
    text = (repository / "configs" / "project.yaml").read_text()

    for field in fields(Project):
        assert re.search(rf"^(# )?{field.name}:", text, re.MULTILINE), field.name
        section = getattr(project, field.name)
        for inner in fields(section) if is_dataclass(section) else ():
            assert re.search(rf"^  {inner.name}:", text, re.MULTILINE), inner.name


def test_the_example_cameras_are_one_camera_in_two_formats(repository: Path) -> None:
    own = load_camera(repository / "configs" / "camera.yaml")
    path = repository / "configs" / "camera_opencv.yaml"
    theirs, messages = read_opencv_calibration(path)

    assert is_opencv_calibration(path)
    assert not is_opencv_calibration(repository / "configs" / "camera.yaml")
    np.testing.assert_array_equal(own.parameters, theirs.parameters)
    np.testing.assert_array_equal(own.covariance, theirs.covariance)
    assert [m.code for m in messages] == ["camera-sigma-from-file"]


def test_the_example_tables_belong_together(project: Project) -> None:
    picks = read_picks(project.picks)
    assert project.lines is not None
    lines = read_lines(project.lines)
    assert project.measure is not None
    requests = read_measure(project.measure)
    assert project.control is not None
    assert project.check is not None
    assert project.known is not None
    things = read_known(project.known)
    known = (read_known_points(project.control), read_known_points(project.check))

    labels = set(picks.label)
    assert {*lines.start, *lines.end} <= labels
    assert {label for request in requests for label in request.points} <= labels
    assert {label for points in things.points for label in points} <= labels
    assert {label for points in known for label in points.label} <= labels
    assert lines.adjust.tolist() == [True, True, True, True, True, False]
    assert {request.kind for request in requests} == {*get_args(MeasurementKind)} - {"speed"}
