"""Where the thing under a picked pixel appears in other photos, and how well that is known.

Not where the label appears: what was picked beside the thing that was meant is beside it in every
photo. The pixel is carried over by the derivative of the two photos' pixels by one point,
A = J_target J_source^-1, with the point on its ground (or at its height), so the error that is
left is that of J_target - A J_source in all unknowns: where the point lies drops out, and what the
poses of both photos have in common nearly does. The height above the ground stays in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import (
    FlightOfPhotos,
    PixelRows,
    propagated,
    rows_at,
    unpicked_rows,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints

PLACE = slice(0, 2)
"""East and north among the unknowns of a point."""

SMALLEST = 1e-9
"""Square pixels per square pixel below which a photo sees the ground edge-on."""


@dataclass(frozen=True, eq=False)
class Clicked:
    """m picked pixels (m, 2), each in a frame (m,) and of a label (m,) of the adjustment."""

    frame: Ints
    label: Ints
    pixel_px: Floats


@dataclass(frozen=True, eq=False)
class Transferred:
    """n picked pixels as they should appear in other photos.

    Attributes
    ----------
    click
        (n,) which of the picked pixels.
    frame_id
        (n,) the other photo.
    pixel_px, covariance_px2
        (n, 2), (n, 2, 2) where, and how well that is known.
    affine
        (n, 2, 2) d pixel there / d pixel here.
    rise
        (n, 2) d pixel there / d height [px/m] of what is shown here; 0 where its height is stated,
        or has been found.
    jacobian, columns
        (n, 2, k), (n, k): derivatives of the error by which unknowns.
    own
        (n, 2, 6) root of what the other photo's telemetry adds, where it is not adjusted.
    """

    click: Ints
    frame_id: tuple[str, ...]
    pixel_px: Floats
    covariance_px2: Floats
    affine: Floats
    rise: Floats
    jacobian: Floats
    columns: Ints
    own: Floats

    def joint_covariance(self, adjustment: Adjustment, rows: Ints) -> Floats:
        """(2 m, 2 m) of some places in one other photo, together."""
        size, m = adjustment.problem.layout.size, len(rows)
        gradient = np.zeros((size, m, 2))
        at = self.columns[rows, :, None], np.arange(m)[:, None, None], np.arange(2)
        np.add.at(gradient, at, np.swapaxes(self.jacobian[rows], 1, 2))
        flat, own = gradient.reshape(size, 2 * m), self.own[rows].reshape(2 * m, -1)
        return np.asarray(flat.T @ adjustment.minimum.factor.solve(flat) + own @ own.T)


def transferred(
    adjustment: Adjustment, flight: FlightOfPhotos | None, clicked: Clicked
) -> Transferred:
    """Picked pixels in every photo that should show them and in which their label is not picked.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    flight
        Of all photos with telemetry, for those without a pick.
    clicked
        The pixels.
    """
    here = rows_at(adjustment, clicked.frame, clicked.label)
    parts = [
        _carried(adjustment, here, there, clicked) for there in unpicked_rows(adjustment, flight)
    ]
    width = max(part.columns.shape[1] for part in parts)
    parts = [_widened(part, width) for part in parts]
    names = tuple(name for part in parts for name in part.frame_id)
    arrays = ("click", "pixel_px", "covariance_px2", "affine", "rise", "jacobian", "columns", "own")
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in arrays}
    return Transferred(frame_id=names, **joined)


def _widened(part: Transferred, width: int) -> Transferred:
    """With further columns that nothing hangs on."""
    more = width - part.columns.shape[1]
    return replace(
        part,
        jacobian=np.pad(part.jacobian, ((0, 0), (0, 0), (0, more))),
        columns=np.pad(part.columns, ((0, 0), (0, more))),
    )


def _carried(
    adjustment: Adjustment, here: PixelRows, there: PixelRows, clicked: Clicked
) -> Transferred:
    """Every picked pixel in the photos `there` that show its label."""
    click, row = np.nonzero(clicked.label[:, None] == there.label[None])
    at, to = here.jacobian[click], there.jacobian[row]
    place = at[:, :, PLACE]
    area = place[:, 0, 0] * place[:, 1, 1] - place[:, 0, 1] * place[:, 1, 0]
    with np.errstate(invalid="ignore"):  # NaN is not seen
        seen = np.asarray((np.abs(area) > SMALLEST) & np.isfinite(to.sum(axis=(1, 2))))
    click, row, at, to = click[seen], row[seen], at[seen], to[seen]
    affine = to[:, :, PLACE] @ np.linalg.inv(at[:, :, PLACE])
    beside = clicked.pixel_px[click] - here.pixel_px[click]
    moved = there.pixel_px[row] + np.einsum("nij,nj->ni", affine, beside)
    jacobian = np.concatenate([to, -affine @ at], axis=2)
    columns = np.concatenate([there.columns[row], here.columns[click]], axis=1)
    own = there.own[row]
    covariance = own @ np.swapaxes(own, 1, 2) + propagated(adjustment, columns, jacobian)
    names = tuple(there.frame_id[k] for k in row)
    survey, up = adjustment.survey, slice(2, adjustment.problem.layout.point_size)
    rise = (to[:, :, up] - affine @ at[:, :, up]).sum(axis=2)  # 0 where no height is unknown
    is_known = (survey.height_above_m != 0.0) | survey.is_free
    rise[is_known[clicked.label[click]]] = 0.0
    return Transferred(click, names, moved, covariance, affine, rise, jacobian, columns, own)
