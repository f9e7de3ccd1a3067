"""The CAD drawings through ezdxf's reader and auditor."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import cv2
import ezdxf
import numpy as np
import pytest
from ezdxf import recover
from ezdxf.addons import text2path
from ezdxf.document import Drawing
from ezdxf.entities.dxfentity import DXFEntity
from ezdxf.entities.insert import Insert
from ezdxf.entities.line import Line
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.mtext import MText
from ezdxf.entities.text import Text
from ezdxf.enums import TextEntityAlignment
from ezdxf.filemanagement import readfile
from ezdxf.math import ConstructionEllipse
from pyproj import Geod, Transformer

from uavgram.io.exports.dxf import write_dxf
from uavgram.model.arrays import Floats, Ints
from uavgram.model.maps import Features, Layer
from uavgram.model.result.result import Result
from uavgram.views.style import LOOKS


@pytest.fixture(scope="module", params=["local", "map"])
def drawing(
    request: pytest.FixtureRequest, features: Features, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Drawing]:
    path = tmp_path_factory.mktemp("dxf") / f"{request.param}.dxf"
    write_dxf(features, path, LOOKS, on_map=request.param != "local")
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
    write_dxf(features, tmp_path / "map.dxf", LOOKS, on_map=True)
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
        write_dxf(adrift, tmp_path / "map.dxf", LOOKS, on_map=True)
    write_dxf(adrift, tmp_path / "local.dxf", LOOKS)
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
    assert hidden == {"PHOTO_FOOTPRINTS", "ELLIPSES_95", "CAMERAS"}


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


# No text of a drawing covers another: as ezdxf draws them, letter by letter.


Box = tuple[tuple[float, float], tuple[float, float], float]


def random_survey(rng: np.random.Generator) -> Features:
    """Points, crowded here and there, with known and measured lengths between them, and areas."""
    count = int(rng.integers(2, 14))
    spread = 10.0 ** rng.uniform(-0.5, 2.5)
    place = np.column_stack([rng.normal(size=(count, 2)) * [spread, spread / 3], np.zeros(count)])
    crowd = place[0, :2] + rng.normal(size=(count // 3, 2)) * spread / 50
    place[1 : 1 + count // 3, :2] = crowd
    label = tuple(f"P{i}" * int(rng.integers(1, 3)) for i in range(count))
    high = np.where(rng.random(count) < 0.2, rng.uniform(0.1, 3.0, count), 0.0)
    points = Layer(
        name="points",
        kind="point",
        vertices_m=tuple(place[:, None]),
        attributes={
            "label": label,
            **{f"sigma_{axis}_m": (0.01,) * count for axis in ("east", "north", "up")},
            "height_above_ground_m": tuple(high.tolist()),
            "height_sigma_m": tuple(np.where(high > 0, 0.02, 0.0).tolist()),
            "height_source": tuple("free" if up else "ground" for up in high),
            "picked_by": ("hand",) * count,
        },
    )
    pairs = rng.permuted(np.tile(np.arange(count), (int(rng.integers(1, 9)), 1)), axis=1)[:, :2]
    return Features(
        name="crowded",
        layers=(_lengths(place, pairs), _nothing(), _measured(place, pairs[::-1]), points),
        origin=None,
        height_datum="msl",
        crs=None,
    )


def _nothing(name: str = "measured_areas") -> Layer:
    return Layer(name=name, kind="polygon", vertices_m=(), attributes={"alternatives": ()})


def _ends(place: Floats, pairs: Ints) -> tuple[Floats, ...]:
    return tuple(place[pair] for pair in pairs)


def _lengths(place: Floats, pairs: Ints) -> Layer:
    ends = _ends(place, pairs)
    size = [float(np.linalg.norm(end[1] - end[0])) for end in ends]
    return Layer(
        name="known_lengths",
        kind="line",
        vertices_m=ends,
        attributes={
            "name": tuple(f"L{i}" for i in range(len(ends))),
            "length_m": tuple(size),
            "sigma_m": (0.01,) * len(ends),
        },
    )


def _measured(place: Floats, pairs: Ints) -> Layer:
    ends = (*_ends(place, pairs), place[:4])
    count = len(ends)
    return Layer(
        name="measured_lines",
        kind="line",
        vertices_m=ends,
        attributes={
            "name": tuple(f"braking {i}" for i in range(count)),
            "kind": ("distance",) * (count - 1) + ("polyline",),
            "value": tuple(float(np.linalg.norm(end[-1] - end[0])) for end in ends),
            "sigma": (0.0123,) * count,
            "unit": ("m",) * count,
            "alternatives": ("",) * count,
        },
    )


def shown_texts(document: Drawing) -> list[DXFEntity]:
    """All texts that a program shows, those of dimensions among them."""
    space = document.modelspace()
    found: list[DXFEntity] = list(space.query("TEXT"))
    for dimension in space.query("DIMENSION"):
        found += [one for one in dimension.virtual_entities() if isinstance(one, (Text, MText))]  # type: ignore[attr-defined]
    return found


def box_of(text: DXFEntity) -> Box:
    """The smallest rectangle around the letters, which may be turned."""
    drawn = text if isinstance(text, Text) else Text()
    if isinstance(text, MText):  # one line of it
        drawn = Text.new(dxfattribs={"text": text.text, "height": text.dxf.char_height})
        drawn.dxf.rotation = text.get_rotation()
        drawn.set_placement(text.dxf.insert, align=TextEntityAlignment.MIDDLE_CENTER)
    paths = text2path.make_paths_from_entity(drawn)
    corners = np.array([tuple(point)[:2] for path in paths for point in path.flattening(0.01)])
    first = corners[0]  # of a map these are millions of metres, and OpenCV's numbers too short
    (x, y), size, turn = cv2.minAreaRect((corners - first).astype(np.float32))
    return (x + float(first[0]), y + float(first[1])), (size[0], size[1]), turn


SLIGHT = 1e-9
"""Of the drawing's area: OpenCV computes in single precision."""


