"""What goes on to maps, drawings and other programs says the same as results.json."""

from __future__ import annotations

import itertools
import json
import math
import struct
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from ezdxf.entities.insert import Insert
from ezdxf.filemanagement import readfile
from flight_projects import Demo
from pyogrio import list_layers
from pyogrio.raw import read
from pyproj import Geod, Proj, Transformer

from uavgram.io.logs.flight_log import read_flight_log
from uavgram.model.arrays import Floats
from uavgram.views.units import format_quantity

Content = dict[str, Any]
"""Of results.json."""

DISTANCE_M = 1e-4  # a tenth of a millimetre
KML = "{http://www.opengis.net/kml/2.2}"
OPENDRONEMAP = ("opendronemap/gcp_list.txt", "opendronemap/geo.txt")
COLMAP = tuple(
    f"colmap/{name}" for name in ("cameras.txt", "images.txt", "points3D.txt", "pose_priors.csv")
)
DRAWINGS = ("survey_local.dxf", "survey_map.dxf", "survey.gpkg", "survey.kml")


@pytest.fixture(scope="module")
def content(demo: Demo) -> Content:
    known: Content = json.loads((demo.out / "results.json").read_text(encoding="utf-8"))
    return known


@pytest.fixture(scope="module")
def places(content: Content) -> dict[str, Floats]:
    return {p["label"]: np.array(p["position_world_m"]) for p in content["points"]}


def dxf_points(path: Path) -> dict[str, Floats]:
    document = readfile(path)
    assert document.audit().errors == []
    assert document.audit().fixes == []
    return {
        insert.get_attrib_text("LABEL"): np.array(insert.dxf.insert)
        for insert in document.modelspace().query('INSERT[name=="SURVEY_POINT"]')
        if isinstance(insert, Insert)
    }


def test_the_files_are_where_the_readme_says(demo: Demo) -> None:
    for name in (*OPENDRONEMAP, *COLMAP, *DRAWINGS):
        assert (demo.out / name).stat().st_size > 0, name


def test_every_distance_in_the_local_drawing_is_that_of_the_results(
    demo: Demo, places: dict[str, Floats]
) -> None:
    drawn = dxf_points(demo.out / "survey_local.dxf")

    assert set(drawn) == set(places)
    for one, two in itertools.combinations(places, 2):
        true = math.dist(places[one], places[two])
        assert math.dist(drawn[one], drawn[two]) == pytest.approx(true, abs=DISTANCE_M)


def test_heights_on_the_map_are_above_the_ellipsoid_as_the_log_says(
    demo: Demo, content: Content
) -> None:
    world = content["world"]
    log = read_flight_log(next(demo.project.parent.glob("flight.*")))
    shapes = json.loads((demo.out / "points.geojson").read_text(encoding="utf-8"))
    assert world["undulation_m"] == pytest.approx(log.undulation_m)
    assert abs(log.undulation_m) > 10.0
    assert world["height_datum"] == "msl"
    drawn = [f for f in shapes["features"] if f["properties"]["type"] == "point"]
    assert len(drawn) == len(content["points"])
    for feature, point in zip(drawn, content["points"], strict=True):
        above_sea = world["height_m"] + point["position_world_m"][2]
        height = feature["geometry"]["coordinates"][2]
        # the earth falls away by millimetres below the tangent plane
        assert height == pytest.approx(above_sea + world["undulation_m"], abs=5e-3)
        assert feature["properties"]["height_m"] == pytest.approx(above_sea, abs=5e-3)


def test_measured_distances_are_the_dimensions_of_the_drawing(demo: Demo, content: Content) -> None:
    drawn = dxf_points(demo.out / "survey_local.dxf")
    said = [
        dimension.dxf.text
        for dimension in readfile(demo.out / "survey_local.dxf")
        .modelspace()
        .query('DIMENSION[layer=="DIMENSIONS"]')
    ]
    tried = 0
    for measured in content["measurements"]:
        if measured["kind"] == "distance" and measured["value"] is not None:
            ends = [drawn[label] for label in measured["points"]]
            assert math.dist(*ends) == pytest.approx(measured["value"], abs=DISTANCE_M)
            told = format_quantity(measured["value"], measured["sigma"], "m")
            assert f"{measured['name']}: {told}" in said
            tried += 1
    assert tried > 3


