"""What stands off the ground: every file has it at the height that results.json says."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pyogrio
import pytest
from ezdxf.document import Drawing
from ezdxf.entities.insert import Insert
from ezdxf.entities.line import Line
from ezdxf.filemanagement import readfile
from numpy.typing import NDArray
from planned_sample import HEIGHT_M, in_metres, sample_plan
from pyogrio import list_layers
from pyogrio.raw import read
from pyproj import Transformer
from raised_survey import RAISED, raised
from unsure import unsure

from uavgram.io.exports.dxf import write_dxf
from uavgram.io.exports.geojson_kml import dump_geojson, write_kml, write_layers_geojson
from uavgram.io.exports.gis import write_geopackage
from uavgram.io.exports.measurements_csv import dump_measurements_csv
from uavgram.io.exports.photogrammetry import write_colmap_model, write_gcp_list
from uavgram.io.results.results_json import dump_results, load_results
from uavgram.model.arrays import Floats
from uavgram.model.maps import Features
from uavgram.model.observations import Source
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import features_of
from uavgram.stages.products.planned_layers import plan_layers
from uavgram.views.style import LOOKS

UNDULATION_M = 46.3
KML = "{http://www.opengis.net/kml/2.2}"
Record = dict[str, Any]


@pytest.fixture(scope="module")
def solid(result: Result) -> Result:
    world = replace(result.world, undulation_m=UNDULATION_M)
    return raised(replace(result, world=world))


@pytest.fixture(scope="module")
def shapes(solid: Result) -> Features:
    return features_of(solid, solid.world.crs)


@pytest.fixture(scope="module")
def points(solid: Result) -> dict[str, Record]:
    """Of results.json, by their labels."""
    return {one["label"]: one for one in json.loads(dump_results(solid))["points"]}


def geojson_points(result: Result) -> tuple[Record, dict[str, Record]]:
    content = json.loads(dump_geojson(result))
    found = [f for f in content["features"] if f["properties"]["type"] == "point"]
    return content, {f["properties"]["label"]: f for f in found}


def test_results_tell_where_a_height_is_from(
    solid: Result, points: dict[str, Record], tmp_path: Path
) -> None:
    for label, told in RAISED.items():
        one = points[label]
        keys = ("height_above_ground_m", "height_sigma_m", "height_source")
        assert tuple(one[key] for key in keys) == told
    (tmp_path / "results.json").write_text(dump_results(solid), encoding="utf-8")
    again = load_results(tmp_path / "results.json")
    assert again.points.height_source == solid.points.height_source
    assert again.world == solid.world


def test_geojson_has_heights_above_the_ellipsoid(solid: Result, points: dict[str, Record]) -> None:
    """RFC 7946, 3.1.1: what stands third is above the WGS 84 ellipsoid; judged by PROJ."""
    content, found = geojson_points(solid)
    origin = solid.world.origin
    assert origin is not None
    to_earth: Any = Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 "
        f"+lat_0={origin.latitude_deg} +lon_0={origin.longitude_deg} +h_0={origin.height_m} "
        "+step +inv +proj=cart +ellps=WGS84"
    )
    assert set(found) == set(points)
    for label, feature in found.items():
        height = to_earth.transform(*points[label]["position_world_m"])[-1]
        assert feature["geometry"]["coordinates"][2] == pytest.approx(
            height + UNDULATION_M, abs=1e-5
        )
        own = feature["properties"]
        assert (own["height_m"], own["height_datum"]) == (pytest.approx(height, abs=1e-5), "msl")
        for key in ("height_above_ground_m", "height_sigma_m", "height_source", "covariance_m3"):
            assert own[key] == points[label][key]
        assert own["sigma_up_m"] == pytest.approx(own["covariance_m3"][2][2] ** 0.5)
    assert "message" not in content
    for feature in content["features"]:
        assert {len(place) for place in vertices(feature["geometry"])} <= {3}


def vertices(geometry: Record | None) -> list[list[float]]:
    if geometry is None:
        return []
    places = geometry["coordinates"]
    if geometry["type"] == "Polygon":
        return [place for ring in places for place in ring]
    return [places] if geometry["type"] == "Point" else list(places)


def test_geojson_gives_no_height_that_would_be_wrong(solid: Result) -> None:
    """Sea level taken for the ellipsoid would put the scene up to a hundred metres off."""
    unknown = replace(solid, world=replace(solid.world, undulation_m=None))
    content, found = geojson_points(unknown)

    assert "above mean sea level only" in content["message"]
    for feature in content["features"]:
        assert {len(place) for place in vertices(feature["geometry"])} <= {2}
    assert found["P00"]["properties"]["height_m"] == pytest.approx(519.2 + 1.402, abs=1e-3)
    stated = replace(unknown, world=replace(unknown.world, height_datum="ellipsoid"))
    _, found = geojson_points(stated)
    assert found["P00"]["geometry"]["coordinates"][2] == pytest.approx(519.2 + 1.402, abs=1e-3)


def test_the_geopackage_has_the_third_coordinate_and_lines_to_the_ground(
    shapes: Features, points: dict[str, Record], tmp_path: Path
) -> None:
    write_geopackage(shapes, tmp_path / "s.gpkg")
    places, fields = gpkg(tmp_path / "s.gpkg", "points")
    feet, of = gpkg(tmp_path / "s.gpkg", "verticals")

    for k, label in enumerate(fields["label"]):
        one = points[label]
        # the earth falls away below the tangent plane
        away = one["position_world_m"]
        fall = (away[0] ** 2 + away[1] ** 2) / 2 / 6.37e6
        assert places[k][0, 2] == pytest.approx(519.2 + away[2] + fall, abs=1e-4)
        assert fields["height_above_ground_m"][k] == one["height_above_ground_m"]
        assert fields["height_sigma_m"][k] == one["height_sigma_m"]
        assert fields["height_source"][k] == one["height_source"]
        assert fields["height_datum"][k] == "msl"
        assert fields["sigma_up_m"][k] == pytest.approx(one["covariance_m3"][2][2] ** 0.5)
    assert set(of["label"]) == set(RAISED)
    for label, (foot, top) in zip(of["label"], feet, strict=True):
        assert top[2] - foot[2] == pytest.approx(RAISED[label][0], abs=1e-6)
        np.testing.assert_allclose(top[:2], foot[:2], atol=1e-3)


def gpkg(path: Path, layer: str) -> tuple[list[Floats], dict[str, NDArray[Any]]]:
    meta, _, geometry, fields = read(path, layer=layer)
    head = {"points": 5, "verticals": 9}[layer]  # well-known binary: order, type, [count]
    shapes = [np.frombuffer(wkb[head:], "<f8").reshape(-1, 3) for wkb in geometry]
    return shapes, dict(zip(meta["fields"], fields, strict=True))


def test_without_anything_off_the_ground_there_is_no_such_layer(
    features: Features, tmp_path: Path
) -> None:
    write_geopackage(features, tmp_path / "s.gpkg")
    write_kml(features, tmp_path / "s.kml")

    assert "verticals" not in [name for name, _ in list_layers(tmp_path / "s.gpkg")]
    heights = ET.parse(tmp_path / "s.kml").iter(f"{KML}extrude")  # noqa: S314
    assert not list(heights)


def test_a_globe_draws_points_and_lines_over_its_terrain(shapes: Features, tmp_path: Path) -> None:
    write_kml(shapes, tmp_path / "s.kml")
    marks = {
        mark.findtext(f"{KML}name"): mark
        for mark in ET.parse(tmp_path / "s.kml").iter(f"{KML}Placemark")  # noqa: S314
        if mark.findtext(f"{KML}styleUrl") in {"#points", "#measured_lines"}
    }
    for label, (height, _, _) in RAISED.items():
        shape = marks[label].find(f"{KML}Point")
        assert shape is not None
        assert (shape[0].text, shape[1].text) == ("1", "relativeToGround")
        assert heights(shape) == pytest.approx([height], abs=1e-4)
    ground = marks["P01"].find(f"{KML}Point")
    assert ground is not None
    assert [part.tag for part in ground] == [f"{KML}coordinates"]
    line = marks["skid right"].find(f"{KML}LineString")  # from P07 to P16
    assert line is not None
    assert [part.tag for part in line] == [f"{KML}altitudeMode", f"{KML}coordinates"]
    assert heights(line) == pytest.approx([0.0, 2.25], abs=1e-4)


def heights(shape: ET.Element) -> list[float]:
    text = shape.findtext(f"{KML}coordinates") or ""
    return [float(place.split(",")[2]) for place in text.split()]


@pytest.fixture(scope="module", params=["local", "map"])
def drawing(
    request: pytest.FixtureRequest, shapes: Features, tmp_path_factory: pytest.TempPathFactory
) -> tuple[float, Drawing]:
    """Height of the world's zero, and the drawing."""
    path = tmp_path_factory.mktemp("dxf") / "s.dxf"
    write_dxf(shapes, path, LOOKS, on_map=request.param != "local")
    document = readfile(path)
    assert document.audit().errors == []
    assert document.audit().fixes == []
    return (0.0 if request.param == "local" else 519.2), document


