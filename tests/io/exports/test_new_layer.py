"""A new thing on maps is a layer and its look: all files have it."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import synthetic_survey as survey
from ezdxf.filemanagement import readfile

from uavgram.io.exports.dxf import write_local_dxf
from uavgram.io.exports.geopackage import write_geopackage
from uavgram.io.exports.kml import write_kml
from uavgram.io.exports.qgis_project import write_qgis_project
from uavgram.io.exports.qgis_styles import Look
from uavgram.model.maps import Layer
from uavgram.stages.products.map_layers import features_of

LOOKS = {"sight_lines": Look(title="lines of sight", colour="#555555", width_mm=0.2)}


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
    write_kml(features, tmp_path / "a.kml")
    write_local_dxf(features, tmp_path / "a.dxf")
    write_qgis_project(features, LOOKS, tmp_path / "a.qgs", has_ground=False)

    file = sqlite3.connect(tmp_path / "a.gpkg")
    assert file.execute("SELECT label FROM sight_lines").fetchall() == [("P00",)]
    file.close()
    assert "<name>Sight lines</name>" in (tmp_path / "a.kml").read_text(encoding="utf-8")
    assert "lines of sight" in (tmp_path / "a.qgs").read_text(encoding="utf-8")
    drawn = readfile(tmp_path / "a.dxf").modelspace().query('*[layer=="SIGHT_LINES"]')
    assert len(drawn) == 1
