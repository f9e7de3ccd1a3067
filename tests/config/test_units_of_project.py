"""`units:` of a project file."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavgram.config.project import load_project
from uavgram.errors import InputError
from uavgram.model.naming import IMPERIAL, METRIC, Units


def project_with(folder: Path, line: str) -> Path:
    (folder / "camera.yaml").touch()
    file = folder / "project.yaml"
    file.write_text(f"images: '*.jpg'\ncamera: camera.yaml\npicks: picks.csv\n{line}\n")
    return file


@pytest.mark.parametrize(
    ("line", "units"),
    [
        ("", METRIC),
        ("units: metric", METRIC),
        ("units: imperial", IMPERIAL),
        ("units: {length: ft}", Units(length="ft")),
        ("units: {length: ft-in, speed: m/s}", Units(length="ft-in", speed="m/s")),
    ],
)
def test_units_are_read_in_full_and_in_one_word(line: str, units: Units, tmp_path: Path) -> None:
    assert load_project(project_with(tmp_path, line), unfinished=True).units == units


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("units: yards", "must be metric, imperial, or such as"),
        ("units: US survey feet", "write ft, the international foot of 0.3048 m"),
        ("units: {length: inch}", "must be m, ft or ft-in"),
        ("units: {width: m}", "unknown key 'width'"),
        ("units: {speed: knots}", "must be km/h, mph or m/s"),
    ],
)
def test_other_units_are_refused_with_a_way_out(line: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=why) as refused:
        load_project(project_with(tmp_path, line), unfinished=True)

    assert ":4: units" in str(refused.value)
