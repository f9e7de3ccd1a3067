"""A photo or a reading that is there twice changes no sigma, and is named."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from small_projects import Command, Project

import uavgram
from uavgram.model.result.result import Result


@pytest.fixture(scope="module")
def alone(small_survey: Path) -> Result:
    return uavgram.run(small_survey / "project.yaml", output=None)


def same(result: Result, before: Result) -> None:
    np.testing.assert_allclose(result.measurements.sigma, before.measurements.sigma, rtol=1e-9)
    np.testing.assert_allclose(result.measurements.value, before.measurements.value, rtol=1e-9)


def test_the_same_length_ten_times(project: Project, alone: Result) -> None:
    header, first, *rest = (project / "lines.csv").read_text().splitlines()
    name, start, end, *cells = first.split(",")
    copies = [",".join((f"{name}-{k}", end, start, *cells)) for k in range(9)]
    text = "\n".join([header, first, *rest, *copies]) + "\n"
    (project / "lines.csv").write_text(text)
    result = uavgram.run(project.path, output=None)
    same(result, alone)
    (said,) = [m.text for m in result.messages if m.code == "line-duplicate"]
    assert f"(counted: {name!r}; not counted: '{name}-0', '{name}-1'" in said
    status = dict(zip(result.lines.name, result.lines.status, strict=True))
    assert {status[f"{name}-{k}"] for k in range(9)} == {"removed"}
    assert result.checks_overall == alone.checks_overall


def test_a_copied_photo_with_the_picks_of_its_original(
    project: Project, alone: Result, command: Command
) -> None:
    rows = (project / "picks.csv").read_text().splitlines()
    photo = rows[1].split(",")[0]
    copy = "zz_copy.jpg"
    shutil.copy(project / "photos" / photo, project / "photos" / copy)
    again = [row.replace(photo, copy) for row in rows if row.startswith(photo)]
    (project / "picks.csv").write_text("\n".join([*rows, *again]) + "\n")
    result = uavgram.run(project.path, output=None)
    (said,) = [m.text for m in result.messages if m.code == "photo-duplicate"]
    assert f"{copy} is the same file as {photo}. " in said
    at = result.frames.frame_id.index(copy)
    assert result.frames.status[at] == "rejected"
    assert result.frames.reason[at] == f"the same photo as {photo}, which is counted"
    assert (result.measurements.sigma >= 0.98 * alone.measurements.sigma).all()
    assert f"{copy} is the same file as {photo}" in command("check", project.path).stdout
