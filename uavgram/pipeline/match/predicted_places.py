"""Predicted places of picks in other photos, as input of the matching."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import TransferredPixels
from uavgram.imaging.matching.least_squares import SoughtPoints
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.observations import Picks
from uavgram.pipeline.match.height_evidence import MIN_PX
from uavgram.stages.match import REGION_SQUARED


def make_search_places(
    places: TransferredPixels, rows: Ints, picks: Picks, pick: Ints
) -> SoughtPoints:
    """Convert predicted places to the input of the matching.

    Parameters
    ----------
    places, rows
        Predicted places, and numbers (m,) of those to search for.
    picks, pick
        All picks, and (m,) rows of those whose points are searched for.
    """
    by_hand = np.flatnonzero(picks.of_source("hand")).tolist()
    photos = Counter(label for _, label in {(picks.image[i], picks.label[i]) for i in by_hand})
    return SoughtPoints(
        is_confirmed=np.array([photos[picks.label[i]] > 1 for i in pick], dtype=np.bool_),
        source_px=picks.pixel_px[pick],
        target_px=places.pixel_px[rows],
        covariance_px2=places.covariance_px2[rows] + MIN_PX**2 * np.eye(2),
        affine=places.affine[rows],
        rise=places.rise[rows],
    )


@dataclass(frozen=True, eq=False)
class PredictedPlaces:
    """Set of n predicted places of picks in other photos.

    Attributes
    ----------
    pick
        (n,) number of the pick that each is predicted from.
    image, label
        (n,) the photo, and the label.
    radius_px
        (n,) half lengths of the regions that hold 99.9 %.
    is_raised
        (n,) whether the point is off the ground.
    row, predicted
        (n,) row of each among the predictions, and all of these.
    """

    pick: Ints
    image: tuple[str, ...]
    label: tuple[str, ...]
    radius_px: Floats
    is_raised: Bools
    row: Ints
    predicted: TransferredPixels

    def __len__(self) -> int:
        return len(self.image)

    @property
    def affine(self) -> Floats:
        """Affine maps (n, 2, 2): d pixel there / d pixel of the pick."""
        return self.predicted.affine[self.row]

    def holds(self, row: int, pixel_px: tuple[float, float]) -> bool:
        """Return whether a pixel is within the region of a place."""
        at = self.row[row]
        off = np.array(pixel_px) - self.predicted.pixel_px[at]
        covariance = self.predicted.covariance_px2[at] + MIN_PX**2 * np.eye(2)
        return bool(off @ np.linalg.solve(covariance, off) <= REGION_SQUARED)

    def sought(self, picks: Picks, rows: Ints) -> SoughtPoints:
        """Convert places to the input of the matching."""
        return make_search_places(self.predicted, self.row[rows], picks, self.pick[rows])
