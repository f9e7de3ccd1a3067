"""Axes of straight lines: along, to the left along the ground, and upwards; with derivatives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats

STEEP = 0.7
"""Rise of a line of unit length from which on its components are taken east and north: along the
ground and upwards mean nothing any more."""


class LineAxes(NamedTuple):
    """Three axes of lines: (..., 3) unit vectors, and their derivatives (..., 3, 3) by the line."""

    along: Floats
    aside: Floats
    upward: Floats
    along_by_line: Floats
    aside_by_line: Floats
    upward_by_line: Floats

    def components(self, *, on_ground: bool) -> tuple[Floats, Floats]:
        """(..., c, 3) axes square to the line, and their derivatives (..., c, 3, 3)."""
        if on_ground:
            return self.aside[..., None, :], self.aside_by_line[..., None, :, :]
        axes = np.stack([self.aside, self.upward], axis=-2)
        return axes, np.stack([self.aside_by_line, self.upward_by_line], axis=-3)


def line_axes(line: Floats) -> LineAxes:
    """Axes of lines (..., 3); NaN for one without length."""
    along, length = unit_vectors(line)
    steep = np.abs(along[..., 2]) > STEEP
    # up x along points to the left; of a steep line north x along, which is east of one upwards.
    reference = np.where(steep[..., None], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    aside, size = unit_vectors(np.cross(reference, along))
    along_by_line = _square_to(along, length)
    across_by_line = np.cross(reference[..., None, :], along_by_line.swapaxes(-1, -2))
    aside_by_line = _square_to(aside, size) @ across_by_line.swapaxes(-1, -2)
    turned = np.cross(along_by_line.swapaxes(-1, -2), aside[..., None, :])
    turned = turned + np.cross(along[..., None, :], aside_by_line.swapaxes(-1, -2))
    upward = np.cross(along, aside)
    return LineAxes(along, aside, upward, along_by_line, aside_by_line, turned.swapaxes(-1, -2))


def unit_vectors(vector: Floats) -> tuple[Floats, Floats]:
    """Vectors (..., 3) at unit length, and their lengths (...); both NaN for the zero vector."""
    length = np.linalg.norm(vector, axis=-1)
    length = np.where(length > 0, length, np.nan)
    return vector / length[..., None], length


def _square_to(unit: Floats, size: Floats) -> Floats:
    """(..., 3, 3) derivatives of unit vectors (..., 3) by vectors of those sizes (...)."""
    outer = unit[..., :, None] * unit[..., None, :]
    return np.asarray((np.eye(3) - outer) / size[..., None, None])
