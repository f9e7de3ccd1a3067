"""Known points in the world of the flight."""

from __future__ import annotations

import pytest
from small_projects import Project

from uavgram.errors import InputError
from uavgram.model.survey.survey import Geodetic, World
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.pose import known_in_world

WORLD = World(origin=Geodetic(47.3, 8.55, 400.0), height_datum="msl", gauge="world")


@pytest.mark.parametrize("role", ["control", "check"])
def test_a_point_with_latitude_and_longitude_exchanged_is_a_mistake(
    project: Project, role: str
) -> None:
    rows = "label,latitude_deg,longitude_deg,height_m,sigma_m\nA,47.301,8.55,400,1\n"
    (project / "points.csv").write_text(rows)
    project.set(**{role: "points.csv"})
    right = read_inputs(project.path)
    known, _ = known_in_world(right, getattr(right, role), WORLD)
    assert known.world_m[0] == pytest.approx([0.0, 111.2, 0.0], abs=0.1)

    (project / "points.csv").write_text(f"{rows}B,8.55,47.301,400,1\n")
    wrong = read_inputs(project.path)
    with pytest.raises(InputError, match=r"point 'B' .* latitude and longitude exchanged"):
        known_in_world(wrong, getattr(wrong, role), WORLD)
