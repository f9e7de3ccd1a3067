"""What `camera_photos.camera_photo` may be told of a camera, to hand it on by name."""

from __future__ import annotations

from typing import TypedDict

from PIL.TiffImagePlugin import IFDRational


class CameraFacts(TypedDict, total=False):
    size: tuple[int, int]
    make: str
    model: str
    focal: tuple[int, int] | float | None
    equivalent: int | None
    zoom: tuple[int, int] | None
    distance: tuple[int, int] | None
    serial: str
    dji: dict[str, str] | None
    details: dict[int, float | IFDRational] | None
