"""Transfer of picked pixels to other photos, with covariances.

The transferred pixel shows the picked thing, and not the label's point: an offset between the
picked and the meant thing is the same in every photo. The pixel is transferred by the derivative of
the two photos' pixels by one point, A = J_target J_source^-1, with the point on its ground (or at
its height). The remaining error is that of J_target - A J_source in all unknowns: the position of
the point cancels, and errors that the poses of both photos share nearly do. The height above the
ground remains in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import (
    FlightOfPhotos,
    PixelRows,
    compute_unpicked_rows,
    predict_rows,
    propagate_pairs,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints

EAST_NORTH = slice(0, 2)
"""East and north among the unknowns of a point."""

MIN_DETERMINANT = 1e-9
"""Determinant [px^2/m^2] below which a photo sees the ground edge-on."""


ARRAYS = ("click", "pixel_px", "covariance_px2", "affine", "rise", "jacobian", "columns", "own")
"""Fields of `TransferredPixels` with a row for each place."""


@dataclass(frozen=True, eq=False)
class PickedPixels:
    """Picks of m pixels (m, 2), each in a frame (m,) and of a label (m,) of the adjustment."""

    frame: Ints
    label: Ints
    pixel_px: Floats


@dataclass(frozen=True, eq=False)
class TransferredPixels:
    """n picked pixels at their predicted places in other photos.

    Attributes
    ----------
    click
        (n,) index of the picked pixel.
    frame_id
        (n,) the other photo.
    pixel_px, covariance_px2
        (n, 2), (n, 2, 2) predicted pixel and its covariance.
    affine
        (n, 2, 2) d pixel there / d pixel here.
    rise
        (n, 2) d pixel there / d height [px/m] of the shown thing; 0 if its height is stated, or was
        estimated.
    jacobian, columns
        (n, 2, k), (n, k): derivatives of the error, and the columns of the unknowns.
    own
        (n, 2, 6) covariance root of the other photo's telemetry errors, if the photo is not
        adjusted.
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

    def select(self, rows: Ints) -> TransferredPixels:
        """Select some places (m,)."""
        columns = {name: getattr(self, name)[rows] for name in ARRAYS}
        return TransferredPixels(frame_id=tuple(self.frame_id[k] for k in rows), **columns)

    def joint_covariance(self, adjustment: Adjustment, rows: Ints) -> Floats:
        """Compute the joint covariance (2 m, 2 m) of some places in one other photo."""
        size, m = adjustment.problem.layout.size, len(rows)
        gradient = np.zeros((size, m, 2))
        at = self.columns[rows, :, None], np.arange(m)[:, None, None], np.arange(2)
        np.add.at(gradient, at, np.swapaxes(self.jacobian[rows], 1, 2))
        flat, own = gradient.reshape(size, 2 * m), self.own[rows].reshape(2 * m, -1)
        return np.asarray(flat.T @ adjustment.minimum.factor.solve(flat) + own @ own.T)


def transfer_pixels(
    adjustment: Adjustment, flight: FlightOfPhotos | None, clicked: PickedPixels
) -> TransferredPixels:
    """Transfer picked pixels to every photo that should show them but has no pick of their label.

    Parameters
    ----------
    adjustment
        Adjusted survey.
    flight
        Flight of all photos with telemetry, for those without a pick.
    clicked
        Picked pixels.
    """
    here = predict_rows(adjustment, clicked.frame, clicked.label)
    parts = [
        _transfer(adjustment, here, there, clicked)
        for there in compute_unpicked_rows(adjustment, flight)
    ]
    width = max(part.columns.shape[1] for part in parts)
    parts = [_pad(part, width) for part in parts]
    names = tuple(name for part in parts for name in part.frame_id)
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ARRAYS}
    return TransferredPixels(frame_id=names, **joined)


def transfer_between_picks(adjustment: Adjustment, clicked: PickedPixels) -> TransferredPixels:
    """Transfer picked pixels to each other photo with a pick of their label.

    Parameters
    ----------
    adjustment, clicked
        As for `transfer_pixels`.
    """
    here = predict_rows(adjustment, clicked.frame, clicked.label)
    return _transfer(adjustment, here, here, clicked)


def _pad(part: TransferredPixels, width: int) -> TransferredPixels:
    """Pad the derivatives with columns of zeros."""
    more = width - part.columns.shape[1]
    return replace(
        part,
        jacobian=np.pad(part.jacobian, ((0, 0), (0, 0), (0, more))),
        columns=np.pad(part.columns, ((0, 0), (0, more))),
    )


def _transfer(
    adjustment: Adjustment, here: PixelRows, there: PixelRows, clicked: PickedPixels
) -> TransferredPixels:
    """Transfer every picked pixel to the photos `there` that show its label."""
    click, row = np.nonzero(clicked.label[:, None] == there.label[None])
    at, to = here.jacobian[click], there.jacobian[row]
    place = at[:, :, EAST_NORTH]
    area = place[:, 0, 0] * place[:, 1, 1] - place[:, 0, 1] * place[:, 1, 0]
    with np.errstate(invalid="ignore"):  # NaN: not visible
        seen = np.asarray((np.abs(area) > MIN_DETERMINANT) & np.isfinite(to.sum(axis=(1, 2))))
    click, row, at, to = click[seen], row[seen], at[seen], to[seen]
    # A = J_target J_source^-1; the click's offset from the label's predicted pixel moves with A.
    affine = to[:, :, EAST_NORTH] @ np.linalg.inv(at[:, :, EAST_NORTH])
    beside = clicked.pixel_px[click] - here.pixel_px[click]
    moved = there.pixel_px[row] + np.einsum("nij,nj->ni", affine, beside)
    # Error of the transfer: (J_target - A J_source) by all unknowns.
    jacobian = np.concatenate([to, -affine @ at], axis=2)
    columns = np.concatenate([there.columns[row], here.columns[click]], axis=1)
    own = there.own[row]
    covariance = own @ np.swapaxes(own, 1, 2) + propagate_pairs(adjustment, columns, jacobian)
    names = tuple(there.frame_id[k] for k in row)
    survey, up = adjustment.survey, slice(2, adjustment.problem.layout.point_size)
    rise = (to[:, :, up] - affine @ at[:, :, up]).sum(axis=2)  # 0 if no height is unknown
    is_known = (survey.height_above_m != 0.0) | survey.is_free
    rise[is_known[clicked.label[click]]] = 0.0
    return TransferredPixels(click, names, moved, covariance, affine, rise, jacobian, columns, own)
