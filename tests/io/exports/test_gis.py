"""survey.gpkg, read back by GDAL; places judged by pyproj."""

from __future__ import annotations

import sqlite3
import struct
import warnings
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import rasterio
import synthetic_survey
from numpy.typing import NDArray
from pyogrio import list_layers, read_info
from pyogrio.raw import read
from pyproj import CRS, Geod, Proj, Transformer
from rasterio.transform import xy

from uavgram.geometry.geodesy import projected_from_enu
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.io.exports.gis import write_geopackage
from uavgram.model.arrays import Floats
from uavgram.model.maps import Features, Layer
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.exports import make_writers
from uavgram.views.formatting import NOT_COMPUTED, measurement_text

Objects = NDArray[np.object_]


@pytest.fixture(scope="module")
def path(features: Features, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("gpkg") / "survey.gpkg"
    write_geopackage(features, path)
    return path


def columns(path: Path, layer: str) -> tuple[Objects, dict[str, NDArray[Any]]]:
    meta, _, geometry, fields = read(path, layer=layer)
    return geometry, dict(zip(meta["fields"], fields, strict=True))


def points_of(geometry: Objects) -> Floats:
    return np.array([np.frombuffer(wkb[5:], "<f8") for wkb in geometry])


def test_every_layer_is_there_with_its_crs_and_all_its_rows(path: Path, features: Features) -> None:
    assert [name for name, _ in list_layers(path)] == [layer.name for layer in features.layers]
    for layer in features.layers:
        info = read_info(path, layer=layer.name)
        assert CRS.from_user_input(info["crs"]) == CRS.from_user_input(features.crs)
        assert info["features"] == len(layer)
        assert list(info["fields"]) == list(layer.attributes)


def test_points_lie_where_their_latitude_and_longitude_say(path: Path, result: Result) -> None:
    geometry, fields = columns(path, "points")
    to_earth = Transformer.from_crs(result.world.crs, "EPSG:4326", always_xy=True)
    longitude, latitude = to_earth.transform(*points_of(geometry)[:, :2].T)

    _, _, apart = Geod(ellps="WGS84").inv(
        longitude, latitude, result.points.longitude_deg, result.points.latitude_deg
    )
    assert list(fields["label"]) == list(result.points.label)
    assert np.max(apart) < 1e-4


def test_distances_over_the_maps_scale_are_those_between_the_points(
    path: Path, result: Result
) -> None:
    geometry, _ = columns(path, "points")
    on_map, true = points_of(geometry), result.points.position_world_m
    assert result.world.origin is not None
    factors = Proj(result.world.crs).get_factors(
        result.world.origin.longitude_deg, result.world.origin.latitude_deg
    )
    # the ground lies half a kilometre above the ellipsoid, which stretches it
    scale = factors.meridional_scale / (1.0 + result.world.origin.height_m / 6.38e6)

    planar = np.linalg.norm(on_map[1:, :2] - on_map[0, :2], axis=1) / scale
    expected = np.linalg.norm(true[1:, :2] - true[0, :2], axis=1)
    np.testing.assert_allclose(planar, expected, rtol=2e-5, atol=1e-4)


def test_missing_numbers_are_null_not_a_number_to_sort_by(path: Path, result: Result) -> None:
    _, fields = columns(path, "known_lengths")
    unseen = np.array([s == "unseen" for s in result.lines.status])

    assert unseen.any()
    assert np.isnan(fields["adjusted_m"][unseen]).all()
    np.testing.assert_array_equal(fields["length_m"], result.lines.length_m)


def test_a_layer_without_shapes_is_left_out(features: Features, tmp_path: Path) -> None:
    first, *others = features.layers
    empty = replace(
        first, vertices_m=(), above_ground_m=(), attributes=dict.fromkeys(first.attributes, ())
    )
    path = tmp_path / "some.gpkg"
    write_geopackage(replace(features, layers=(empty, *others)), path)

    assert len(first) > 0
    with closing(sqlite3.connect(path)) as file:
        tables = {name for (name,) in file.execute("SELECT name FROM sqlite_master")}
    assert first.name not in tables
    assert {str(name) for name, _ in list_layers(path)} == {one.name for one in others if len(one)}


def test_a_path_of_any_length_does(features: Features, path: Path, tmp_path: Path) -> None:
    deep = tmp_path.joinpath(*["long" * 30] * 5)
    deep.mkdir(parents=True)
    write_geopackage(features, deep / "survey.gpkg")

    assert len(str(deep)) > 512
    assert (deep / "survey.gpkg").read_bytes()[:16] == path.read_bytes()[:16]


def test_older_programs_can_read_it_and_it_says_what_heights_are_above(path: Path) -> None:
    with closing(sqlite3.connect(path)) as file:
        (version,) = file.execute("PRAGMA user_version").fetchone()
        told = file.execute("SELECT DISTINCT description FROM gpkg_contents").fetchall()

    assert version == 10300  # GDAL 3.6 warns of 1.4
    assert told == [("heights in metres above mean sea level",)]


def test_without_a_place_on_earth_it_holds_local_metres(adrift: Features, tmp_path: Path) -> None:
    write_geopackage(adrift, tmp_path / "local.gpkg")
    geometry, fields = columns(tmp_path / "local.gpkg", "points")

    assert "local metres" in read_info(tmp_path / "local.gpkg", layer="points")["crs"]
    np.testing.assert_allclose(points_of(geometry)[:, 0], fields["east_m"], atol=1e-12)


@pytest.mark.parametrize(
    "crs", ["EPSG:32632+5773", "ESRI:102032", "+proj=tmerc +lon_0=8.5 +ellps=bessel +units=m"]
)
def test_systems_beside_those_of_epsg_are_told_in_full(
    features: Features, tmp_path: Path, crs: str
) -> None:
    write_geopackage(replace(features, crs=crs), tmp_path / "survey.gpkg")
    told, _, _, _ = read(tmp_path / "survey.gpkg", layer="points")
    known, expected = CRS.from_user_input(told["crs"]), CRS.from_user_input(crs)
    assert known.equals(expected, ignore_axis_order=True) or known.to_proj4() == expected.to_proj4()


def test_the_bounds_that_it_states_are_those_of_its_shapes(path: Path) -> None:
    with closing(sqlite3.connect(path)) as file:
        stated = {
            name: bounds
            for name, *bounds in file.execute(
                "SELECT table_name, min_x, min_y, max_x, max_y FROM gpkg_contents"
            )
        }
        assert file.execute("PRAGMA foreign_key_check").fetchall() == []
        assert file.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    for layer, _ in list_layers(path):
        np.testing.assert_allclose(
            stated[layer], read_info(path, layer=layer, force_total_bounds=True)["total_bounds"]
        )


def test_each_shape_states_the_bounds_of_its_vertices(features: Features, tmp_path: Path) -> None:
    path = tmp_path / "gaps.gpkg"
    layers = [
        with_a_gap(features.layer(name)) for name in ("points", "measured_lines", "footprints")
    ]
    write_geopackage(replace(features, layers=tuple(layers)), path)
    for layer, start in zip(layers, (5, 9, 13), strict=True):  # of the vertices, in WKB
        there = [len(vertices) > 0 for vertices in layer.vertices_m]
        coded = read(path, layer=layer.name)[2][there]
        places = [np.frombuffer(wkb[start:], "<f8").reshape(-1, 3)[:, :2] for wkb in coded]
        bounds = np.array([[p.min(axis=0), p.max(axis=0)] for p in places])
        with closing(sqlite3.connect(path)) as file:
            ask = "SELECT min_x, min_y, max_x, max_y FROM gpkg_contents WHERE table_name = ?"
            stated = np.reshape(file.execute(ask, (layer.name,)).fetchone(), (2, 2))
            ask = f"SELECT geom FROM {layer.name} WHERE geom NOT NULL"  # noqa: S608 - ours
            heads = [geom[8:40] for (geom,) in file.execute(ask)]

        np.testing.assert_array_equal(stated, [bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])
        axes = bounds.transpose(0, 2, 1).reshape(-1, 4)  # west, east, south, north
        if layer.kind != "point":
            np.testing.assert_array_equal([struct.unpack("<4d", head) for head in heads], axes)


def with_a_gap(layer: Layer) -> Layer:
    """The second shape has no place."""
    first, _, *others = layer.vertices_m
    assert others
    return replace(layer, vertices_m=(first, np.zeros((0, 3)), *others), above_ground_m=())


def test_gdal_reads_it_without_a_warning(path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for layer, _ in list_layers(path):
            read(path, layer=layer)


# Styles in the GeoPackage and the QGIS project, by what QGIS itself asks of them.


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
