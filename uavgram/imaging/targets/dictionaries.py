"""OpenCV's families of coded markers."""

from __future__ import annotations

import cv2


def dictionary_size(name: str) -> int:
    """Number of markers of a dictionary; 0 where OpenCV knows none of that name."""
    if name not in dictionary_names():
        return 0
    return len(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)).bytesList)


def dictionary_names() -> tuple[str, ...]:
    """Names of the dictionaries that OpenCV knows."""
    return tuple(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