def test_the_drawing_has_points_off_the_ground_on_a_layer_with_verticals(
    drawing: tuple[float, Drawing], points: dict[str, Record]
) -> None:
    zero, document = drawing
    space = document.modelspace()
    inserts = {
        insert.get_attrib_text("LABEL"): insert
        for insert in space.query('INSERT[name=="SURVEY_POINT"]')
        if isinstance(insert, Insert)
    }
    assert set(inserts) == set(points)
    for label, insert in inserts.items():
        off = label in RAISED
        assert insert.dxf.layer == ("POINTS_OFF_GROUND" if off else "POINTS")
        up = points[label]["position_world_m"][2]
        # the map's heights follow the earth, which falls away below the tangent plane
        assert insert.dxf.insert.z == pytest.approx(zero + up, abs=1e-9 if not zero else 4e-4)
        assert all(attribute.is_invisible for attribute in insert.attribs)
        for key in ("height_above_ground_m", "height_sigma_m") if off else ():
            said = float(insert.get_attrib_text(key.upper()))
            assert said == pytest.approx(points[label][key], abs=5e-5)
    lines = [
        (line.dxf.start, line.dxf.end)
        for line in space.query('LINE[layer=="HEIGHTS"]')
        if isinstance(line, Line)
    ]
    assert len(lines) == len(RAISED)
    tops = [tuple(inserts[label].dxf.insert) for label in points if label in RAISED]
    for (foot, top), place in zip(lines, tops, strict=True):
        assert tuple(top) == pytest.approx(place)
        assert foot.z == pytest.approx(zero, abs=4e-4)
    said_heights = {text.dxf.text for text in space.query('TEXT[layer=="HEIGHTS"]')}
    assert said_heights == {"+1.402 ±0.021", "+0.500 stated", "+2.250 ±0.040", "-0.800 ±0.050"}


