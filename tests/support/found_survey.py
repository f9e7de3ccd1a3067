"""A made-up survey whose points were picked, matched or found as targets, with tie points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.geometry.ground.row_projection import row_poses
from uavgram.model.observations import Source
from uavgram.model.result.reliability import Noise, PickNoise
from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud, TieSummary
from uavgram.views.survey.outlines import project_from

TIES = 400


TARGETS = ("P01", "P10", "P16")
MATCHED = ("P00", "P05", "P08", "P13", "P18", "P20", "P26")


def found(result: Result, ties: TieCloud) -> Result:
    """A result some of whose points are targets, and some picked once and matched from there."""
    picks, seen = result.picks, set[str]()
    sources: list[Source] = []
    for label in picks.label:
        again: Source = "match" if label in MATCHED and label in seen else "hand"
        sources.append("target" if label in TARGETS else again)
        seen.add(label)
    by_hand = np.array([source == "hand" for source in sources])
    count = np.bincount(ties.frame, minlength=len(result.frames.frame_id))
    return replace(
        result,
        picks=replace(
            picks,
            source=tuple(sources),
            score=np.where(by_hand, np.nan, 0.9 + 0.01 * (np.arange(len(by_hand)) % 10)),
        ),
        frames=replace(
            result.frames,
            ties=count,
            ties_rms_px=np.where(count > 0, 0.2 + 0.01 * np.arange(len(count)), np.nan),
        ),
        ties=TieSummary(points=TIES, sightings=len(ties.frame), rms_px=0.234),
        noise=Noise(
            picks=tuple(
                PickNoise(source=source, stated_px=stated, factor=1.24, sigma=0.05)
                for source, stated in (
                    ("hand", 0.8),
                    ("target", 0.05),
                    ("match", 0.1),
                    ("tie", 0.2),
                )
            ),
            roughness=(),
        ),
    )


def tie_cloud(result: Result) -> TieCloud:
    """Tie points all over the ground, in the photos that show them."""
    rng = np.random.default_rng(5)
    low, high = (f(result.points.position_world_m, axis=0) for f in (np.min, np.max))
    world = rng.uniform(low, high + np.array([0.0, 0.0, 1.0]), (TIES, 3))
    frames, pixels = [], []
    for frame in np.flatnonzero(result.has_refined).tolist():
        pixel = project_from(result, row_poses(result, frame), world)
        shown = np.flatnonzero(result.camera.is_in_photo(pixel))
        frames.append(np.full(len(shown), frame))
        pixels.append(pixel[shown])
    return TieCloud(
        position_world_m=world, frame=np.concatenate(frames), pixel_px=np.concatenate(pixels)
    )
