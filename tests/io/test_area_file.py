"""Polygons and points of GeoJSON and KML."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io.area_file import read_areas

RING = [[-104.62, 50.445], [-104.61, 50.445], [-104.61, 50.447], [-104.62, 50.445]]


def geojson(*geometries: dict[str, object], name: str = "yard") -> str:
    features = [
        {"type": "Feature", "properties": {"name": name}, "geometry": one} for one in geometries
    ]
    return json.dumps({"type": "FeatureCollection", "features": features})


POLYGON: dict[str, object] = {"type": "Polygon", "coordinates": [RING]}
KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Folder>
<Placemark><name>yard</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
-104.62,50.445,0 -104.61,50.445,0
-104.61,50.447,0 -104.62,50.445,0
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
<Placemark><name>hydrant</name><Point><coordinates>-104.615,50.446</coordinates></Point></Placemark>
</Folder></Document></kml>"""


def test_both_formats_hold_the_same(tmp_path: Path) -> None:
    point: dict[str, object] = {"type": "Point", "coordinates": [-104.615, 50.446]}
    one, other = tmp_path / "a.geojson", tmp_path / "a.kml"
    one.write_text(geojson(POLYGON, point, name="yard"))
    other.write_text(KML)
    found = [read_areas(path) for path in (one, other)]
    for file in found:
        assert [area.name for area in file.areas] == ["yard"]
        np.testing.assert_allclose(file.areas[0].longitude_latitude_deg, RING)
        np.testing.assert_allclose(file.longitude_latitude_deg, [[-104.615, 50.446]])
    assert found[1].label == ("hydrant",)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_a_file_in_utf_16_without_a_mark_is_named_so(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "area.kml"
    path.write_bytes(KML.encode(encoding))
    with pytest.raises(InputError, match=r"is UTF-16 text .* save it as UTF-8"):
        read_areas(path)


def test_bare_geometries_and_several_parts(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(POLYGON))
    assert len(read_areas(path).areas) == 1
    path.write_text(json.dumps({"type": "MultiPolygon", "coordinates": [[RING], [RING]]}))
    assert len(read_areas(path).areas) == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "is no JSON"),
        ("[1, 2]", "no GeoJSON"),
        (geojson({"type": "Point", "coordinates": [1, 2]}), "no polygon"),
        (geojson({"type": "Polygon", "coordinates": [[["a", 1], [2, 3]]]}), "no GeoJSON"),
        (geojson({"type": "Polygon", "coordinates": [[[500000, 5e6], [1, 2], [3, 4]]]}), "EPSG"),
        ("<kml><Placemark>", "no XML"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><kml/>", "entities"),
        ("<kml/>", "no polygon"),
        (geojson({"type": "Polygon", "coordinates": [[]]}), "no polygon"),
        (KML[: KML.index("-104.62,")] + KML[KML.index("</coordinates>") :], "no polygon"),
        ("PK\x03\x04", "KMZ"),
        (KML.replace("-104.62,50.445,0 ", "x,y "), "coordinates"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "area.geojson"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as told:
        read_areas(path)
    assert "area.geojson" in str(told.value)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"area\.kml"):
        read_areas(tmp_path / "area.kml")
    with pytest.raises(InputError, match="a folder"):
        read_areas(tmp_path)


@pytest.mark.parametrize("encoding", ["utf-7", "Shift_JIS", "utf-99", "punycode", "utf-16", ""])
def test_kml_that_declares_another_encoding_than_its_own_is_one_message(
    tmp_path: Path, encoding: str
) -> None:
    path = tmp_path / "a.kml"
    path.write_text(KML.replace("UTF-8", encoding))

    with pytest.raises(InputError, match=r"the encoding that it declares, .*: save it as UTF-8"):
        read_areas(path)


def test_kml_in_a_western_encoding_keeps_its_names(tmp_path: Path) -> None:
    path = tmp_path / "a.kml"
    text = KML.replace("UTF-8", "windows-1252").replace("yard", "Rue Émile")
    path.write_bytes(text.encode("cp1252"))

    assert read_areas(path).areas[0].name == "Rue Émile"


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_kml_in_utf_16_with_a_mark_is_read(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.kml"
    path.write_bytes(("\ufeff" + KML.replace("UTF-8", "UTF-16")).encode(encoding))

    assert read_areas(path).areas[0].name == "yard"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_a_second_mark_of_the_encoding_does_no_harm(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "area.kml"
    path.write_bytes(("\ufeff" + KML).encode(encoding))  # which writes one, too

    assert read_areas(path).areas


def test_a_long_name_of_an_encoding_is_not_repeated_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.kml"
    path.write_text(KML.replace("UTF-8", "x" * 10_000))

    with pytest.raises(InputError) as caught:
        read_areas(path)
    assert len(str(caught.value)) < 300


def test_entities_are_found_in_whatever_encoding_they_are_declared(tmp_path: Path) -> None:
    path = tmp_path / "a.kml"
    bomb = '<?xml version="1.0" encoding="UTF-7"?><!DOCTYPE l [<!ENTITY a "b">]><l>&a;</l>'
    path.write_bytes(bomb.encode("utf-7"))

    with pytest.raises(InputError, match="UTF-7"):
        read_areas(path)