def test_a_length_in_space_says_so_and_lies_at_its_height(
    drawing: tuple[float, Drawing], solid: Result
) -> None:
    zero, document = drawing
    rows = solid.measurements
    known = {f"{value:.3f}": name for name, value in zip(rows.name, rows.value, strict=True)}
    said = {}
    for dimension in document.modelspace().query('DIMENSION[layer=="DIMENSIONS"]'):
        name, value = dimension.dxf.text.split(": ")
        if value.split()[0] in known:
            said[name] = dimension
    assert said["skid right"].dxf.text.endswith(" m (3-D)")
    assert said["skid left"].dxf.text.endswith(" m")
    assert said["skid right"].dxf.defpoint2.z == pytest.approx(zero + 2.25 / 2, abs=1e-3)


def test_colmap_has_the_points_in_space(
    solid: Result, points: dict[str, Record], tmp_path: Path
) -> None:
    """As pycolmap reads it: POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK."""
    write_colmap_model(solid, tmp_path)
    rows = [r.split() for r in (tmp_path / "points3D.txt").read_text().splitlines() if r[0] != "#"]
    label = {k + 1: name for k, name in enumerate(solid.points.label)}
    picks = solid.picks
    used = np.isin(picks.status, ["used", "suspect"])

    assert {label[int(row[0])] for row in rows} >= set(RAISED)
    for row in rows:
        name = label[int(row[0])]
        place = [float(number) for number in row[1:4]]
        assert place == pytest.approx(points[name]["position_world_m"], abs=1e-6)
        own = used & (np.array(picks.label) == name)
        error = np.linalg.norm(picks.residual_px[own], axis=1).mean()
        assert float(row[7]) == pytest.approx(error, abs=1e-4)
        assert len(row[8:]) == 2 * own.sum()


