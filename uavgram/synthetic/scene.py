"""True ground of a synthetic scene, drawn at random, and the points on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.geometry.ground.figures import squares_on_plane
from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.stages.plate_sides import OWN_SIGMA_SHARE
from uavgram.synthetic.scenario import GroundSpec, Scenario


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface(FrozenArrays):
    """Heights of the ground.

    Attributes
    ----------
    spec
        Its departures from the plane.
    height_m, slope, middle_m
        z = height + slope . ((e, n) - middle), (2,) and (2,).
    axes
        (2, 2) ``east_north = axes @ scene_xy``.
    wave_per_m, cosine_m, sine_m
        (W, 2), (W,), (W,) of the relief; W = 0 without.
    """

    spec: GroundSpec
    height_m: float
    slope: Annotated[Floats, 2]
    middle_m: Annotated[Floats, 2]
    axes: Annotated[Floats, 2, 2]
    wave_per_m: Annotated[Floats, "w", 2]
    cosine_m: Annotated[Floats, "w"]
    sine_m: Annotated[Floats, "w"]

    def up(self, offset_m: Floats) -> Floats:
        """Return heights (...) at (..., 2) east and north of the scene's middle."""
        plane = self.height_m + offset_m @ self.slope
        if self.spec.is_plane:
            return np.asarray(plane)
        left = (offset_m @ self.axes)[..., 1]
        angle = offset_m @ self.wave_per_m.T
        shape = (
            -self.spec.crown_percent / 100 * np.abs(left)
            + self.spec.slope_break_percent / 100 * np.maximum(left, 0.0)
            + self.spec.kerb_m * (left > self.spec.kerb_y_m)
        )
        return np.asarray(
            plane + shape + np.cos(angle) @ self.cosine_m + np.sin(angle) @ self.sine_m
        )


WAVE_COUNT = 200  # of a relief: enough for normally distributed heights


def draw_surface(scenario: Scenario, rng: np.random.Generator) -> Surface:
    """Draw the ground.

    Parameters
    ----------
    scenario
        Its site and its ground.
    rng
        Draws the plane, where that is drawn, and the relief: a sum of waves whose covariance is a
        Gaussian of the relief's length.
    """
    site, spec = scenario.site, scenario.ground
    axes = site.axes
    stated = (0.0, 0.0) if spec.shape == "level" else site.ground_slope_deg
    slope = np.tan(np.deg2rad(stated)) + np.tan(np.deg2rad(spec.slope_deg)) * axes[:, 0]
    drawn = rng.standard_normal(3)
    slope = slope + np.tan(np.deg2rad(spec.slope_sigma_deg)) * drawn[1:]
    count = WAVE_COUNT if spec.relief_m and spec.relief_length_m else 0
    size = spec.relief_m / np.sqrt(max(count, 1))
    return Surface(
        spec=spec,
        height_m=site.ground_height_m + spec.height_sigma_m * float(drawn[0]),
        slope=slope,
        middle_m=site.middle_m,
        axes=axes,
        wave_per_m=rng.standard_normal((count, 2)) / (spec.relief_length_m or 1.0),
        cosine_m=size * rng.standard_normal(count),
        sine_m=size * rng.standard_normal(count),
    )


PLATE_STEP_M = 0.2
"""Distance to either side over which the slope of the ground at a plate is computed [m]."""


def compute_point_positions(
    scenario: Scenario, surface: Surface, rng: np.random.Generator
) -> Floats:
    """Return world positions (K, 3) of the scenario's points and of its plates' corners.

    Parameters
    ----------
    scenario
        Its points.
    surface
        The ground below them.
    rng
        Draws each point's own departure, where the relief has no length.
    """
    raised = {one.label: one.height_m for one in scenario.habits.raised}
    xy = np.array([[point.x_m, point.y_m] for point in scenario.points])
    offset = xy @ surface.axes.T
    up = surface.up(offset)
    up = up + [point.height_m + raised.get(point.label, 0.0) for point in scenario.points]
    if surface.spec.relief_m and not surface.spec.relief_length_m:
        up = up + surface.spec.relief_m * rng.standard_normal(len(up))
    points = np.column_stack([offset + surface.middle_m, up])
    return np.concatenate([points, _plate_corners(scenario, surface, rng)])


def _plate_corners(scenario: Scenario, surface: Surface, rng: np.random.Generator) -> Floats:
    """Return the (N, 3) corners of all plates: flat, in their printed size, on the ground.

    Clockwise from above, as they are found in photos, from the left end of the far edge. The height
    of a plate is that of the ground below its middle.
    """
    plates = scenario.plates
    if not plates.at:
        return np.zeros((0, 3))
    placed = np.array(plates.at)
    offset = placed[:, :2] @ surface.axes.T
    up = surface.up(offset)
    if surface.spec.relief_m and not surface.spec.relief_length_m:
        up = up + surface.spec.relief_m * rng.standard_normal(len(up))
    # slope of the ground by central differences
    step = PLATE_STEP_M * np.array([[1.0, 0.0], [0.0, 1.0]])
    slope = np.stack([surface.up(offset + d) - surface.up(offset - d) for d in step], axis=-1)
    middle = np.column_stack([offset + surface.middle_m, up])
    east = np.arctan2(*surface.axes[::-1, 0])
    turn = east + np.deg2rad(placed[:, 2])
    side = plates.side_m + plates.sigma_m * float(rng.standard_normal())
    corners = squares_on_plane(middle, slope / (2 * PLATE_STEP_M), turn, side)[:, ::-1]
    own = OWN_SIGMA_SHARE * plates.sigma_m / np.sqrt(2.0)
    return np.asarray((corners + own * rng.standard_normal(corners.shape)).reshape(-1, 3))
