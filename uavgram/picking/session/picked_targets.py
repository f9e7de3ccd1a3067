"""Chequers, crosses and discs picked by a person: their centres are measured in other photos.

A match carries the click's error along; the target's centre does not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.imaging.photos.cache import GreyPhotos
from uavgram.imaging.targets.uncoded import UncodedTarget
from uavgram.model.arrays import Floats
from uavgram.picking.document import commands as c
from uavgram.pipeline.pick.live_survey import LiveSurvey
from uavgram.pipeline.targets import make_pick_row, recognise_picked, recognise_same
from uavgram.stages.match import Pair


class PickedTargets:
    """Targets at picks, and their centres at matches of those picks.

    Parameters
    ----------
    survey
        The project.
    photos
        Grey pixels.
    """

    def __init__(self, survey: LiveSurvey, photos: GreyPhotos) -> None:
        self._survey, self._photos = survey, photos
        self._known: dict[tuple[Pair, float, float], UncodedTarget | None] = {}

    def target_at(self, match: c.Place, affine: Floats) -> c.Place:
        """Return the target's centre if the pick is on a target that is clear at the match too.

        Otherwise return the match.

        Parameters
        ----------
        match
            Match, with the pick that it was found from.
        affine
            (2, 2) d pixel there / d pixel of the pick.
        """
        own = self._at_pick(match)
        if own is None:
            return match
        # map the offset from click to centre into the other photo: p' = p_match + A d
        aside = own.pixel_px - [match.from_u_px, match.from_v_px]
        place = np.array([match.u_px, match.v_px]) + affine @ aside
        photo = self._photos.photos.get(match.image)
        there = recognise_same(photo, own.kind, place, match.sigma_px or 0.0)
        if there is None:
            return match
        focal = float(self._survey.inputs.calibration.parameters[0])
        row = make_pick_row(match.image, match.label, there, focal)
        return replace(
            match,
            u_px=row.u_px,
            v_px=row.v_px,
            sigma_px=row.sigma_px,
            source="target",
            score=row.score,
            from_image="",
            from_u_px=None,
            from_v_px=None,
        )

    def _at_pick(self, match: c.Place) -> UncodedTarget | None:
        """Return the target at the source pick of a match; each pick is searched once."""
        u, v = match.from_u_px or 0.0, match.from_v_px or 0.0
        key = (match.from_image, match.label), u, v
        if key not in self._known:
            photo = self._photos.photos.get(match.from_image)
            self._known[key] = recognise_picked(photo, match.label, np.array([u, v]), np.nan)
        return self._known[key]
