"""Runs a survey as if the program knew no causes: what a fault does where nothing is done of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from uavgram.estimation.survey.adjustment import Refined
from uavgram.geometry.camera.projection import back_project
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.pipeline.measure import compute as computing
from uavgram.pipeline.measure import pose as posing
from uavgram.stages.refine.minima import Participants, find_best_minima

UNTREATED: Mapping[str, object] = {
    "solve.noise": "stated",
    "tape.scale_sigma": 0.0,
    "ground.slope_sigma_deg": 0.5,
    "camera.readout_ms": 0.0,
}
"""What the program takes for granted then."""


@contextmanager
def nothing_treated() -> Iterator[None]:
    """All observations in one adjustment, at the stated noise, and nothing else."""

    def plainly(survey: Survey, options: SolveOptions) -> tuple[Refined, tuple[Message, ...]]:
        del options
        camera = survey.calibration
        ray = back_project(camera.model, camera.parameters, survey.pixel_px)
        keep = np.isfinite(ray.sum(axis=1))
        no_line = np.zeros(len(survey.line_start), dtype=bool)
        refined = find_best_minima(Participants(survey, keep, no_line, {}))
        return replace(refined, pick_removed=np.zeros(len(keep), dtype=bool)), ()

    with (
        patch.object(computing, "refine", plainly),
        patch.object(posing, "find_faults", lambda *_: ()),
    ):
        yield
