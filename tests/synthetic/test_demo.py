"""The demo's files, read back by the program's own readers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from uavgram.config.camera import load_camera
from uavgram.config.project import load_project
from uavgram.errors import OutputError
from uavgram.io.photos.catalogue import read_photos
from uavgram.io.tables.known import read_known_points, read_lines
from uavgram.io.tables.measure import read_measure
from uavgram.io.tables.picks import read_picks
from uavgram.model.options import Project, TimeOptions
from uavgram.synthetic.demo import write_demo
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import SimulatedSurvey, simulate


@pytest.fixture(scope="module")
def survey() -> SimulatedSurvey:
    return simulate(Scenario())


def blank_photos(survey: SimulatedSurvey) -> Iterator[NDArray[np.uint8]]:
    """Photos without a picture: what is tested here is the files."""
    return (np.full((30, 40, 3), 90, np.uint8) for _ in survey.frame_id)


@pytest.fixture(scope="module")
def project(survey: SimulatedSurvey, tmp_path_factory: pytest.TempPathFactory) -> Project:
    path = write_demo(tmp_path_factory.mktemp("demo"), survey, blank_photos(survey))
    return load_project(path)


def test_tables_say_what_was_simulated(project: Project, survey: SimulatedSurvey) -> None:
    picks = read_picks(project.picks)
    assert picks.image == survey.picks.image
    assert picks.label == survey.picks.label
    np.testing.assert_allclose(picks.pixel_px, survey.picks.pixel_px, atol=6e-4)
    np.testing.assert_allclose(picks.sigma_px, 0.7)
    assert project.lines is not None
    lines = read_lines(project.lines)
    assert (lines.name, lines.start, lines.end) == (
        survey.lines.name,
        survey.lines.start,
        survey.lines.end,
    )
    np.testing.assert_allclose(lines.length_m, survey.lines.length_m, atol=6e-5)
    assert np.array_equal(lines.adjust, survey.lines.adjust)
    assert project.measure is not None
    assert read_measure(project.measure) == survey.measurements
    assert project.check is not None
    checks = read_known_points(project.check)
    assert (checks.label, checks.kind) == (survey.checks.label, "local")
    np.testing.assert_allclose(checks.coordinates, survey.checks.coordinates, atol=6e-5)


def test_the_camera_file_holds_the_calibration_not_the_truth(
    project: Project, survey: SimulatedSurvey
) -> None:
    camera = load_camera(project.camera)
    np.testing.assert_array_equal(camera.parameters, survey.calibration.parameters)
    np.testing.assert_allclose(camera.covariance, survey.calibration.covariance, rtol=1e-12)
    assert not np.allclose(camera.parameters, survey.truth.intrinsics, rtol=1e-6)


def test_photos_carry_the_camera_clocks_time(project: Project, survey: SimulatedSurvey) -> None:
    photos, _ = read_photos(project.images, TimeOptions())
    assert photos.frame_id == survey.frame_id
    np.testing.assert_allclose(photos.file_time_s, survey.file_time_utc_s, atol=6e-4)
    np.testing.assert_allclose(photos.file_time_resolution_s, 0.001)


def test_truth_stands_beside_the_files(survey: SimulatedSurvey, tmp_path: Path) -> None:
    write_demo(tmp_path, survey, blank_photos(survey))
    truth = json.loads((tmp_path / "truth.json").read_text(encoding="utf-8"))
    assert truth["clock_offset_s"] == 2.6
    assert list(truth["frames"]) == list(survey.frame_id)
    assert truth["points"]["R1"] == survey.truth.point_world_m[0].tolist()
    assert len(truth["lines"]) == 6
    assert len(truth["lost_exposures_utc_s"]) == 1
    by_name = {row["name"]: row["value"] for row in truth["measurements"]}
    ends = [np.array(truth["points"][label]) for label in ("P1", "P2")]
    assert by_name["skid left"] == pytest.approx(np.linalg.norm(ends[0] - ends[1]))


def test_writing_twice_into_a_folder_is_no_mistake(survey: SimulatedSurvey, tmp_path: Path) -> None:
    write_demo(tmp_path, survey, blank_photos(survey))
    write_demo(tmp_path, survey, blank_photos(survey))


def test_photos_of_another_survey_are_not_mixed_in(survey: SimulatedSurvey, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "DSC_1.jpg").write_bytes(b"")
    with pytest.raises(OutputError, match="another survey"):
        write_demo(tmp_path, survey, blank_photos(survey))


def test_a_folder_that_cannot_be_made_is_named(survey: SimulatedSurvey, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(OutputError, match="file"):
        write_demo(tmp_path / "file" / "demo", survey, blank_photos(survey))