def overlap(one: Box, other: Box) -> float:
    """The area that two rectangles have in common."""
    return float(cv2.intersectConvexConvex(cv2.boxPoints(one), cv2.boxPoints(other))[0])


def moved_by_librecad(document: Drawing) -> list[Floats]:
    """By how much each text is moved where a program puts long ones beyond their dimension line.

    So does LibreCAD 2.2: by half of both and the gap, to the right as the text is read.
    """
    space = document.modelspace()
    moved = [np.zeros(2) for _ in space.query("TEXT")]
    for dimension in space.query("DIMENSION"):
        for one in dimension.virtual_entities():  # type: ignore[attr-defined]
            if isinstance(one, (Text, MText)):
                width = max(box_of(one)[1])
                length = dimension.dxf.defpoint2.vec2.distance(dimension.dxf.defpoint3.vec2)
                gap = document.dimstyles.get(dimension.dxf.dimstyle).dxf.dimgap
                turn = math.radians(
                    one.get_rotation() if isinstance(one, MText) else one.dxf.rotation
                )
                way = (width + length) / 2 + gap if width > length else 0.0
                moved.append(way * np.array([math.cos(turn), math.sin(turn)]))
    return moved


def covering(document: Drawing) -> list[tuple[str, str]]:
    """Pairs of texts that cover each other, where they stand and where LibreCAD puts them."""
    texts = shown_texts(document)
    drawn, moved = [box_of(text) for text in texts], moved_by_librecad(document)
    middle = np.array([box[0] for box in drawn])
    scale = float(np.ptp(middle, axis=0).max()) or 1.0
    words = [str(getattr(text, "text", "") or text.dxf.text) for text in texts]
    found = []
    for share in (0.0, 1.0):
        boxes = []
        for ((x, y), (w, h), turn), (east, north) in zip(drawn, moved, strict=True):
            # OpenCV computes in single precision
            near = x + share * east - middle[0, 0], y + share * north - middle[0, 1]
            boxes.append(((near[0] / scale, near[1] / scale), (w / scale, h / scale), turn))
        found += [
            (words[i], words[j])
            for i in range(len(boxes))
            for j in range(i)
            if overlap(boxes[i], boxes[j]) > SLIGHT
        ]
    return found


@pytest.mark.parametrize("seed", range(12))
def test_no_text_covers_another(seed: int, tmp_path: Path) -> None:
    write_dxf(random_survey(np.random.default_rng(seed)), tmp_path / "random.dxf", LOOKS)

    assert covering(readfile(tmp_path / "random.dxf")) == []


@pytest.mark.parametrize("on_map", [False, True])
def test_no_text_of_a_whole_survey_covers_another(
    features: Features, *, on_map: bool, tmp_path: Path
) -> None:
    write_dxf(features, tmp_path / "survey.dxf", LOOKS, on_map=on_map)
    document = readfile(tmp_path / "survey.dxf")

    assert len(shown_texts(document)) > 20
    assert covering(document) == []


