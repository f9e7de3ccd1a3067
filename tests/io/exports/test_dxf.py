"""The CAD drawings through ezdxf's reader and auditor."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.document import Drawing
from ezdxf.entities.insert import Insert
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.filemanagement import readfile
from ezdxf.math import ConstructionEllipse
from pyproj import Geod, Transformer

from uavgram.io.exports.dxf import write_local_dxf, write_map_dxf
from uavgram.model.maps import Features
from uavgram.model.result.result import Result


@pytest.fixture(scope="module", params=["local", "map"])
def drawing(
    request: pytest.FixtureRequest, features: Features, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Drawing]:
    path = tmp_path_factory.mktemp("dxf") / f"{request.param}.dxf"
    (write_local_dxf if request.param == "local" else write_map_dxf)(features, path)
    return request.param, readfile(path)


def test_the_auditor_finds_nothing_to_mend(drawing: tuple[str, Drawing]) -> None:
    _, document = drawing
    audit = document.audit()

    assert audit.errors == []
    assert audit.fixes == []
    assert document.units == ezdxf.units.M


def test_distances_between_points_are_the_results_to_a_tenth_of_a_millimetre(
    drawing: tuple[str, Drawing], result: Result
) -> None:
    kind, document = drawing
    place = {
        insert.get_attrib_text("LABEL"): np.array(insert.dxf.insert)
        for insert in document.modelspace().query("INSERT")
        if isinstance(insert, Insert) and insert.dxf.name == "SURVEY_POINT"
    }
    assert set(place) == set(result.points.label)
    if kind == "map":
        return  # stretched by the projection: see the GeoPackage's test
    rows = result.measurements
    tried = 0
    for i, measured in enumerate(rows.kind):
        if measured == "distance" and np.isfinite(rows.value[i]):
            start, end = (place[label] for label in rows.points[i])
            assert math.dist(start, end) == pytest.approx(rows.value[i], abs=1e-4)
            tried += 1
    assert tried == 2


def test_cameras_and_what_they_show_lie_on_the_map_where_they_are_from_the_origin(
    features: Features, tmp_path: Path
) -> None:
    write_map_dxf(features, tmp_path / "map.dxf")
    space = readfile(tmp_path / "map.dxf").modelspace()
    cameras = [point.dxf.location for point in space.query("POINT")]
    corners = [
        corner
        for line in space.query('LWPOLYLINE[layer=="PHOTO_FOOTPRINTS"]')
        if isinstance(line, LWPolyline)
        for corner in line.vertices()
    ]
    assert features.origin is not None
    latitude, longitude, _ = features.origin
    to_earth = Transformer.from_crs(features.crs, "EPSG:4326", always_xy=True)
    for name, drawn in (("camera_poses", cameras), ("footprints", corners)):
        local = np.concatenate(features.layer(name).vertices_m)
        lon, lat = to_earth.transform(*np.array([tuple(one)[:2] for one in drawn]).T)
        there = np.full(len(local), longitude), np.full(len(local), latitude)
        azimuth, _, away = Geod(ellps="WGS84").inv(*there, lon, lat)
        azimuth = np.radians(azimuth)
        found = np.stack([np.sin(azimuth), np.cos(azimuth)], axis=1) * np.array(away)[:, None]
        np.testing.assert_allclose(found, local[:, :2], atol=0.05)


def test_each_measured_distance_is_a_dimension_with_the_grounds_value(
    drawing: tuple[str, Drawing], result: Result
) -> None:
    _, document = drawing
    said = {d.dxf.text for d in document.modelspace().query("DIMENSION")}
    rows = result.measurements
    for i, measured in enumerate(rows.kind):
        if measured == "distance" and np.isfinite(rows.value[i]):
            assert f"{rows.name[i]}: {rows.value[i]:.3f} ±{rows.sigma[i]:.3f} m" in said


def test_a_known_length_is_marked_as_its_line_has_the_adjusted_one(
    drawing: tuple[str, Drawing], result: Result
) -> None:
    _, document = drawing
    said = {d.dxf.text for d in document.modelspace().query('DIMENSION[layer=="KNOWN_LENGTHS"]')}
    lines = result.lines
    assert said
    assert said <= {
        f"{name}: {length:.3f} ±{sigma:.3f} m (known)"
        for name, length, sigma in zip(lines.name, lines.length_m, lines.sigma_m, strict=True)
    }


def test_an_ellipse_has_the_axes_and_the_azimuth_of_the_result(
    drawing: tuple[str, Drawing], result: Result
) -> None:
    kind, document = drawing
    drawn = list(document.modelspace().query('ELLIPSE[layer=="ELLIPSES_95"]'))
    assert len(drawn) == len(result.points.label)
    for row, entity in enumerate(drawn):
        shape: ConstructionEllipse = entity.construction_tool()
        major = result.points.ellipse_95_m[row, 0]
        assert shape.major_axis.magnitude == pytest.approx(major, rel=1e-3)
        assert shape.ratio * shape.major_axis.magnitude == pytest.approx(
            result.points.ellipse_95_m[row, 1], rel=1e-3
        )
        azimuth = math.atan2(shape.major_axis.x, shape.major_axis.y)
        turned = (azimuth - result.points.ellipse_azimuth_rad[row]) % math.pi
        # the map's north is the grid's: in this place 2.6 degrees of longitude from its meridian
        assert min(turned, math.pi - turned) < (1e-6 if kind == "local" else 0.05)


def test_the_drawing_says_what_its_coordinates_are(
    drawing: tuple[str, Drawing], features: Features
) -> None:
    kind, document = drawing
    (note,) = (t.dxf.text for t in document.modelspace().query('TEXT[layer=="NOTES"]'))

    assert ("true ground distances" in note) == (kind == "local")
    assert (features.crs in note) == (kind == "map")


def test_a_survey_without_a_place_has_no_map(adrift: Features, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="needs a georeferenced survey"):
        write_map_dxf(adrift, tmp_path / "map.dxf")
    write_local_dxf(adrift, tmp_path / "local.dxf")
    assert readfile(tmp_path / "local.dxf").audit().errors == []


def test_it_opens_on_the_points_and_without_the_background(drawing: tuple[str, Drawing]) -> None:
    _, document = drawing
    (port,) = document.viewports.get_config("*Active")
    inserts = document.modelspace().query('INSERT[name=="SURVEY_POINT"]')
    place = np.array([tuple(insert.dxf.insert)[:2] for insert in inserts])

    away = np.abs(place - np.array(tuple(port.dxf.center)[:2]))
    assert (away < port.dxf.height / 2).all()
    assert away.max() > port.dxf.height / 4
    hidden = {layer.dxf.name for layer in document.layers if layer.is_frozen()}
    assert hidden == {"PHOTO_FOOTPRINTS", "ELLIPSES_95"}


def test_programs_find_its_extent_and_a_sheet_of_paper(
    drawing: tuple[str, Drawing], result: Result
) -> None:
    kind, document = drawing
    low, high = (np.array(document.header[name])[:2] for name in ("$EXTMIN", "$EXTMAX"))
    place = result.points.position_world_m[:, :2]

    assert high - low == pytest.approx(np.ptp(place, axis=0), rel=0.05)  # turned
    if kind == "local":
        assert low == pytest.approx(place.min(axis=0))
    # LibreCAD's paper, in units of the drawing, which is in metres
    assert document.header["$PLIMMAX"] == pytest.approx((0.420, 0.297))


def test_every_layer_can_be_seen_on_black_and_on_white(drawing: tuple[str, Drawing]) -> None:
    _, document = drawing
    assert len(document.layers) > 10
    for layer in document.layers:
        if layer.color != 7:  # black on white, and white on black
            light = luminance(ezdxf.colors.aci2rgb(layer.color))
            # WCAG 2.2, 1.4.11: graphics are seen from 3 : 1 on
            assert min(1.05 / (light + 0.05), (light + 0.05) / 0.05) >= 2.99, layer.dxf.name


def luminance(rgb: Iterable[int]) -> float:
    """Relative luminance (WCAG 2.2)."""
    parts = np.array(list(rgb)) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_every_point_has_its_label_as_a_text_beside_it(
    drawing: tuple[str, Drawing], result: Result
) -> None:
    _, document = drawing
    labels = document.modelspace().query('TEXT[layer=="LABELS"]')
    assert [text.dxf.text for text in labels] == list(result.points.label)
    inserts = document.modelspace().query('INSERT[name=="SURVEY_POINT"]')
    for text, insert in zip(labels, inserts, strict=True):
        width, height = text.dxf.height * len(text.dxf.text), text.dxf.height
        away = text.dxf.align_point.vec2.distance(insert.dxf.insert.vec2)
        assert height / 2 < away < width / 2 + 3 * height
        assert all(attribute.is_invisible for attribute in insert.attribs)


def test_dimensions_have_letters_of_the_labels_size_in_every_program(
    drawing: tuple[str, Drawing],
) -> None:
    """LibreCAD draws all dimensions as the header says, whatever their style is."""
    _, document = drawing
    label = next(iter(document.modelspace().query('TEXT[layer=="LABELS"]')))
    style = document.dimstyles.get("UAVGRAM")

    assert style.dxf.dimtxt == document.header["$DIMTXT"] == pytest.approx(label.dxf.height)
    for name in ("dimasz", "dimexe", "dimexo", "dimgap"):
        assert style.get_dxf_attrib(name) == document.header[f"${name.upper()}"] < label.dxf.height
