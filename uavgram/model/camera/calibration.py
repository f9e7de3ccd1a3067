"""Interior orientation: what is known of the camera, and how well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import Floats, freeze
from uavgram.model.camera.readout import Readout

LensModel = Literal["brown", "fisheye"]

PARAMETER_NAMES: dict[LensModel, tuple[str, ...]] = {
    "brown": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"),
    "fisheye": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
}

_RATIONAL_NAMES = ("k4", "k5", "k6")


def parameter_counts(model: LensModel) -> tuple[int, ...]:
    """Numbers of parameters that a camera of this model may have.

    A brown camera has 9, or 12 with the rational coefficients k4 k5 k6 (OpenCV's 8 coefficients).
    """
    basic = len(PARAMETER_NAMES[model])
    return (basic, basic + len(_RATIONAL_NAMES)) if model == "brown" else (basic,)


def parameter_names(model: LensModel, count: int) -> tuple[str, ...]:
    """Names of the parameters of a camera that has `count` of them.

    Raises
    ------
    ValueError
        No camera of this model has that many.
    """
    if count not in parameter_counts(model):
        raise ValueError(
            f"a {model} camera has {' or '.join(map(str, parameter_counts(model)))} parameters, "
            f"got {count}"
        )
    return (PARAMETER_NAMES[model] + _RATIONAL_NAMES)[:count]


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """A camera's interior orientation with its covariance.

    Attributes
    ----------
    name
        The camera's name.
    model
        ``brown`` (OpenCV's k1 k2 p1 p2 k3, and k4 k5 k6 where there are 12 parameters) or
        ``fisheye`` (OpenCV's k1 k2 k3 k4).
    width_px, height_px
        Size of the original image.
    parameters
        (P,) in the order of `parameter_names`: px, then dimensionless coefficients.
    covariance
        (P, P), same order.
    readout
        How long a photo is read, where that is known: None stands for "it is not".
    """

    name: str
    model: LensModel
    width_px: int
    height_px: int
    parameters: Annotated[Floats, "n"]
    covariance: Annotated[Floats, "n", "n"]
    readout: Readout | None = None

    def __post_init__(self) -> None:
        freeze(self, n=len(self.parameter_names))
        if self.width_px <= 0 or self.height_px <= 0:
            raise ValueError(
                f"width_px and height_px must be positive, got {self.width_px} x {self.height_px}"
            )
        if min(self.parameters[:2]) <= 0:
            raise ValueError(f"fx and fy must be positive, got {self.parameters[:2].tolist()}")

    @property
    def correlation(self) -> Floats:
        """(P, P) of the parameters; 0 where one is known exactly."""
        return correlation_of(self.covariance)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """(P,) names of the parameters."""
        return parameter_names(self.model, len(self.parameters))


def correlation_of(covariance: Floats) -> Floats:
    """(P, P) correlations of a covariance, whose elements are comparable.

    A variance of 0, which holds a parameter fixed, stays 0.
    """
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(sigma > 0, sigma, 1.0)
    return np.asarray(covariance / np.outer(scale, scale))