def drawn_of(document: Drawing) -> dict[str, tuple[Floats, Floats]]:
    """By each text what it names, (k, 2) ends or the place of a point, and its corners (4, 2)."""
    space = document.modelspace()
    named: dict[str, Floats] = {}
    for insert in space.query("INSERT"):
        named[insert.get_attrib_text("LABEL")] = np.array([insert.dxf.insert.vec2])  # type: ignore[attr-defined]
    for dimension in space.query("DIMENSION"):
        ends = dimension.dxf.defpoint2.vec2, dimension.dxf.defpoint3.vec2
        named[dimension.dxf.text] = np.array(ends)
    return {
        words: (named[words], np.asarray(cv2.boxPoints(box_of(text)), np.float64))
        for text in shown_texts(document)
        if (words := str(getattr(text, "text", "") or text.dxf.text)) in named
    }


def letters_apart(document: Drawing) -> Floats:
    """From each text to the nearest point of what it names, in heights of its letters."""
    height = document.dimstyles.get("UAVGRAM").dxf.dimtxt
    share = np.linspace(0.0, 1.0, 501)[:, None]
    found = []
    for ends, corners in drawn_of(document).values():
        line = (1 - share) * ends[0] + share * ends[-1] if len(ends) > 1 else ends
        outline = corners.astype(np.float32)
        inside = [cv2.pointPolygonTest(outline, at, measureDist=True) for at in line.tolist()]
        found.append(max(-max(inside), 0.0) / height)
    return np.array(found)


MOST_LETTERS = 15.0


@pytest.mark.parametrize("seed", range(100, 106))
def test_no_text_is_far_from_what_it_names(seed: int, tmp_path: Path) -> None:
    write_dxf(random_survey(np.random.default_rng(seed)), tmp_path / "random.dxf", LOOKS)

    assert letters_apart(readfile(tmp_path / "random.dxf")).max() < MOST_LETTERS


def short_lines(rng: np.random.Generator, count: int) -> Features:
    """Known lengths of 0.5 to 3 m, close together: most are shorter than their texts."""
    start, turn = rng.uniform(size=(count, 2)) * 20.0, rng.uniform(0.0, 7.0, count)
    way = rng.uniform(0.5, 3.0, count)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    place = np.column_stack([np.concatenate([start, start + way]), np.zeros(2 * count)])
    survey = random_survey(rng)
    points = survey.layer("points")
    attributes = {key: values[:1] * len(place) for key, values in points.attributes.items()}
    attributes["label"] = tuple(f"P{i}" for i in range(len(place)))
    pairs = np.arange(2 * count).reshape(2, count).T
    layers = (
        _lengths(place, pairs),
        _nothing(),
        _nothing("measured_lines"),
        replace(points, vertices_m=tuple(place[:, None]), attributes=attributes),
    )
    return replace(survey, layers=layers)


def segments(entities: Iterable[DXFEntity]) -> Floats:
    """Straight parts (n, 2, 2) of what is drawn."""
    found = []
    for one in entities:
        if isinstance(one, LWPolyline):
            found += list(itertools.pairwise(one.get_points("xy")))
        elif isinstance(one, Line):
            found.append((tuple(one.dxf.start)[:2], tuple(one.dxf.end)[:2]))
    return np.array(found, np.float64).reshape(-1, 2, 2)


def apart(corners: Floats, line: Floats) -> float:
    """From a text (4, 2) to the nearest point of a line (2, 2)."""
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    outline = (corners - line[0]).astype(np.float32)
    places = share * (line[1] - line[0])
    return max(-max(cv2.pointPolygonTest(outline, at, measureDist=True) for at in places), 0.0)


def texts_without_a_line(document: Drawing) -> dict[str, float]:
    """Dimensions whose texts are farther than a letter from their line, and from own lines."""
    height = document.dimstyles.get("UAVGRAM").dxf.dimtxt
    found = {}
    for dimension in document.modelspace().query("DIMENSION"):
        parts = list(dimension.virtual_entities())  # type: ignore[attr-defined]
        (text,) = (one for one in parts if isinstance(one, MText))
        corners = np.asarray(cv2.boxPoints(box_of(text)), np.float64)
        ends = dimension.dxf.defpoint2.vec2, dimension.dxf.defpoint3.vec2
        lines = [np.array(ends, np.float64), *segments(parts)]
        away = min(apart(corners, line) for line in lines) / height
        if away > 1.0:
            found[dimension.dxf.text] = away
    return found


@pytest.mark.parametrize("seed", range(3))
def test_a_text_is_beside_its_short_line_or_lines_lead_to_it(seed: int, tmp_path: Path) -> None:
    survey = short_lines(np.random.default_rng(seed), 30)
    write_dxf(survey, tmp_path / "short.dxf", LOOKS)
    document = readfile(tmp_path / "short.dxf")

    assert len(document.modelspace().query("DIMENSION")) == 30
    assert covering(document) == []
    assert texts_without_a_line(document) == {}


