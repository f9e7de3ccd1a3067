"""points.geojson against RFC 7946, with distances judged by pyproj."""

from __future__ import annotations

import json
import sqlite3
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import synthetic_survey as survey
from ezdxf.filemanagement import readfile
from pyogrio import list_layers
from pyogrio.raw import read
from pyproj import Geod

from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.io.exports.dxf import write_dxf
from uavgram.io.exports.geojson_kml import dump_geojson, write_geojson, write_kml
from uavgram.io.exports.gis import write_geopackage, write_qgis_project
from uavgram.model.maps import Features, Layer, LayerStyle
from uavgram.model.observations import MEASUREMENT_FORMS, MeasurementKind
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import features_of

Feature = dict[str, Any]

GEOD = Geod(ellps="WGS84")


@pytest.fixture
def point_features(sample_result: Result) -> list[Feature]:
    return features_in(sample_result)


def placed(result: Result) -> Result:
    """The result with its points in the world where they are on the earth."""
    points, world = result.points, result.world
    assert world.origin is not None
    height_m = np.full(len(points.label), world.origin.height_m)
    enu = enu_from_geodetic(points.latitude_deg, points.longitude_deg, height_m, world.origin)
    return replace(result, points=replace(points, position_world_m=enu))


def near(longitude: float, latitude: float) -> Any:  # noqa: ANN401
    return pytest.approx([longitude, latitude], abs=1e-11)


def features_in(result: Result) -> list[Feature]:
    result = placed(result)
    content = json.loads(dump_geojson(result))
    assert content["type"] == "FeatureCollection"
    assert all(set(f) == {"type", "geometry", "properties"} for f in content["features"])
    found: list[Feature] = content["features"]
    return found


def of_type(point_features: list[Feature], kind: str) -> list[Feature]:
    return [f for f in point_features if f["properties"]["type"] == kind]


def test_points_are_longitude_then_latitude(point_features: list[Feature]) -> None:
    first = of_type(point_features, "point")[0]

    assert first["geometry"] == {"type": "Point", "coordinates": near(-104.6, 50.1)}
    assert first["properties"]["label"] == "P"
    assert first["properties"]["frames"] == ["a.jpg", "b.jpg"]
    assert np.shape(first["properties"]["covariance_m2"]) == (2, 2)


def test_an_ellipse_has_its_axes_in_metres_and_its_azimuth_from_north(
    point_features: list[Feature],
) -> None:
    ring = np.array(of_type(point_features, "ellipse_95")[2]["geometry"]["coordinates"][0])
    centre = np.tile([-104.5999, 50.1001], (len(ring), 1))

    azimuth, _, distance = GEOD.inv(*centre.T, *ring.T)
    farthest = np.argmax(distance)
    # metres at the height of the ground, which are shorter on the ellipsoid below
    assert distance.max() == pytest.approx(5.0, rel=2e-4)
    assert distance.min() == pytest.approx(1.0, rel=2e-4)
    assert azimuth[farthest] % 180 == pytest.approx(np.rad2deg(3.1), abs=1e-4)


def test_every_ring_is_closed_and_counterclockwise(point_features: list[Feature]) -> None:
    rings = [f["geometry"]["coordinates"][0] for f in point_features if _is_polygon(f)]

    assert len(rings) == 4
    for ring in rings:
        assert ring[0] == ring[-1]
        x, y = (np.array(ring) - ring[0]).T
        assert np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0


def _is_polygon(feature: Feature) -> bool:
    return feature["geometry"] is not None and feature["geometry"]["type"] == "Polygon"


def test_measurements_are_drawn_by_their_kind(point_features: list[Feature]) -> None:
    shapes = {
        f["properties"]["kind"]: f["geometry"] for f in of_type(point_features, "measurement")
    }

    assert shapes["distance"]["type"] == "LineString"
    assert shapes["distance"]["coordinates"] == [near(-104.6, 50.1), near(-104.5999, 50.1001)]
    assert shapes["area"]["type"] == "Polygon"
    assert shapes["angle"]["coordinates"][1] == near(-104.6003, 50.1002)
    assert shapes["coordinate"] == {"type": "Point", "coordinates": near(-104.6, 50.1)}
    assert shapes["skid_speed"] is None  # one of its points was never seen


def test_a_line_distance_is_drawn_perpendicular_to_its_line(point_features: list[Feature]) -> None:
    shapes = {
        f["properties"]["kind"]: f["geometry"] for f in of_type(point_features, "measurement")
    }
    point, foot = shapes["line_distance"]["coordinates"]

    along, _, _ = GEOD.inv(-104.6003, 50.1002, -104.5999, 50.1001)
    across, _, _ = GEOD.inv(*point, *foot)
    on_line, _, _ = GEOD.inv(-104.6003, 50.1002, *foot)
    assert (along - across) % 180 == pytest.approx(90, abs=0.5)
    assert (along - on_line + 90) % 180 == pytest.approx(90, abs=0.01)


def test_every_kind_has_a_shape(sample_result: Result) -> None:
    rows = sample_result.measurements
    kinds: tuple[MeasurementKind, ...] = get_args(MeasurementKind)
    for kind in kinds:
        count = MEASUREMENT_FORMS[kind].points[0]
        measured = replace(
            rows,
            kind=(kind,) * len(rows.name),
            points=(("P", "Q;ü", "R", "P")[:count],) * len(rows.name),
        )
        drawn = of_type(features_in(replace(sample_result, measurements=measured)), "measurement")
        assert all(feature["geometry"] is not None for feature in drawn), kind


