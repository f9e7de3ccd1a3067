"""What the report and the recording mark as odd is what the tests suspect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey
from scipy.stats import norm

from uavgram.views.survey.reliability import line_limits


def test_a_withheld_length_has_a_limit_of_its_own() -> None:
    result = survey.build()
    count = len(result.lines.w)
    many = replace(
        result.lines,
        w=np.ones(count),
        status=("checked", *["used"] * (count - 1)),  # type: ignore[arg-type]  # literals
    )
    limits = line_limits(replace(result, lines=many))
    assert limits[0] == pytest.approx(norm.isf(0.0005))
    shared = norm.isf(0.001 * min(1.0, 10 / (count - 1)) / 2)
    assert limits[1:] == pytest.approx(np.full(count - 1, shared))
