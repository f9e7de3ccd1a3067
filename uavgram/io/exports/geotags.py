"""Tables of photo poses for other programs: OpenDroneMap's geo.txt and Pix4D's CSV.

Both take nadir angles in degrees (pitch 0 looks straight down, 90 forward) and both carry no
datum, so a comment says it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.flight.geotag import GeoTags

DATUM_WORDS = {"msl": "above mean sea level", "ellipsoid": "above the WGS 84 ellipsoid"}
_GEO_COLUMNS = "image longitude latitude height yaw pitch roll sigma_horizontal sigma_vertical"
_PIX4D_COLUMNS = (
    "#imagename,latitude [deg],longitude [deg],altitude [m],yaw [deg],pitch [deg],roll [deg],"
    "Accuracy Horz [m],Accuracy Vert [m]"
)


def write_geo_txt(tags: GeoTags, path: Path) -> None:
    """Write OpenDroneMap's image geolocation file.

    The projection comes first, then comments, which that program skips, then for each photo
    name, x, y, z, yaw, pitch, roll and accuracies (docs.opendronemap.org, "Image Geolocation
    Files"; opendm/geo.py).
    """
    lines = ["EPSG:4326", f"# heights {DATUM_WORDS[tags.datum]}; pitch 0 looks straight down"]
    lines.append(f"# {_GEO_COLUMNS}")
    for k, name in enumerate(tags.frame_id):
        place = f"{tags.longitude_deg[k]:.9f} {tags.latitude_deg[k]:.9f} {tags.height_m[k]:.3f}"
        angles = " ".join(f"{angle:.4f}" for angle in _nadir_deg(tags, k))
        lines.append(f"{name} {place} {angles} {_sigmas(tags, k, ' ')}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_pix4d_csv(tags: GeoTags, path: Path) -> None:
    """Write Pix4D's image geolocation and orientation file, nine columns with accuracies.

    After support.pix4d.com 360056389172 (PIX4Dmatic): a header only as a comment, yaw before
    pitch before roll, the order of coordinates that of EPSG:4326.
    """
    lines = [_PIX4D_COLUMNS, f"#altitude {DATUM_WORDS[tags.datum]}"]
    for k, name in enumerate(tags.frame_id):
        place = f"{tags.latitude_deg[k]:.9f},{tags.longitude_deg[k]:.9f},{tags.height_m[k]:.3f}"
        angles = ",".join(f"{angle:.4f}" for angle in _nadir_deg(tags, k))
        lines.append(f"{name},{place},{angles},{_sigmas(tags, k, ',')}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _nadir_deg(tags: GeoTags, k: int) -> Floats:
    return np.asarray(np.degrees(tags.nadir_ypr_rad[k]))


def _sigmas(tags: GeoTags, k: int, separator: str) -> str:
    return f"{tags.sigma_horizontal_m[k]:.3f}{separator}{tags.sigma_vertical_m[k]:.3f}"