def ground_length(one: Floats, two: Floats, crs: str, height_m: float) -> float:
    """Length [m] on the ellipsoid between map places, raised to a height."""
    to_earth = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    (lon1, lat1), (lon2, lat2) = (to_earth.transform(*p[:2]) for p in (one, two))
    azimuth, _, length = Geod(ellps="WGS84").inv(lon1, lat1, lon2, lat2)
    # radius of curvature in that azimuth (Euler), for what a height adds
    a, e2 = 6378137.0, 0.0066943799901413165
    w = 1 - e2 * math.sin(math.radians(lat1)) ** 2
    meridian, normal = a * (1 - e2) / w**1.5, a / math.sqrt(w)
    c, s = math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth))
    raised: float = length * (1 + height_m * (c * c / meridian + s * s / normal))
    return raised


@pytest.mark.parametrize("name", ["survey.gpkg", "survey_map.dxf"])
def test_every_distance_on_the_map_is_that_of_the_results_after_its_scale(
    demo: Demo, content: Content, places: dict[str, Floats], name: str
) -> None:
    world, path = content["world"], demo.out / name
    if name == "survey.gpkg":
        meta, _, geometry, fields = read(path, layer="points")
        labels = dict(zip(meta["fields"], fields, strict=True))["label"]
        drawn = {
            label: np.array(struct.unpack("<3d", wkb[5:29]))
            for label, wkb in zip(labels, geometry, strict=True)
        }
        crs = meta["crs"]
    else:
        drawn, crs = dxf_points(path), None
    crs = crs or read(demo.out / "survey.gpkg", layer="points")[0]["crs"]

    assert set(drawn) == set(places)
    for one, two in itertools.combinations(places, 2):
        planar = math.dist(places[one][:2], places[two][:2])
        up = (places[one][2] + places[two][2]) / 2
        length = ground_length(drawn[one], drawn[two], crs, world["height_m"] + up)
        assert length == pytest.approx(planar, abs=DISTANCE_M)
        rise = places[two][2] - places[one][2]
        # over a hundred metres the earth falls away by less than a millimetre
        assert drawn[two][2] - drawn[one][2] == pytest.approx(rise, abs=2e-3)
    scale = Proj(crs).get_factors(world["longitude_deg"], world["latitude_deg"]).meridional_scale
    assert abs(scale - 1) > 1e-5  # else nothing would be proved


def test_every_layer_of_the_geopackage_can_be_read(demo: Demo) -> None:
    layers = dict(list_layers(demo.out / "survey.gpkg"))
    assert layers["points"] == "Point Z"
    for name in set(layers) - {"layer_styles"}:  # how QGIS shows them
        _, _, geometry, _ = read(demo.out / "survey.gpkg", layer=name)
        assert geometry is not None


def test_the_globe_has_the_structure_that_the_standard_asks_for(
    demo: Demo, content: Content
) -> None:
    """OGC 12-007r2 (KML 2.3): order of elements, coordinates, closed counterclockwise rings."""
    root = ET.parse(demo.out / "survey.kml").getroot()  # noqa: S314  (our own file)
    assert root.tag == f"{KML}kml"
    (document,) = root
    assert document.tag == f"{KML}Document"
    kinds = [child.tag.removeprefix(KML) for child in document]
    assert kinds == sorted(kinds, key=["name", "Style", "Folder"].index)
    styles = {f"#{style.get('id')}" for style in document.iter(f"{KML}Style")}
    order = ["name", "visibility", "styleUrl", "ExtendedData", "Point", "LineString", "Polygon"]
    marks = list(document.iter(f"{KML}Placemark"))
    assert len(marks) > len(content["points"])
    for mark in marks:
        inside = [child.tag.removeprefix(KML) for child in mark]
        assert inside == sorted(inside, key=order.index)
        assert mark.findtext(f"{KML}styleUrl") in styles
        text = mark.findtext(f".//{KML}coordinates")
        assert text is not None
        place = np.array([[float(x) for x in part.split(",")] for part in text.split()])
        assert place.shape[1] == 3
        assert (np.abs(place[:, :2]) <= [180, 90]).all()
        if mark.find(f"{KML}Polygon") is not None:
            assert len(place) >= 4
            assert (place[0] == place[-1]).all()
            east, north = (place[:, :2] - place[0, :2]).T
            assert np.sum(east[:-1] * north[1:] - east[1:] * north[:-1]) > 0
    colours = [c.text or "" for c in document.iter(f"{KML}color")]
    assert all(len(c) == 8 and int(c, 16) >= 0 for c in colours)
