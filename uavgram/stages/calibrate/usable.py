"""Which photos a calibration can use at all."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.model.camera.board import BoardObservations, BoardPhoto

FEWEST_CORNERS = 6
"""Corners of a photo: four determine its homography, the others say something of the camera."""

FEWEST_PHOTOS = 3
"""A plane gives two conditions on the camera (Zhang 2000, sec. 2.4)."""

SAME_PX = 1e-6
"""Corners this close are those of the same picture: noise alone moves them by more."""


def usable_photos(
    observations: BoardObservations,
) -> tuple[BoardObservations, tuple[tuple[BoardPhoto, str], ...]]:
    """Leave out photos that say nothing, with the reason for each.

    Raises
    ------
    GeometryError
        Too few are left.
    """
    kept: list[BoardPhoto] = []
    left_out: list[tuple[BoardPhoto, str]] = []
    for photo in observations.photos:
        twin = next((other for other in kept if _is_same(photo, other)), None)
        if len(photo.corner) < FEWEST_CORNERS:
            found = f"only {len(photo.corner)} corners were found, at least {FEWEST_CORNERS} needed"
            left_out.append((photo, found))
        elif _in_line(photo, observations):
            left_out.append((photo, "the corners found lie in one line of the board"))
        elif twin is not None:
            left_out.append((photo, f"the same picture as {twin.file}"))
        else:
            kept.append(photo)
    if len(kept) < FEWEST_PHOTOS:
        reasons = "".join(f"; {photo.file}: {reason}" for photo, reason in left_out)
        raise GeometryError(
            f"{len(kept)} usable photo(s) of the board do not determine a camera: take at least "
            f"{FEWEST_PHOTOS}, better 15, with the board tilted in different directions{reasons}"
        )
    return BoardObservations(board=observations.board, photos=tuple(kept)), tuple(left_out)


def _in_line(photo: BoardPhoto, observations: BoardObservations) -> bool:
    place = observations.board.corner_board_m[photo.corner, :2]
    spread = np.linalg.svd(place - place.mean(axis=0), compute_uv=False)
    return bool(spread[-1] < 0.1 * observations.board.square_m)


def _is_same(first: BoardPhoto, second: BoardPhoto) -> bool:
    return bool(
        np.array_equal(first.corner, second.corner)
        and np.abs(first.pixel_px - second.pixel_px).max(initial=0.0) < SAME_PX
    )
