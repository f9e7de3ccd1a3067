"""Writers for photogrammetry programs: COLMAP's model, OpenDroneMap's and Pix4D's text files.

COLMAP's text model has the camera, adjusted poses and picked points, after
colmap.github.io/format.html and /cameras.html: poses are camera-from-world, quaternions (w, x, y,
z), and the corner of the top-left pixel is (0, 0), so its centre (0.5, 0.5).

OpenDroneMap's geo.txt and Pix4D's CSV take nadir angles in degrees (pitch 0 is straight down, 90
forward) and neither has a field for the datum, which is stated in a comment. gcp_list.txt has the
adjusted points as ground control of OpenDroneMap and OpenSfM.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from uavgram.geometry.geodesy import projected_from_enu
from uavgram.geometry.motion.rotation import xyzw_from_matrix
from uavgram.io.cameras import colmap_text
from uavgram.io.tables.csv_tables import csv_text
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import GeoTags
from uavgram.model.maps import Features
from uavgram.model.result.result import Result

_CAMERA_ID = 1
_PRIOR_HEADER = [
    "image",
    *("x_m", "y_m", "z_m"),
    *("xx_m2", "xy_m2", "xz_m2", "yy_m2", "yz_m2", "zz_m2"),
]


def write_colmap_model(result: Result, folder: Path) -> None:
    """Write cameras.txt, images.txt, points3D.txt and pose_priors.csv.

    The world is the local one, in metres. The covariances are those of the centres, in the form of
    COLMAP's pose priors (``pycolmap.PosePrior(position, covariance)``); the text format cannot hold
    them.
    """
    folder.mkdir(exist_ok=True)
    frames = np.flatnonzero(result.has_refined)
    seen = _used_picks(result)
    camera = replace(result.camera, parameters=result.shared.intrinsics.value)
    (folder / "cameras.txt").write_text(colmap_text(camera), encoding="utf-8")
    (folder / "images.txt").write_text(_images(result, frames, seen), encoding="utf-8")
    (folder / "points3D.txt").write_text(_points(result, frames, seen), encoding="utf-8")
    (folder / "pose_priors.csv").write_text(_priors(result, frames), encoding="utf-8")


def _used_picks(result: Result) -> dict[str, list[tuple[int, Floats, float]]]:
    """Return (point row, pixel in COLMAP's convention, residual) of each frame's used picks."""
    rows = {label: k for k, label in enumerate(result.points.label)}
    seen: dict[str, list[tuple[int, Floats, float]]] = {}
    picks = result.picks
    for i, (image, label, status) in enumerate(
        zip(picks.image, picks.label, picks.status, strict=True)
    ):
        if status in {"used", "suspect"} and label in rows:
            residual = float(np.linalg.norm(picks.residual_px[i]))
            seen.setdefault(image, []).append((rows[label], picks.pixel_px[i] + 0.5, residual))
    return seen


def _images(result: Result, frames: Ints, seen: dict[str, list[tuple[int, Floats, float]]]) -> str:
    lines = [
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME",
        "# POINTS2D[] as (X, Y, POINT3D_ID)",
    ]
    rotation = np.swapaxes(result.frames.refined.world_from_camera, 1, 2)
    for number, k in enumerate(frames, start=1):
        x, y, z, w = xyzw_from_matrix(rotation[k])
        shift = -rotation[k] @ result.frames.refined.center_world_m[k]
        name = result.frames.frame_id[k]
        pose = " ".join(f"{value:.12g}" for value in (w, x, y, z, *shift))
        lines.append(f"{number} {pose} {_CAMERA_ID} {name}")
        lines.append(
            " ".join(f"{uv[0]:.4f} {uv[1]:.4f} {row + 1}" for row, uv, _ in seen.get(name, []))
        )
    return "\n".join(lines) + "\n"


def _points(result: Result, frames: Ints, seen: dict[str, list[tuple[int, Floats, float]]]) -> str:
    tracks: dict[int, list[tuple[int, int, float]]] = {}
    for number, k in enumerate(frames, start=1):
        for index, (row, _, residual) in enumerate(seen.get(result.frames.frame_id[k], [])):
            tracks.setdefault(row, []).append((number, index, residual))
    lines = ["# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)"]
    for row, track in sorted(tracks.items()):
        place = " ".join(f"{value:.6f}" for value in result.points.position_world_m[row])
        error = float(np.mean([residual for _, _, residual in track]))
        views = " ".join(f"{image} {index}" for image, index, _ in track)
        lines.append(f"{row + 1} {place} 255 255 255 {error:.4f} {views}")
    return "\n".join(lines) + "\n"


def _priors(result: Result, frames: Ints) -> str:
    """Return the pose priors; names of photos are not protected as formulas, for other programs."""
    upper = np.triu_indices(3)
    poses = result.frames.refined
    rows = [
        [
            result.frames.frame_id[k],
            *(f"{value:.6f}" for value in poses.center_world_m[k]),
            *(f"{value:.9g}" for value in poses.covariance[k, :3, :3][upper]),
        ]
        for k in frames
    ]
    return csv_text(_PRIOR_HEADER, rows)


DATUM_WORDS = {"msl": "above mean sea level", "ellipsoid": "above the WGS 84 ellipsoid"}
_GEO_COLUMNS = "image longitude latitude height yaw pitch roll sigma_horizontal sigma_vertical"
_PIX4D_COLUMNS = (
    "#imagename,latitude [deg],longitude [deg],altitude [m],yaw [deg],pitch [deg],roll [deg],"
    "Accuracy Horz [m],Accuracy Vert [m]"
)


def write_geo_txt(tags: GeoTags, path: Path) -> None:
    """Write OpenDroneMap's image geolocation file.

    The projection comes first, then comments, which that program skips, then for each photo name,
    x, y, z, yaw, pitch, roll and accuracies (docs.opendronemap.org, "Image Geolocation Files";
    opendm/geo.py).
    """
    lines = ["EPSG:4326", f"# heights {DATUM_WORDS[tags.datum]}; pitch 0 looks straight down"]
    lines.append(f"# {_GEO_COLUMNS}")
    _write(path, lines, " ", tags, (tags.longitude_deg, tags.latitude_deg))


def write_pix4d_csv(tags: GeoTags, path: Path) -> None:
    """Write Pix4D's image geolocation and orientation file, nine columns with accuracies.

    After support.pix4d.com 360056389172 (PIX4Dmatic): a header only as a comment, yaw before pitch
    before roll, the order of coordinates that of EPSG:4326.
    """
    lines = [_PIX4D_COLUMNS, f"#altitude {DATUM_WORDS[tags.datum]}"]
    _write(path, lines, ",", tags, (tags.latitude_deg, tags.longitude_deg))


def _write(
    path: Path, head: list[str], separator: str, tags: GeoTags, place: tuple[Floats, Floats]
) -> None:
    """Write a table: its head, and a row for each photo; `place` in the format's order."""
    columns = [
        *((column, ".9f") for column in place),
        (tags.height_m, ".3f"),
        *((column, ".4f") for column in np.degrees(tags.nadir_ypr_rad).T),
        (tags.sigma_horizontal_m, ".3f"),
        (tags.sigma_vertical_m, ".3f"),
    ]
    cells = [[format(value, digits) for value in column] for column, digits in columns]
    rows = [separator.join(row) for row in zip(tags.frame_id, *cells, strict=True)]
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")


def write_gcp_list(result: Result, features: Features, path: Path) -> None:
    """Write each used pick with its point: easting, northing, height, column, row, photo, label.

    Pixels count from the centre of the top-left one, as here (OpenSfM, ``features.py``:
    ``normalized_image_coordinates`` adds half a pixel). Heights are above the datum of the world's
    origin. The first line names the coordinate system (docs.opendronemap.org, "Ground Control
    Points").

    Parameters
    ----------
    result
        Adjusted points [m, local ENU], and picks with their status.
    features
        Georeference of the survey: origin and projected coordinate system.
    path
        The file.

    Raises
    ------
    ValueError
        The survey is not georeferenced.
    """
    if features.origin is None or features.crs is None:
        raise ValueError("ground control needs a georeferenced survey")
    placed = projected_from_enu(result.points.position_world_m, features.origin, features.crs)
    place = dict(zip(result.points.label, placed.tolist(), strict=True))
    lines = [features.crs]
    picks = result.picks
    for image, label, (u, v), status in zip(
        picks.image, picks.label, picks.pixel_px.tolist(), picks.status, strict=True
    ):
        if label in place and status in {"used", "suspect"}:
            east, north, height = place[label]
            lines.append(
                f"{east:.4f} {north:.4f} {height:.4f} {u:.3f} {v:.3f} {_word(image)} {_word(label)}"
            )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _word(text: str) -> str:
    """Replace blanks in a name, as they separate the file's cells."""
    return "_".join(text.split())
