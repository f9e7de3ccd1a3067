"""Interior orientation: what is known of the camera, and how well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.model.arrays import Floats, freeze

LensModel = Literal["brown", "fisheye"]

PARAMETER_NAMES: dict[LensModel, tuple[str, ...]] = {
    "brown": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"),
    "fisheye": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """A camera's interior orientation with its covariance.

    Attributes
    ----------
    name
        The camera's name.
    model
        ``brown`` (OpenCV's k1 k2 p1 p2 k3) or ``fisheye`` (OpenCV's k1 k2 k3 k4).
    width_px, height_px
        Size of the original image.
    parameters
        (P,) in the order of ``PARAMETER_NAMES[model]``: px, then dimensionless coefficients.
    covariance
        (P, P), same order.
    """

    name: str
    model: LensModel
    width_px: int
    height_px: int
    parameters: Floats
    covariance: Floats

    def __post_init__(self) -> None:
        n = len(PARAMETER_NAMES[self.model])
        freeze(self, parameters=(n,), covariance=(n, n))
        if self.width_px <= 0 or self.height_px <= 0:
            raise ValueError(
                f"width_px and height_px must be positive, got {self.width_px} x {self.height_px}"
            )
        if min(self.parameters[:2]) <= 0:
            raise ValueError(f"fx and fy must be positive, got {self.parameters[:2].tolist()}")
