"""Heights of the corners of cars and of a house in rendered streets, declared free.

The ground has a crown, kerbs and undulation. More of it: `tests/benchmarks/study_streets.py`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from height_errors import Errors
from street_data import Street, free_street, street_distances, street_heights

from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs


def ran(
    data_dir: Path, name: str, folder: Path, redrawn: int | None = None
) -> tuple[Street, Result]:
    """A street with free heights, and its result; the seed is of fresh noise of the picks."""
    if not (data_dir / name).is_dir():
        pytest.skip(f"no {name} in {data_dir}")
    street = free_street(data_dir, name, folder, redrawn=redrawn)
    return street, compute(read_inputs(street.project), curved=False).result


@pytest.mark.parametrize("redrawn", [None, 3])
def test_heights_and_distances_from_them_are_as_exact_as_they_say(
    redrawn: int | None, data_dir: Path, tmp_path: Path
) -> None:
    """Also where the picks of many free points, which fit on any ground, hide that it is rough."""
    street, result = ran(data_dir, "street_nadir", tmp_path, redrawn)
    for found in (street_heights(street, result), street_distances(street, result)):
        assert not found.without_value
        assert share_beyond_three_sigmas(found) <= 0.01
        assert np.mean(np.abs(found.error)) <= 1.5 * np.mean(found.sigma)


def test_a_point_picked_in_one_photo_has_no_height(data_dir: Path, tmp_path: Path) -> None:
    """And is refused by name; what lies on the ground is measured all the same."""
    street, result = ran(data_dir, "street_rolling", tmp_path)

    assert not street_heights(street, result).error
    refused = {
        label
        for label, status in zip(result.picks.label, result.picks.status, strict=True)
        if status == "unused"
    }
    assert refused == set(street.free)
    (told,) = (m.text for m in result.messages if m.code == "pick-left-out")
    assert told.startswith(f"{len(refused)} picks were left out: 'V11' in 'IMG_0022.jpg'")
    assert "P1" in result.points.label


def share_beyond_three_sigmas(found: Errors) -> float:
    """Of all that has a value."""
    return float(np.mean(np.abs(found.z) > 3))
