"""Summarise: tie points, photo by photo, all together, and as a cloud to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.ties import TieCloud, TieSummary


class Tied(NamedTuple):
    """What ties the photos.

    Attributes
    ----------
    ties, rms_px
        (F,) tie points that each photo shows, and the root mean square of their residuals in each
        coordinate; NaN where it shows none.
    together
        All of them; None where none takes part.
    """

    ties: Ints
    rms_px: Floats
    together: TieSummary | None


def summarise_ties(adjustment: Adjustment, frame_id: Sequence[str]) -> Tied:
    """Tie points of an adjusted survey.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    frame_id
        (F,) all frames of the project.
    """
    ties = adjustment.survey.ties
    if not ties.points:
        return Tied(np.zeros(len(frame_id), np.int64), np.full(len(frame_id), np.nan), None)
    residual = adjustment.minimum.blocks["ties"].residual * ties.sigma_px[:, None]
    mean_square = np.mean(residual**2, axis=1)
    frame = _rows(adjustment, frame_id)[ties.frame]
    count = np.bincount(frame, minlength=len(frame_id))
    total = np.bincount(frame, mean_square, minlength=len(frame_id))
    rms = np.full(len(frame_id), np.nan)
    np.divide(total, count, out=rms, where=count > 0)
    together = TieSummary(
        points=ties.points, sightings=len(frame), rms_px=float(np.sqrt(mean_square.mean()))
    )
    return Tied(count, np.sqrt(rms), together)


def tie_cloud(adjustment: Adjustment, frame_id: Sequence[str]) -> TieCloud | None:
    """Tie points to look at; None where none takes part.

    Parameters
    ----------
    adjustment, frame_id
        As for `summarise_ties`.
    """
    survey = adjustment.survey
    if not survey.ties.points:
        return None
    return TieCloud(
        position_world_m=adjustment.state.tie[survey.matches.points :],
        frame=_rows(adjustment, frame_id)[survey.ties.frame],
        pixel_px=survey.ties.pixel_px,
    )


def _rows(adjustment: Adjustment, frame_id: Sequence[str]) -> Ints:
    """Where each frame of the adjustment stands among all frames."""
    row = {name: i for i, name in enumerate(frame_id)}
    return np.array([row[name] for name in adjustment.survey.frame_id], dtype=np.int64)
