"""Known points in the world of the flight."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import Transformer
from small_projects import Project

from uavgram.errors import InputError
from uavgram.estimation.reliability.stated_values import explain_coordinates
from uavgram.model.survey import Geodetic, World
from uavgram.pipeline.check import check
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.pose import transform_known

WORLD = World(origin=Geodetic(47.3, 8.55, 400.0), height_datum="msl", gauge="world")


@pytest.mark.parametrize("role", ["control", "check"])
def test_a_point_with_latitude_and_longitude_exchanged_is_a_mistake(
    project: Project, role: str
) -> None:
    rows = "label,latitude_deg,longitude_deg,height_m,sigma_m\nA,47.301,8.55,400,1\n"
    (project / "points.csv").write_text(rows)
    project.set(**{role: "points.csv"})
    right = read_inputs(project.path)
    known, _ = transform_known(right, getattr(right, role), WORLD)
    assert known.world_m[0] == pytest.approx([0.0, 111.2, 0.0], abs=0.1)

    (project / "points.csv").write_text(f"{rows}B,8.55,47.301,400,1\n")
    wrong = read_inputs(project.path)
    with pytest.raises(InputError, match=r"point 'B' .* latitude and longitude exchanged"):
        transform_known(wrong, getattr(wrong, role), WORLD)


@pytest.mark.parametrize("crs", ["auto", "EPSG:25832"])
@pytest.mark.parametrize("role", ["control", "check"])
def test_a_point_with_easting_and_northing_exchanged_is_a_mistake(
    project: Project, role: str, crs: str
) -> None:
    to_map = Transformer.from_crs("EPSG:4326", "EPSG:25832", always_xy=True)
    east, north = to_map.transform(8.55, 47.301)
    longitude, latitude = to_map.transform(north, east, direction="INVERSE")
    rows = "label,latitude_deg,longitude_deg,height_m,sigma_m\nA,47.301,8.55,400,1\n"
    (project / "points.csv").write_text(f"{rows}B,{latitude},{longitude},400,1\n")
    project.set(**{role: "points.csv", "crs": crs})
    wrong = read_inputs(project.path)
    with pytest.raises(InputError, match=r"point 'B' .* easting and northing exchanged"):
        transform_known(wrong, getattr(wrong, role), WORLD)


def test_all_points_with_exchanged_coordinates_are_named(project: Project) -> None:
    rows = "label,latitude_deg,longitude_deg,height_m,sigma_m\n"
    rows += "".join(f"{label},8.55,47.30{k},400,1\n" for k, label in enumerate("ABC"))
    (project / "points.csv").write_text(rows)
    project.set(control="points.csv")
    wrong = read_inputs(project.path)
    with pytest.raises(InputError, match=r"points 'A', 'B' and 'C' are far .*: correct their rows"):
        transform_known(wrong, wrong.control, WORLD)


@pytest.mark.parametrize("role", ["control", "check"])
def test_check_refuses_what_a_run_refuses(project: Project, role: str) -> None:
    home = check(project.path).posed.world.origin
    assert home is not None
    rows = "label,latitude_deg,longitude_deg,height_m,sigma_m\n"
    (project / "points.csv").write_text(
        f"{rows}A,{home.latitude_deg + 1.0},{home.longitude_deg},400,1\n"
    )
    project.set(**{role: "points.csv"})
    with pytest.raises(InputError, match="far from where the survey is"):
        check(project.path)


def test_points_that_are_all_of_another_place_are_a_mistake(project: Project) -> None:
    rows = (
        "label,latitude_deg,longitude_deg,height_m,sigma_m\nA,46.3,8.55,400,1\nB,46.4,8.6,400,1\n"
    )
    (project / "points.csv").write_text(rows)
    project.set(control="points.csv")
    wrong = read_inputs(project.path)
    with pytest.raises(InputError, match=r"all known points are far .* 'A' by 111 km"):
        transform_known(wrong, wrong.control, WORLD)


def test_local_coordinates_that_are_exchanged_are_named_by_where_the_points_were_found() -> None:
    found = np.array([110.0, -40.0, 1.0])
    assert "east and north exchanged" in explain_coordinates(np.array([-39.0, 111.0, 1.2]), found)
    assert explain_coordinates(np.array([111.0, -60.0, 1.2]), found) == ""