def test_ground_control_has_the_heights(
    solid: Result, shapes: Features, points: dict[str, Record], tmp_path: Path
) -> None:
    write_gcp_list(solid, shapes, tmp_path / "gcp_list.txt")
    for line in (tmp_path / "gcp_list.txt").read_text().splitlines()[1:]:
        cells = line.split()
        up = points[cells[-1]]["position_world_m"][2]
        assert float(cells[2]) == pytest.approx(519.2 + up, abs=4e-4)


# A plan on maps: GDAL reads what is written, and everything lies where the plan has it.


PLAN = sample_plan()
FEATURES = plan_layers(PLAN)


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


# Who picked a point follows it into tables, maps and drawings.


@pytest.fixture(scope="module")
def found(result: Result) -> tuple[Result, str, str]:
    """The ends of a distance: one is a target, the other was picked once and matched."""
    rows = result.measurements
    target, matched = rows.points[rows.kind.index("distance")]
    first = result.picks.label.index(matched)
    sources: list[Source] = []
    for k, label in enumerate(result.picks.label):
        is_match = label == matched and k != first
        sources.append("target" if label == target else "match" if is_match else "hand")
    picks = replace(result.picks, source=tuple(sources))
    return replace(result, picks=picks), target, matched


def test_it_stands_in_the_table_of_measurements(found: tuple[Result, str, str]) -> None:
    result, target, matched = found
    for row in csv.DictReader(io.StringIO(dump_measurements_csv(result))):
        ends = set(row["points"].split(";"))
        said = set(row["picked_by"].split(";"))
        assert ("target" in said) == (target in ends)
        assert ("match" in said) == (matched in ends)


def test_it_stands_on_the_map(found: tuple[Result, str, str]) -> None:
    result, target, matched = found
    made = {
        one["properties"]["label"]: one["properties"]["picked_by"]
        for one in json.loads(dump_geojson(result))["features"]
        if one["properties"]["type"] == "point"
    }
    assert made.pop(target) == ["target"]
    assert made.pop(matched) == ["hand", "match"]
    assert set(map(tuple, made.values())) == {("hand",)}
    points = features_of(result, result.world.crs).layer("points").attributes
    said = dict(zip(points["label"], points["picked_by"], strict=True))
    assert (said[target], said[matched]) == ("target", "hand; match")


def test_it_stands_in_the_drawing_where_a_person_did_not_pick_alone(
    found: tuple[Result, str, str], tmp_path: Path
) -> None:
    result, target, matched = found
    write_dxf(features_of(result, result.world.crs), tmp_path / "d.dxf", LOOKS)
    said = {
        insert.get_attrib_text("LABEL"): insert.get_attrib_text("PICKED_BY")
        for insert in readfile(tmp_path / "d.dxf").modelspace().query("INSERT")
        if isinstance(insert, Insert) and insert.has_attrib("PICKED_BY")
    }
    assert said == {target: "target", matched: "hand; match"}


