"""Scale bars that are drawn over the photos of the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground.row_projection import row_poses
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Region, Result
from uavgram.views.survey.drawing import Drawing
from uavgram.views.survey.outlines import project_from
from uavgram.views.units import round_bar, units_of


class Bar(NamedTuple):
    """Scale bar in pixels of the photo, and its length in words."""

    length: float
    text: str


def scale_bars(result: Result, regions: Sequence[Region]) -> dict[Region, Bar]:
    """Compute scale bars at the depth of each picture's subject; an overview has none."""
    shown = [region for region in regions if region.subject != "overview"]
    if not shown:
        return {}
    row_of = {label: row for row, label in enumerate(result.points.label)}
    place = result.points.position_world_m
    around = [[row_of[label] for label in _around(result, region)] for region in shown]
    middle = np.stack([place[rows].mean(axis=0) for rows in around])
    poses = row_poses(result, np.array([region.frame for region in shown]))
    # ground size of a pixel: depth along the optical axis over the focal length
    depth_m = np.sum((middle - poses.center) * poses.rotation[:, :, 2], axis=1)
    pixel_m = depth_m / float(result.shared.intrinsics.value[0])
    units = units_of(result)
    bars = [
        round_bar(0.35 * region.width_px * size_m, units) if size_m > 0 else (np.nan, "")
        for region, size_m in zip(shown, pixel_m.tolist(), strict=True)
    ]
    # ends of a bar parallel to the rows of the photo
    half = poses.rotation[:, :, 0] * np.array([[bar_m] for bar_m, _ in bars]) / 2
    # project the bars of all pictures at once: there may be hundreds
    ends = project_from(result, poses, np.stack([middle - half, middle + half]))
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    return {
        region: Bar(long, text)
        for region, long, (_, text) in zip(shown, length.tolist(), bars, strict=True)
        if np.isfinite(long)
    }


def place_bar(drawing: Drawing, bar: Bar, region: Region, picked_px: Floats) -> None:
    """Draw the bar at the left end of the lower edge, or at the right one if it hides less there.

    Parameters
    ----------
    drawing
        Drawing in pixels of the photo.
    bar
        Bar to place.
    region
        Part of the photo.
    picked_px
        (n, 2) picks that it should not hide.
    """
    unit = drawing.unit
    width = max(bar.length + 20 * unit, 48 * unit)
    edge, low = 4 * unit, region.top_px + region.height_px - 36 * unit
    sides = region.left_px + np.array([edge, region.width_px - width - edge])
    x, y = picked_px[:, :1], picked_px[:, 1:]
    hidden = (y > low) & (x - 8 * unit < sides + width) & (x + 8 * unit > sides)
    left = sides[np.argmin(hidden.sum(axis=0))] + (width - bar.length) / 2
    base = region.top_px + region.height_px - 22 * unit
    drawing.scale_bar(float(left), base, bar.length, bar.text, patch=0.85)


def _around(result: Result, region: Region) -> tuple[str, ...]:
    """Return the labels at whose centre a scale bar is valid."""
    if region.subject == "point":
        return (result.points.label[region.row],)
    return result.measurements.outlines[region.row]
