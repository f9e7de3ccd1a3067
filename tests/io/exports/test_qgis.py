"""Styles in the GeoPackage and the QGIS project, by what QGIS itself asks of them."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import rasterio
import synthetic_survey
from pyogrio import list_layers
from pyogrio.raw import read
from pyproj import CRS
from rasterio.transform import xy

from uavgram.geometry.earth.geodesy import projected_from_enu
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.exports import make_writers
from uavgram.views.formatting import NOT_COMPUTED, measurement_text

TEXTURE = GroundTexture(
    rgb=np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3),
    covered=np.arange(24).reshape(4, 6) > 3,
    west_m=-30.0,
    north_m=42.0,
    pixel_size_m=2.5,
)


@pytest.fixture(scope="module")
def folder(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("maps")
    written(result, folder, TEXTURE)
    return folder


def written(result: Result, folder: Path, texture: GroundTexture | None) -> None:
    writers = make_writers(result, texture)
    for name in {"survey.gpkg", "survey.qgs", "ground.tif"} & set(writers):
        writers[name](folder / name)


def project(folder: Path) -> ET.Element:
    return ET.parse(folder / "survey.qgs").getroot()  # noqa: S314 - our own


def test_the_geopackage_has_a_default_style_for_every_layer(folder: Path) -> None:
    with closing(sqlite3.connect(folder / "survey.gpkg")) as file:
        rows = file.execute(
            "SELECT f_table_name, f_geometry_column, styleQML, useAsDefault FROM layer_styles"
        ).fetchall()
        columns = dict(file.execute("SELECT table_name, column_name FROM gpkg_geometry_columns"))

    assert {name: column for name, column, _, _ in rows} == columns
    for _, _, style, is_default in rows:
        root = ET.fromstring(style)  # noqa: S314 - our own
        assert is_default == 1
        assert root.tag == "qgis"
        assert root.find("renderer-v2/symbols/symbol/layer/prop") is not None


def test_the_texts_beside_measured_lines_are_those_of_the_report(
    folder: Path, result: Result
) -> None:
    rows = result.measurements
    told = {rows.name[i]: measurement_text(rows, i).value for i in range(len(rows.name))}
    meta, _, _, fields = read(folder / "survey.gpkg", layer="measured_lines")
    columns = dict(zip(meta["fields"], fields, strict=True))

    assert len(columns["name"])
    for name, text in zip(columns["name"], columns["text"], strict=True):
        assert text == f"{name}: {told[name]}".replace(NOT_COMPUTED, "–")


def test_the_project_names_layers_that_are_there_relative_to_itself(folder: Path) -> None:
    root = project(folder)
    there = {name for name, _ in list_layers(folder / "survey.gpkg")}
    sources = {
        one.findtext("id", ""): one.findtext("datasource", "") for one in root.iter("maplayer")
    }
    tree = [one.attrib for one in root.iter("layer-tree-layer")]

    assert [one["id"] for one in tree] == list(sources)
    assert tree[0]["name"] == "points"
    assert sources.popitem()[1] == "./ground.tif"
    for name, source in sources.items():
        assert len(name) > 10  # QGIS gives others to shorter ones, and loses them in its tree
        assert source.removeprefix("./survey.gpkg|layername=") in there
    assert root.findtext("properties/Paths/Absolute") == "false"


def test_the_project_is_in_the_surveys_coordinate_system(folder: Path, result: Result) -> None:
    root = project(folder)
    named = [node.text for node in root.iter("authid")]
    extent = [float(root.findtext(f"mapcanvas/extent/{k}") or "") for k in ("xmin", "ymax")]
    assert result.world.crs is not None
    assert result.world.origin is not None
    points = projected_from_enu(
        result.points.position_world_m, result.world.origin, result.world.crs
    )

    assert set(named) == {result.world.crs}
    assert len(named) == len(list(root.iter("maplayer"))) + 2
    assert root.findtext("properties/SpatialRefSys/ProjectionsEnabled") == "1"
    assert extent[0] < points[:, 0].min()
    assert extent[1] > points[:, 1].max()


def test_the_ground_lies_where_local_metres_lie_on_the_map(folder: Path, result: Result) -> None:
    assert result.world.crs is not None
    assert result.world.origin is not None
    east = TEXTURE.west_m + 2.5 * np.array([0.5, 5.5, 2.5])
    north = TEXTURE.north_m - 2.5 * np.array([0.5, 3.5, 1.5])
    local = np.stack([east, north, np.zeros(3)], axis=1)
    true = projected_from_enu(local, result.world.origin, result.world.crs)[:, :2]
    with rasterio.open(folder / "ground.tif") as file:
        placed = np.column_stack(xy(file.transform, [0, 3, 1], [0, 5, 2]))
        pixels, crs = file.read(), file.crs

    assert placed == pytest.approx(true, abs=1e-3)
    assert CRS.from_user_input(crs.to_wkt()) == CRS.from_user_input(result.world.crs)
    assert (np.moveaxis(pixels[:3], 0, 2) == TEXTURE.rgb).all()
    assert ((pixels[3] == 255) == TEXTURE.covered).all()


def test_without_a_place_on_earth_it_opens_in_local_metres(tmp_path: Path) -> None:
    adrift = synthetic_survey.build(telemetry=False)
    written(adrift, tmp_path, None)
    root = project(tmp_path)

    assert not list(root.iter("authid"))
    assert root.findtext("properties/SpatialRefSys/ProjectionsEnabled") == "0"
    assert "ground.tif" not in ET.tostring(root, "unicode")
