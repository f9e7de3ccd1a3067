"""Eye of a view in space: its position and target, chosen so that the whole scene is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats

# Tangents of half the angles of view that the scene may fill (Rerun's eye opens 55 degrees).
HALF_WIDTH, HALF_HEIGHT = 0.70, 0.47

WINDS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")


@dataclass(frozen=True, eq=False)
class Eye:
    """Eye of a view.

    Attributes
    ----------
    towards
        (3,) unit vector from the target to the eye; in a vertical view, north is up.
    target_m
        (3,) the target.
    distance_m
        Distance of the eye from the target.
    """

    towards: Floats
    target_m: Floats
    distance_m: float

    @classmethod
    def fitting(cls, points_m: Floats, towards: Floats) -> Eye:
        """Place target and eye so that all (N, 3) points are as large as fits into a view.

        A point r to the right and n nearer than the target is seen if |r - a| <= W (D - n), where
        the eye is at the distance D and has moved by a: the outermost on both sides give a and D.
        The same holds upward; then the larger D serves for both.
        """
        middle = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
        right, upward, nearer = _seen(points_m - middle, towards)
        shifts, distances = [], [1.0]
        for aside, share in ((right, HALF_WIDTH), (upward, HALF_HEIGHT)):
            # outermost points on both sides: largest W n + r (right) and W n - r (left)
            most, least = (share * nearer + aside).max(), (share * nearer - aside).max()
            shifts.append((most - least) / 2)
            distances.append(float(most + least) / (2 * share))
        to_the_right, up = _axes(towards)
        target = middle + shifts[0] * to_the_right + shifts[1] * up
        return cls(towards, target, max(distances))

    @property
    def position_m(self) -> Floats:
        """(3,) position of the eye."""
        return np.asarray(self.target_m + self.distance_m * self.towards)

    @property
    def heading(self) -> str:
        """Direction of view, one of eight compass points."""
        azimuth = np.arctan2(-self.towards[0], -self.towards[1])
        return WINDS[round(float(azimuth) / (np.pi / 4)) % 8]

    def on_screen(self, points_m: Floats) -> Floats:
        """Project (N, 3) points to (N, 2) tangents of angles, right and up."""
        right, upward, nearer = _seen(points_m - self.target_m, self.towards)
        depth = np.maximum(self.distance_m - nearer, 1e-9)
        return np.stack([right / depth, upward / depth], axis=-1)

    def in_space(self, points_m: Floats, screen: Floats) -> Floats:
        """Return (N, 3) places at (N, 2) tangents of `on_screen`, as far away as (N, 3) points."""
        right, up = _axes(self.towards)
        _, _, nearer = _seen(points_m - self.target_m, self.towards)
        aside = screen * np.maximum(self.distance_m - nearer, 1e-9)[:, None]
        across = aside[:, :1] * right + aside[:, 1:] * up
        return np.asarray(self.target_m + across + nearer[:, None] * self.towards)


def _seen(offset_m: Floats, towards: Floats) -> tuple[Floats, Floats, Floats]:
    """Split (N, 3) offsets from a target into (N,) parts: right, upward, and towards the eye."""
    right, up = _axes(towards)
    return offset_m @ right, offset_m @ up, offset_m @ towards


def _axes(towards: Floats) -> tuple[Floats, Floats]:
    """Return the directions (3,) right and (3,) upward on the screen."""
    right = np.cross([0.0, 0.0, 1.0], towards)
    length = float(np.linalg.norm(right))
    right = right / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    return right, np.cross(towards, right)
