"""Surveys in which nothing is wrong: what a run makes of them as a whole."""

from pathlib import Path

import numpy as np
import pytest

import uavgram


@pytest.mark.parametrize("name", ["street_nadir", "street_rolling", "calm_nadir"])
def test_a_survey_without_a_fault_is_not_red_and_keeps_its_lengths(
    name: str, data_dir: Path
) -> None:
    """Streets have houses: points of walls, 6 m high and in two photos, are no wrong picks."""
    if not (data_dir / name).is_dir():
        pytest.skip(f"no {name} in {data_dir}")
    result = uavgram.run(data_dir / name / "project.yaml", output=None)
    assert result.verdict.level != "red"
    assert not {"line-left-out", "photos-mirrored"} & {one.code for one in result.messages}
    off = result.lines.adjusted_m - result.lines.length_m
    assert np.nanmax(np.abs(off), initial=0.0) < 0.05
