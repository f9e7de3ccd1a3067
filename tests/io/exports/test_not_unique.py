"""What other solutions would change, in the CAD drawing, the GeoPackage and the globe."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from ezdxf.filemanagement import readfile
from pyogrio.raw import read
from unsure import unsure

from uavgram.io.exports.dxf import write_local_dxf
from uavgram.io.exports.geopackage import write_geopackage
from uavgram.io.exports.kml import write_kml
from uavgram.model.maps import Features
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import features_of

NAME, KEPT = "road width", "31.2500;44.9000"


@pytest.fixture(scope="module")
def marked(result: Result) -> Features:
    return features_of(unsure(result, NAME, (31.25, 44.9)), result.world.crs)


def dxf_texts(features: Features, path: Path) -> tuple[list[str], str]:
    write_local_dxf(features, path)
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
