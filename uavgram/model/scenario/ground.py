"""The ground of a simulated scene beyond its plane: shapes along the road, relief."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.model.scenario.checks import require, require_sizes

Shape = Literal["plane", "level", "slope", "crown", "relief"]

SLOPE_DEG, CROWN_PERCENT, RELIEF_M = 5.0, 2.0, 0.05
"""Of shapes whose size is not written: a steep road, a road's crown, worn asphalt with ruts."""


@dataclass(frozen=True, kw_only=True)
class GroundSpec:
    """How the ground differs from the plane of `Site`.

    Attributes
    ----------
    shape
        ``plane``: as `Site` has it; ``level``: without its slope; ``slope``, ``crown``, ``relief``:
        with one of these in its usual size, where no size is written.
    slope_deg
        Upwards along the scene's x axis, on top of the site's slope.
    crown_percent
        Fall of the ground to both sides of the scene's x axis.
    slope_break_percent
        Rise of the ground to the left of the scene's x axis.
    kerb_m, kerb_y_m
        Step up to the left of a line parallel to the scene's x axis.
    relief_m, relief_length_m
        Standard deviation and correlation length of the ground's departure from all that; with a
        length of 0 each point has its own.
    height_sigma_m, slope_sigma_deg
        The plane is drawn anew in each repetition: height and each slope about those of `Site`.
    """

    shape: Shape = "plane"
    slope_deg: float = 0.0
    crown_percent: float = 0.0
    slope_break_percent: float = 0.0
    kerb_m: float = 0.0
    kerb_y_m: float = 3.5
    relief_m: float = 0.0
    relief_length_m: float = 5.0
    height_sigma_m: float = 0.0
    slope_sigma_deg: float = 0.0

    def __post_init__(self) -> None:
        require_sizes(self, "relief_m", "relief_length_m", "height_sigma_m", "slope_sigma_deg")
        require(abs(self.slope_deg) < 30, "slope_deg must lie between -30 and 30")
        usual = {
            "slope": ("slope_deg", SLOPE_DEG),
            "crown": ("crown_percent", CROWN_PERCENT),
            "relief": ("relief_m", RELIEF_M),
        }
        if self.shape in usual and not getattr(self, usual[self.shape][0]):
            object.__setattr__(self, *usual[self.shape])

    @property
    def is_plane(self) -> bool:
        """Whether it is what the program takes for granted."""
        sizes = (self.crown_percent, self.slope_break_percent, self.kerb_m, self.relief_m)
        return not any(sizes)