def test_strokes_show_where_a_length_ends_though_its_line_goes_on_to_the_text(
    tmp_path: Path,
) -> None:
    survey = short_lines(np.random.default_rng(0), 30)
    write_dxf(survey, tmp_path / "short.dxf", LOOKS)
    dimensions = readfile(tmp_path / "short.dxf").modelspace().query("DIMENSION")

    longer = 0
    for dimension in dimensions:
        parts = list(dimension.virtual_entities())  # type: ignore[attr-defined]
        lines = [one for one in parts if isinstance(one, Line)]
        first, last = (one for one in lines if one.dxf.linetype == "BYLAYER")
        middles = [one.dxf.start.lerp(one.dxf.end) for one in (first, last)]
        length = dimension.dxf.actual_measurement
        assert middles[0].distance(middles[1]) == pytest.approx(length, abs=1e-6)
        solid = [one for one in parts if one.dxf.linetype == "BYLAYER"]
        drawn = np.linalg.norm(np.diff(segments(solid), axis=1), axis=2)
        assert drawn[1] == pytest.approx(length, abs=1e-6)  # the dimension line
        longer += len(lines) > 2
    assert longer  # of some, a dashed line goes on to the text


def test_a_net_of_lengths_between_all_points_keeps_its_texts(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    place = np.column_stack([rng.uniform(size=(14, 2)) * [90.0, 25.0], np.zeros(14)])
    pairs = np.array([(i, j) for i in range(14) for j in range(i)])
    survey = random_survey(rng)
    layers = tuple(
        _lengths(place, pairs) if one.name == "known_lengths" else one for one in survey.layers
    )
    write_dxf(replace(survey, layers=layers), tmp_path / "net.dxf", LOOKS)
    document = readfile(tmp_path / "net.dxf")

    assert len(document.modelspace().query('DIMENSION[layer=="KNOWN_LENGTHS"]')) == len(pairs)
    assert covering(document) == []
    assert letters_apart(document).max() < MOST_LETTERS


def test_a_line_leads_to_a_label_that_is_not_beside_its_point(tmp_path: Path) -> None:
    survey = random_survey(np.random.default_rng(1))
    points = survey.layer("points")
    together = replace(points, vertices_m=tuple(np.zeros((1, 3)) for _ in points.vertices_m))
    many = replace(survey, layers=(_nothing(), _nothing("measured_lines"), together))
    write_dxf(many, tmp_path / "crowd.dxf", LOOKS)
    document = readfile(tmp_path / "crowd.dxf")
    lines = document.modelspace().query('LINE[layer=="LABELS"]')

    assert covering(document) == []
    assert len(lines) > 0
    assert {tuple(line.dxf.start) for line in lines} == {(0.0, 0.0, 0.0)}


CODES = [
    "%%d 20%%",
    r"\U+0041",
    "a^Ib",
    "{x}",
    r"C:\P1",
    "<> [] a<>",
    "50%%%",
    "a\tb",
]


def test_names_that_look_like_codes_are_read_as_they_are(tmp_path: Path) -> None:
    count = len(CODES)
    place = np.column_stack([10.0 * np.arange(count), np.zeros((count, 2))])
    pairs = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    survey = random_survey(np.random.default_rng(5))
    points = survey.layer("points")
    attributes = {key: (values[0],) * count for key, values in points.attributes.items()}
    known = _lengths(place, pairs)
    layers = (
        replace(known, attributes={**known.attributes, "name": tuple(CODES[1:])}),
        _nothing(),
        _nothing("measured_lines"),
        replace(
            points,
            vertices_m=tuple(place[:, None]),
            attributes={**attributes, "label": tuple(CODES)},  # type: ignore[dict-item]
        ),
    )
    write_dxf(replace(survey, layers=layers, name=CODES[0]), tmp_path / "codes.dxf", LOOKS)
    document, _ = recover.readfile(tmp_path / "codes.dxf")  # decodes as programs do
    space = document.modelspace()
    shown = [name.replace("\t", " ") for name in CODES]

    assert [text.plain_text() for text in space.query('TEXT[layer=="LABELS"]')] == shown  # type: ignore[attr-defined]
    hidden = [insert.get_attrib("LABEL").plain_text() for insert in space.query("INSERT")]  # type: ignore[attr-defined]
    assert hidden == shown
    (note,) = space.query('TEXT[layer=="NOTES"]')
    assert note.plain_text().startswith(f"{CODES[0]}: ")  # type: ignore[attr-defined]
    dimensions = [
        one.plain_text()
        for dimension in space.query("DIMENSION")
        for one in dimension.virtual_entities()  # type: ignore[attr-defined]
        if isinstance(one, MText)
    ]
    assert dimensions == [f"{name}: 10.000 ±0.010 m (known)" for name in shown[1:]]
