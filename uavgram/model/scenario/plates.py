"""Coded plates that lie in a simulated scene, or that a plan may lay."""

from __future__ import annotations

from dataclasses import dataclass

from uavgram.model.scenario.checks import require
from uavgram.model.target_families import CORNERS, LARGEST_PLATE_M, corner_label

FAMILY = "aruco-4x4-50"
MOST_PLATES = 50


@dataclass(frozen=True, kw_only=True)
class PlateSpec:
    """Plates of one size.

    Attributes
    ----------
    side_m, sigma_m
        Side of the black square, and its standard deviation, as in a project's `targets`.
    corner_px
        Standard deviation of a corner as the program finds it.
    at
        Where they lie, (x, y, turn) each: scene axes [m], and how far their sides are turned
        counterclockwise from the x axis [deg].
    """

    side_m: float = 0.5
    sigma_m: float = 0.0005
    corner_px: float = 0.1
    at: tuple[tuple[float, float, float], ...] = ()

    def __post_init__(self) -> None:
        require(0 < self.side_m <= LARGEST_PLATE_M, "side_m must be above 0, at most 10 m")
        require(
            0 < self.sigma_m <= 0.1 * self.side_m, "sigma_m must be above 0, at most side_m / 10"
        )
        require(self.corner_px > 0, "corner_px must be greater than 0")
        require(len(self.at) <= MOST_PLATES, f"at must name at most {MOST_PLATES} plates")

    @property
    def labels(self) -> tuple[str, ...]:
        """Of all corners, plate by plate."""
        return tuple(corner_label(k, c) for k in range(len(self.at)) for c in range(CORNERS))
