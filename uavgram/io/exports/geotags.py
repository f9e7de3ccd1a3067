"""Writers of photo poses for other programs: OpenDroneMap's geo.txt and Pix4D's CSV.

Both take nadir angles in degrees (pitch 0 is straight down, 90 forward) and neither has a field for
the datum, which is stated in a comment.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.flight.pose import GeoTags

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
