"""Whether what was picked, and what ties photos, lies in the photos that it names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from unicodedata import normalize

import numpy as np

from uavgram.errors import InputError, near_miss
from uavgram.model.arrays import Floats
from uavgram.model.flight.frames import Photos
from uavgram.model.options import Project
from uavgram.model.survey.observations import Picks
from uavgram.model.survey.ties import TiePicks

ANEW = "or take the tie points out by `uavgram picks ties --undo`, and look for them anew"


def check_picks(project: Project, picks: Picks, photos: Photos) -> None:
    """Refuse the first pick in a photo that is not there, or outside its photo.

    Parameters
    ----------
    project
        It names the table.
    picks, photos
        Of the project.

    Raises
    ------
    InputError
        Names file and line.
    """
    for i, why in _misplaced(picks.image, picks.pixel_px, photos):
        what = f"the pick of {picks.label[i]!r}"
        raise InputError(project.picks, f"{what} {why}", picks.line_of(i))


def check_ties(path: str, ties: TiePicks, photos: Photos) -> None:
    """Refuse the first sighting of a tie point in a photo that is not there, or outside its photo.

    Parameters
    ----------
    path
        The table.
    ties, photos
        Of the project.

    Raises
    ------
    InputError
        Names file and line.
    """
    for i, why in _misplaced(ties.image, ties.pixel_px, photos):
        text = f"the sighting of tie point {ties.tie[i]!r} {why}; {ANEW}"
        raise InputError(path, text, ties.line[i] if ties.line else None)


def _misplaced(
    images: Sequence[str], pixel_px: Floats, photos: Photos
) -> Iterator[tuple[int, str]]:
    """The first pixel that lies in no photo of the project, and why."""
    at = {name: k for k, name in enumerate(photos.frame_id)}
    photo = np.array([at.get(image, -1) for image in images], dtype=np.int64)
    size = np.stack([photos.width_px, photos.height_px], axis=1)[photo]
    inside = ((pixel_px >= -0.5) & (pixel_px <= size - 0.5)).all(axis=1)
    for i in np.flatnonzero((photo < 0) | ~inside)[:1].tolist():
        image, (u, v), (width, height) = images[i], pixel_px[i], size[i]
        if photo[i] < 0:
            yield (
                i,
                f"names the photo {image!r}, which is not among the project's "
                f"images{_photo_hint(image, photos)}",
            )
        else:
            yield (
                i,
                f"at ({u:g}, {v:g}) lies outside {image!r} "
                f"({width:.0f} x {height:.0f} px, original and unrotated)",
            )


def _photo_hint(image: str, photos: Photos) -> str:
    """Which photo may be meant."""
    if normalize("NFC", image) in (normalize("NFC", name) for name in photos.frame_id):
        return (
            "; a photo's name looks the same, but its accents are stored in another way (as macOS "
            "does): rename the photo without accents, and here too"
        )
    return f" ({near})" if (near := near_miss(image, photos.frame_id)) else ""
