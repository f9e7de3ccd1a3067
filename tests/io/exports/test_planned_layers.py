"""A plan on maps: GDAL reads what is written, and everything lies where the plan has it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pyogrio
import pytest
from planned_sample import HEIGHT_M, in_metres, sample_plan

from uavgram.io.exports.geojson import write_layers_geojson
from uavgram.io.exports.kml import write_kml
from uavgram.stages.products.planned_layers import plan_layers
from uavgram.views.map_styles import LOOKS

PLAN = sample_plan()
FEATURES = plan_layers(PLAN)
KML = "{http://www.opengis.net/kml/2.2}"


@pytest.fixture(scope="module")
def geojson(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plan") / "plan.geojson"
    write_layers_geojson(FEATURES, path)
    return path


def of_layer(path: Path, name: str) -> list[Any]:
    every = json.loads(path.read_text(encoding="utf-8"))["features"]
    return [one for one in every if one["properties"]["layer"] == name]


def test_gdal_reads_every_feature(geojson: Path) -> None:
    meta, _, geometry, _ = pyogrio.raw.read(geojson)
    assert len(geometry) == sum(map(len, FEATURES.layers))
    assert meta["crs"] == "EPSG:4326"


def test_lines_to_lay_and_photos_are_where_they_are_planned(geojson: Path) -> None:
    lines = of_layer(geojson, "planned_lines")
    for k, line in enumerate(lines):
        drawn = in_metres(line["geometry"]["coordinates"])
        np.testing.assert_allclose(drawn[0], PLAN.lines.start_world_m[k, :2], atol=2e-3)
        np.testing.assert_allclose(drawn[1], PLAN.lines.end_world_m[k, :2], atol=2e-3)
        assert line["properties"]["length_m"] == pytest.approx(
            np.linalg.norm(drawn[1] - drawn[0]), abs=3e-3
        )
    photos = of_layer(geojson, "planned_photos")
    places = in_metres([photo["geometry"]["coordinates"] for photo in photos])
    np.testing.assert_allclose(places, PLAN.frames.center_world_m[:, :2], atol=5e-3)
    assert [photo["properties"]["frame"] for photo in photos] == list(PLAN.frames.name)


def test_rings_are_closed_and_go_round_against_the_clock(geojson: Path) -> None:
    for name in ("planned_area", "planned_no_go", "planned_footprints", "planned_accuracy"):
        for one in of_layer(geojson, name):
            (ring,) = one["geometry"]["coordinates"]
            assert ring[0] == ring[-1]
            x, y = in_metres(ring).T
            assert np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0


def test_what_cannot_be_measured_has_no_number(geojson: Path) -> None:
    sigmas = [one["properties"]["sigma_m"] for one in of_layer(geojson, "planned_accuracy")]
    assert sigmas.count(None) == np.isnan(PLAN.grid.sigma_m).sum()


def test_a_globe_shows_the_same_with_photos_in_the_air(tmp_path: Path) -> None:
    write_kml(FEATURES, tmp_path / "plan.kml", LOOKS)
    root = ET.parse(tmp_path / "plan.kml").getroot()  # noqa: S314 (our own file)
    folders = {
        folder.findtext(f"{KML}name"): folder.findall(f"{KML}Placemark")
        for folder in root.iter(f"{KML}Folder")
    }
    shown = {layer.name: len(layer) for layer in FEATURES.layers}
    assert len(folders["Lines to lay and tape"]) == shown["planned_lines"]
    assert len(folders["Keep out"]) == shown["planned_no_go"]
    assert len(folders) == len(shown) - 1  # the map of the accuracy would hide the ground
    photo = folders["Photos to take"][0]
    longitude, latitude, height = map(
        float, photo.findtext(f".//{KML}coordinates", default="").split(",")
    )
    assert height == HEIGHT_M
    assert photo.findtext(f".//{KML}altitudeMode") == "relativeToGround"
    place = in_metres(np.array([[longitude, latitude]]))
    np.testing.assert_allclose(place[0], PLAN.frames.center_world_m[0, :2], atol=5e-3)
