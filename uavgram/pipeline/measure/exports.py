"""Export the survey: files for GIS, CAD and other photogrammetry."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import numpy as np

from uavgram.geometry.geodesy import projected_from_enu
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.io.exports.dxf import place_texts, write_dxf
from uavgram.io.exports.dxf_layers import NumberFormat
from uavgram.io.exports.geojson_kml import write_geojson, write_kml
from uavgram.io.exports.geotiff import add_opacity, write_turned_picture
from uavgram.io.exports.gis import GROUND, write_geopackage, write_qgis_project
from uavgram.io.exports.measurements_csv import write_measurements_csv, write_profiles_csv
from uavgram.io.exports.photogrammetry import write_colmap_model, write_gcp_list, write_geo_txt
from uavgram.io.files import photo_files
from uavgram.model.arrays import Floats
from uavgram.model.frames import GeoTags, PoseChoice
from uavgram.model.naming import Units
from uavgram.model.result.result import Result
from uavgram.stages.products.geotags import geotag
from uavgram.stages.products.map_layers import features_of, select_shown_poses
from uavgram.views.style import LOOKS
from uavgram.views.units import format_quantity, table_unit, units_of

Writers = dict[str, Callable[[Path], None]]


def make_writers(result: Result, texture: GroundTexture | None = None) -> Writers:
    """Return the writer of each file in the output folder, by name.

    Files that need a place on earth are left out without one; points.geojson and survey.kml then
    state why they are empty.

    Parameters
    ----------
    result
        Result of a run.
    texture
        Picture of the ground from the photos, if any.
    """
    words = drawing_words(units_of(result))
    features = features_of(result, result.world.crs, words.length_m)
    texts = cache(lambda: place_texts(features, words))  # both drawings have the same
    writers: Writers = {
        "points.geojson": lambda path: write_geojson(result, path),
        "measurements.csv": lambda path: write_measurements_csv(result, path),
        "survey.gpkg": lambda path: write_geopackage(features, path, LOOKS, words.value),
        "survey.kml": lambda path: write_kml(features, path, LOOKS),
        "survey_local.dxf": lambda path: write_dxf(features, path, LOOKS, words, texts()),
        "colmap": lambda path: write_colmap_model(result, path),
    }
    if result.profiles.profile:
        writers["profiles.csv"] = lambda path: write_profiles_csv(result, path)
    if features.crs is not None:
        writers["survey_map.dxf"] = lambda path: write_dxf(
            features, path, LOOKS, words, texts(), on_map=True
        )
        writers["opendronemap/gcp_list.txt"] = lambda path: write_gcp_list(result, features, path)
        writers["opendronemap/geo.txt"] = lambda path: write_geo_txt(make_geotags(result), path)
    if texture is not None:
        writers[GROUND] = lambda path: write_ground(texture, result, path)
    writers["survey.qgs"] = lambda path: write_qgis_project(
        features, LOOKS, path, has_ground=texture is not None
    )
    return writers


def write_ground(texture: GroundTexture, result: Result, path: Path) -> None:
    """Write the ground of the recording for maps.

    Parameters
    ----------
    texture
        In local metres.
    result
        Result, which ties local metres to the map.
    path
        The file.
    """
    height, width = texture.covered.shape
    right, down = np.array([width, -height]) * texture.pixel_size_m
    corner = np.array([texture.west_m, texture.north_m])
    corners, crs = transform_to_map(
        result, corner + np.array([[0.0, 0.0], [right, 0.0], [0.0, down]])
    )
    tags = {"surface": "the adjusted ground plane: objects above it lean away from the photo"}
    rgba = add_opacity(texture.rgb, texture.covered)
    write_turned_picture(rgba, corners, crs, tags, path)


def transform_to_map(result: Result, local_m: Floats) -> tuple[Floats, str | None]:
    """Transform places (n, 2) on the ground plane to the map, and return its coordinate system.

    Parameters
    ----------
    result
        Result, which ties local metres to the map; without a tie, the places are returned
        unchanged, and no map.
    local_m
        (n, 2) east, north.
    """
    origin, crs = result.world.origin, result.world.crs
    if origin is None or crs is None:
        return local_m, None
    up = result.plane.height_at(local_m)
    return projected_from_enu(np.column_stack([local_m, up]), origin, crs)[:, :2], crs


def drawing_words(units: Units) -> NumberFormat:
    """Return the wording of numbers in a drawing: in the project's units, while it is in metres."""
    one = table_unit(units)
    return NumberFormat(
        value=partial(format_quantity, units=units),
        length_m=1.0 if one.symbol == "m" else 1.0 / one.factor,
        symbol=one.symbol,
        name="metres" if one.symbol == "m" else "feet",
    )


def make_geotags(result: Result) -> GeoTags:
    """Return tags of every photo with a pose: the adjusted one, or else the telemetry's."""
    rows, poses = select_shown_poses(result)
    kinds: list[PoseChoice] = ["refined" if result.has_refined[k] else "seed" for k in rows]
    files = photo_files(result.frames)
    paths = tuple(files[k] for k in rows)
    return geotag(poses, paths, tuple(kinds), result.world)
