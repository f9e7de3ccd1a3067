"""Names of the families of coded plates, and labels of plates and their corners."""

from __future__ import annotations

import re

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
"""Name in a project file to name of OpenCV's dictionary."""

BOARD_PLATE = "charuco"
"""Name of a ChArUco board's kind, the text before its first colon."""

LARGEST_PLATE_M = 10.0

MIN_SIDE_PX = 16.0
"""Smallest side of a plate in a photo [px] at which it is found reliably."""

PLATE_CORNERS = 4
_CORNER = re.compile(r"T(\d+)-([1-4])")


def plate_label(plate: int) -> str:
    """Return the name of a plate, which is also the label of the intersection of its diagonals."""
    return f"T{plate}"


def corner_label(plate: int, corner: int) -> str:
    """Return the label of a corner, counted from 0."""
    return f"T{plate}-{corner + 1}"


def plate_of(label: str) -> int | None:
    """Return the plate of a corner's label; None for any other label."""
    match = _CORNER.fullmatch(label)
    return int(match[1]) if match else None