# What other solutions would change, in the CAD drawing, the GeoPackage and the globe.


NAME, KEPT = "road width", "31.2500;44.9000"


@pytest.fixture(scope="module")
def marked(result: Result) -> Features:
    return features_of(unsure(result, NAME, (31.25, 44.9)), result.world.crs)


def dxf_texts(features: Features, path: Path) -> tuple[list[str], str]:
    write_dxf(features, path, LOOKS)
    space = readfile(path).modelspace()
    (note,) = (t.dxf.text for t in space.query('TEXT[layer=="NOTES"]'))
    values = [d.dxf.text for d in space.query('DIMENSION[layer=="DIMENSIONS"]')]
    values += [t.dxf.text for t in space.query('TEXT[layer=="DIMENSIONS"]')]
    return values, note


def test_the_drawing_doubts_its_text_and_says_why(
    features: Features, marked: Features, tmp_path: Path
) -> None:
    sure, plain_note = dxf_texts(features, tmp_path / "sure.dxf")
    doubted, note = dxf_texts(marked, tmp_path / "doubted.dxf")

    assert set(doubted) - set(sure) == {"road width: 6.310 ±0.012 m ?"}
    assert "? = other solutions fit as well" in note
    assert not [text for text in (*sure, plain_note) if "?" in text]


def test_the_geopackage_and_the_globe_have_them_as_an_attribute(
    marked: Features, tmp_path: Path
) -> None:
    write_geopackage(marked, tmp_path / "s.gpkg")
    meta, _, _, fields = read(tmp_path / "s.gpkg", layer="measured_lines")
    table = dict(zip(meta["fields"], fields, strict=True))
    write_kml(marked, tmp_path / "s.kml")
    mark = "{http://www.opengis.net/kml/2.2}"
    tree = ET.parse(tmp_path / "s.kml")  # noqa: S314  (our own file)
    data = tree.iter(f"{mark}Data")
    said = [d[0].text for d in data if d.get("name") == "alternatives"]

    kept = dict(zip(table["name"], table["alternatives"], strict=True))
    assert kept[NAME] == KEPT
    assert [name for name, text in kept.items() if text] == [NAME]
    assert said == [KEPT]


# What other solutions would change, in results.json, measurements.csv and points.geojson.


@pytest.fixture
def marked_result(sample_result: Result) -> Result:
    return unsure(sample_result, "o", (31.25, 44.9))


def test_results_json_has_them_with_the_measurement_and_gives_them_back(
    marked_result: Result, tmp_path: Path
) -> None:
    path = tmp_path / "results.json"
    path.write_text(dump_results(marked_result), encoding="utf-8")
    kept = {
        m["name"]: m["alternative_values"] for m in json.loads(path.read_text())["measurements"]
    }

    assert kept == {**{name: [] for name in kept}, "o": [31.25, 44.9]}
    back = load_results(path)
    assert back.measurements.alternative_values == marked_result.measurements.alternative_values
    assert dump_results(back) == dump_results(marked_result)


def test_the_csv_joins_them(marked_result: Result) -> None:
    rows = list(csv.DictReader(io.StringIO(dump_measurements_csv(marked_result))))

    assert [row["alternatives"] for row in rows] == ["", "", "31.25000;44.90000", "", "", ""]


def test_the_geojson_lists_them(marked_result: Result) -> None:
    features = json.loads(dump_geojson(marked_result))["features"]
    kept = {
        f["properties"]["name"]: f["properties"]["alternative_values"]
        for f in features
        if f["properties"]["type"] == "measurement"
    }

    assert kept == {**{name: [] for name in kept}, "o": [31.25, 44.9]}
