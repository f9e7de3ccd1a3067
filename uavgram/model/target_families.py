"""Names of the families of coded plates that can be looked for."""

from __future__ import annotations

FAMILIES = {
    **{
        f"aruco-{bits}x{bits}-{count}": f"DICT_{bits}X{bits}_{count}"
        for bits in (4, 5, 6, 7)
        for count in (50, 100, 250, 1000)
    },
    "aruco-original": "DICT_ARUCO_ORIGINAL",
    "apriltag-16h5": "DICT_APRILTAG_16h5",
    "apriltag-25h9": "DICT_APRILTAG_25h9",
    "apriltag-36h10": "DICT_APRILTAG_36h10",
    "apriltag-36h11": "DICT_APRILTAG_36h11",
}
"""Name in a project file -> name of OpenCV's dictionary."""

DEFAULT_FAMILY = "aruco-4x4-50"
