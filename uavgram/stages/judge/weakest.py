"""For each measurement, the undetected error that would move it most."""

from __future__ import annotations

import numpy as np

from uavgram.model.result.reliability import WeakestLinks
from uavgram.stages.judge.tested_survey import TestedSurvey


def judge_weakest(examined: TestedSurvey) -> WeakestLinks:
    """Weakest link of each of M measurements, and what of it nothing checks."""
    names, what, units = examined.names, [], []
    bias = np.full(len(examined.weakest), np.nan)
    for i, weakest in enumerate(examined.weakest):
        if weakest.member is None:
            what.append("")
            units.append("")
        else:
            what.append(names.observation(weakest.member))
            bias[i], unit = examined.bias(weakest.member)
            units.append(unit)
    return WeakestLinks(
        what=tuple(what),
        bias=bias,
        unit=tuple(units),
        change=np.array([weakest.change for weakest in examined.weakest]),
        unchecked=tuple(
            tuple(names.observation(m) for m in weakest.unchecked) for weakest in examined.weakest
        ),
    )