def test_a_volume_is_drawn_without_its_top_and_the_points_of_its_plane(
    sample_result: Result,
) -> None:
    rows = sample_result.measurements
    corners = ("P", "Q;ü", "R")
    measured = replace(
        rows,
        kind=("volume",) * len(rows.name),
        points=((*corners, "P", "R", "P", "Q;ü"),) * len(rows.name),
        parameters=("top=1.0;plane=1.0",) * len(rows.name),
    )
    drawn = of_type(features_in(replace(sample_result, measurements=measured)), "measurement")
    assert {len(feature["geometry"]["coordinates"][0]) for feature in drawn} == {4}


def test_values_that_cannot_be_computed_are_null(point_features: list[Feature]) -> None:
    skid = next(f for f in point_features if f["properties"].get("kind") == "skid_speed")

    assert skid["properties"]["value"] is None
    assert skid["properties"]["upper_95"] is None


@pytest.mark.parametrize("gauge", ["plane", "world"])
def test_without_a_place_on_earth_it_is_empty_and_says_why(
    sample_result: Result, tmp_path: Path, gauge: Literal["plane", "world"]
) -> None:
    world = replace(sample_result.world, origin=None, gauge=gauge)
    path = tmp_path / "points.geojson"
    write_geojson(replace(sample_result, world=world), path)

    content = json.loads(path.read_text(encoding="utf-8"))
    assert content["features"] == []
    assert "no geographic position" in content["message"]


LOOKS = {"sight_lines": LayerStyle(title="lines of sight", colour="#555555", width_mm=0.2)}


def test_every_file_has_a_new_layer(tmp_path: Path) -> None:
    result = survey.build(frame_count=3)
    center, point = result.frames.refined.center_world_m[0], result.points.position_world_m[0]
    strips = (np.stack([np.nan_to_num(center), point]),)
    sights = Layer(
        name="sight_lines", kind="line", vertices_m=strips, attributes={"label": ("P00",)}
    )
    features = features_of(result, "EPSG:32632")
    features = replace(features, layers=(*features.layers, sights))
    write_geopackage(features, tmp_path / "a.gpkg", LOOKS)
    write_kml(features, tmp_path / "a.kml", LOOKS)
    write_dxf(features, tmp_path / "a.dxf", LOOKS)
    write_qgis_project(features, LOOKS, tmp_path / "a.qgs", has_ground=False)

    file = sqlite3.connect(tmp_path / "a.gpkg")
    assert file.execute("SELECT label FROM sight_lines").fetchall() == [("P00",)]
    file.close()
    assert "<name>Lines of sight</name>" in (tmp_path / "a.kml").read_text(encoding="utf-8")
    assert "lines of sight" in (tmp_path / "a.qgs").read_text(encoding="utf-8")
    drawn = readfile(tmp_path / "a.dxf").modelspace().query('*[layer=="SIGHT_LINES"]')
    assert len(drawn) == 1


def test_shapes_without_any_place_are_written(tmp_path: Path) -> None:
    nowhere = Layer(
        name="points",
        kind="point",
        vertices_m=(np.zeros((0, 3)), np.zeros((0, 3))),
        attributes={"label": ("P00", "P01")},
        above_ground_m=(np.zeros(0), np.zeros(0)),
    )
    features = features_of(survey.build(frame_count=3), "EPSG:32632")
    write_kml(replace(features, layers=(nowhere,)), tmp_path / "a.kml", LOOKS)
    assert "<name>Points" in (tmp_path / "a.kml").read_text(encoding="utf-8")


# survey.kml, read back by GDAL and as XML.


KML = "{http://www.opengis.net/kml/2.2}"


def test_gdal_finds_every_layer_and_the_points_in_their_places(
    features: Features, result: Result, tmp_path: Path
) -> None:
    path = tmp_path / "survey.kml"
    write_kml(features, path)

    assert "Points" in [name for name, _ in list_layers(path)]
    meta, _, geometry, fields = read(path, layer="Points")
    names = dict(zip(meta["fields"], fields, strict=True))["Name"]
    assert list(names) == list(result.points.label)
    lonlat = np.array([np.frombuffer(wkb[5:21], "<f8") for wkb in geometry])
    np.testing.assert_allclose(lonlat[:, 0], result.points.longitude_deg, atol=1e-11)
    np.testing.assert_allclose(lonlat[:, 1], result.points.latitude_deg, atol=1e-11)


def test_labels_are_text_whatever_they_hold(result: Result, tmp_path: Path) -> None:
    from dataclasses import replace

    from uavgram.stages.products.map_layers import features_of

    nasty = ("<b>&", *result.points.label[1:])
    changed = replace(result, points=replace(result.points, label=nasty))
    write_kml(features_of(changed, result.world.crs), tmp_path / "s.kml")
    tree = ET.parse(tmp_path / "s.kml")  # noqa: S314  (our own file)

    assert "<b>&" in [e.text for e in tree.iter(f"{KML}name")]


def test_without_a_place_on_earth_it_says_why_it_is_empty(adrift: Features, tmp_path: Path) -> None:
    write_kml(adrift, tmp_path / "s.kml")
    tree = ET.parse(tmp_path / "s.kml")  # noqa: S314

    assert not list(tree.iter(f"{KML}Placemark"))
    assert "Nothing ties" in (next(tree.iter(f"{KML}description")).text or "")
