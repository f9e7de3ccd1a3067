"""survey.kml, read back by GDAL and as XML."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from pyogrio import list_layers
from pyogrio.raw import read

from uavgram.io.exports.kml import write_kml
from uavgram.model.maps import Features
from uavgram.model.result.result import Result

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
