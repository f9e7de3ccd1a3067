"""OpenCV's families of coded markers."""

from __future__ import annotations

import cv2


def dictionary_size(name: str) -> int:
    """Return the number of markers of a dictionary; 0 for an unknown name."""
    if name not in dictionary_names():
        return 0
    return len(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)).bytesList)


def dictionary_names() -> tuple[str, ...]:
    """Return the names of OpenCV's dictionaries."""
    return tuple(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
