"""Hand the survey over: files for GIS, CAD and other photogrammetry."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from uavgram.io.exports.colmap import write_colmap_model
from uavgram.io.exports.dxf import write_local_dxf, write_map_dxf
from uavgram.io.exports.dxf_sheet import Words
from uavgram.io.exports.geojson import write_geojson
from uavgram.io.exports.geopackage import write_geopackage
from uavgram.io.exports.geotags import write_geo_txt
from uavgram.io.exports.kml import write_kml
from uavgram.io.exports.measurements_csv import write_measurements_csv
from uavgram.io.exports.opendronemap import write_gcp_list
from uavgram.io.exports.profiles_csv import write_profiles_csv
from uavgram.model.flight.geotag import GeoTags, PoseChoice
from uavgram.model.result.result import Result
from uavgram.model.units import Units
from uavgram.stages.products.geotags import geotag
from uavgram.stages.products.map_layers import features_of, shown_poses
from uavgram.views.units import column, quantity, units_of

Writers = dict[str, Callable[[Path], None]]


def exports(result: Result) -> Writers:
    """Name of each file in the output folder, and what writes it.

    What needs a place on earth is left out where nothing gives one; points.geojson and survey.kml
    then say why they are empty.
    """
    words = drawing_words(units_of(result))
    features = features_of(result, result.world.crs, words.length_m)
    writers: Writers = {
        "points.geojson": lambda path: write_geojson(result, path),
        "measurements.csv": lambda path: write_measurements_csv(result, path),
        "survey.gpkg": lambda path: write_geopackage(features, path),
        "survey.kml": lambda path: write_kml(features, path),
        "survey_local.dxf": lambda path: write_local_dxf(features, path, words),
        "colmap": lambda path: write_colmap_model(result, path),
    }
    if result.profiles.profile:
        writers["profiles.csv"] = lambda path: write_profiles_csv(result, path)
    if features.crs is not None:
        writers["survey_map.dxf"] = lambda path: write_map_dxf(features, path, words)
        writers["opendronemap/gcp_list.txt"] = lambda path: write_gcp_list(result, features, path)
        writers["opendronemap/geo.txt"] = lambda path: write_geo_txt(geotags_of(result), path)
    return writers


def drawing_words(units: Units) -> Words:
    """How a drawing writes its numbers: in the units of the project, while it stays in metres."""
    one = column(units)
    return Words(
        value=partial(quantity, units=units),
        length_m=1.0 if one.symbol == "m" else 1.0 / one.factor,
        symbol=one.symbol,
        name="metres" if one.symbol == "m" else "feet",
    )


def geotags_of(result: Result) -> GeoTags:
    """Tags of every photo that has a pose: the adjusted one, else the telemetry's."""
    rows, poses = shown_poses(result)
    kinds: list[PoseChoice] = ["refined" if result.has_refined[k] else "seed" for k in rows]
    paths = tuple(result.frames.path[k] for k in rows)
    return geotag(poses, paths, tuple(kinds), result.world)
