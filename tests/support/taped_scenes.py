"""Scenes whose lengths were read on tapes of known scales, some of them held level."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scenes import Scene

from uavgram.model.observations import Along


def read_on_tapes(
    scene: Scene,
    scale: Mapping[str, float],
    *,
    sigma: float,
    along: Sequence[Along] = ("slope",),
    taking_part: Sequence[str] = (),
) -> Scene:
    """The scene, its lengths read anew; tapes and ways to measure by turns.

    The errors of the readings stay. `sigma` is the prior of each scale.

    Parameters
    ----------
    scene
        As `make_scene` makes it.
    scale
        True scale of each tape: +0.01 reads 1 % short.
    sigma
        Prior of the scales.
    along
        What is measured, by turns.
    taking_part
        Tapes with an unknown in the truth's state; left out, all.
    """
    survey = scene.survey
    n = len(survey.line_start)
    span = scene.world[survey.line_end] - scene.world[survey.line_start]
    error = survey.length_m - np.linalg.norm(span, axis=1)
    tape = tuple(list(scale)[i % len(scale)] for i in range(n))
    ways = tuple(along[i % len(along)] for i in range(n))
    span[np.array(ways) == "horizontal", 2] = 0.0
    right = np.linalg.norm(span, axis=1)
    read = right / (1.0 + np.array([scale[name] for name in tape])) + error
    survey = replace(survey, length_m=read, line_tape=tape, line_along=ways, tape_scale_sigma=sigma)
    known = taking_part or tuple(scale)
    truth = replace(scene.truth, tape=np.array([scale[name] for name in known]))
    return replace(scene, survey=survey, truth=truth)
