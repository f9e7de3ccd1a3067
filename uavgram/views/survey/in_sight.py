"""Objects that each photo may show: of a large survey, a few."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.result import Result

SIDE_SAMPLES = 9
"""Samples on each side of a photo, whose directions give its angle of view."""


class InSight:
    """Bounding spheres of polylines, and the cone of view of a photo.

    Objects outside the cone are in no pixel of the photo; those that touch it may be.

    Parameters
    ----------
    result
        Result with the adjusted photos.
    strips
        (n, 3) polylines in the world.
    """

    def __init__(self, result: Result, strips: list[Floats]) -> None:
        lows = np.reshape([strip.min(axis=0) for strip in strips], (-1, 3))
        highs = np.reshape([strip.max(axis=0) for strip in strips], (-1, 3))
        self._middle = (lows + highs) / 2
        self._radius = np.linalg.norm(highs - lows, axis=1) / 2
        self._poses, self._sweep = result.frames.refined, result.frames.sweep
        self._half_angle = _half_angle(result)

    def of(self, frame: int) -> Ints:
        """Return the rows of the polylines that a frame may show, in any of its rows of pixels."""
        # direction of each sphere against the optical axis
        away = self._middle - self._poses.center_world_m[frame]
        distance = np.linalg.norm(away, axis=1)
        moved, turned = np.linalg.norm(self._sweep[frame].reshape(2, 3), axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = away @ self._poses.world_from_camera[frame][:, 2] / distance
            wide = np.arcsin(np.minimum((self._radius + moved) / distance, 1.0))
        # seen if angle off axis <= half angle of view + turn during readout + angular radius
        off_axis = np.arccos(np.clip(ahead, -1.0, 1.0))
        is_around = distance <= self._radius + moved
        return np.flatnonzero(is_around | (off_axis <= self._half_angle + turned + wide))


def _half_angle(result: Result) -> float:
    """Return the largest angle to the optical axis in a photo [rad]; pi if the lens gives none."""
    share = np.linspace(0.0, 1.0, SIDE_SAMPLES)
    zero, one = np.zeros_like(share), np.ones_like(share)
    side = np.concatenate([share, one, share, zero]), np.concatenate([zero, share, one, share])
    # rays of points along the border of the photo
    border = np.column_stack(side) * [result.camera.width_px, result.camera.height_px] - 0.5
    ray = back_project(result.camera.model, result.shared.intrinsics.value, border)
    widest = float(np.arctan(np.linalg.norm(ray[:, :2], axis=1)).max())
    return widest if np.isfinite(widest) else np.pi
