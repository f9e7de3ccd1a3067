"""Writer of gcp_list.txt: the adjusted points as ground control of OpenDroneMap and OpenSfM."""

from __future__ import annotations

from pathlib import Path

from uavgram.geometry.earth.geodesy import projected_from_enu
from uavgram.model.maps import Features
from uavgram.model.result.result import Result


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
        raise ValueError("ground control needs a survey that lies on the earth")
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
