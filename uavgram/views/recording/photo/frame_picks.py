"""Picks of each frame, and projections of the adjusted points from its poses."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from uavgram.geometry.ground.row_projection import RowPoses
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import point_index
from uavgram.views.survey.drawing import project_from


@dataclass(frozen=True, eq=False)
class FramePicks:
    """Picks of each frame and their projections.

    Attributes
    ----------
    rows
        (n,) rows of the picks of each frame.
    seed_px, refined_px
        (P, 2) projections of the adjusted point; NaN without a pose or outside the photo.
    """

    rows: list[Ints]
    seed_px: Floats
    refined_px: Floats


def project_picks(result: Result) -> FramePicks:
    """Project every picked point back into its frame, from both poses."""
    at = point_index(result)
    known = np.array([at.get(label, -1) for label in result.picks.label], dtype=np.int64)
    rows = rows_by_frame(result)
    seed = np.full((len(known), 2), np.nan)
    refined = np.full((len(known), 2), np.nan)
    for frame, in_frame in enumerate(rows):
        picks = in_frame[known[in_frame] >= 0]
        points = result.points.position_world_m[known[picks]]
        for poses, pixel, adjusted in (
            (result.frames.seed, seed, False),
            (result.frames.refined, refined, True),
        ):
            if len(picks) and np.isfinite(poses.center_world_m[frame, 0]):
                pixel[picks] = project_from(
                    result,
                    RowPoses(
                        poses.center_world_m[frame],
                        poses.world_from_camera[frame],
                        result.frames.sweep[frame],
                    ),
                    points,
                    adjusted_lens=adjusted,
                )
    return FramePicks(rows, seed, refined)


def rows_by_frame(result: Result) -> list[Ints]:
    """Return the rows of the picks of each frame, in their order."""
    names = {name: i for i, name in enumerate(result.frames.frame_id)}
    frame = np.array([names.get(image, -1) for image in result.picks.image], dtype=np.int64)
    # group the picks by frame: a stable sort, then the first row of each frame
    order = np.argsort(frame, kind="stable")
    edges = np.searchsorted(frame[order], np.arange(len(names) + 1))
    return [order[a:b] for a, b in pairwise(edges)]
