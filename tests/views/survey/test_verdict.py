"""The first sentence."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import synthetic_survey as survey

from uavgram.views.survey.verdict import judge


def test_a_survey_without_a_flaw_is_good() -> None:
    verdict = judge(survey.build(clean=True))

    assert verdict.level == "good"
    assert verdict.reasons == ()
    assert verdict.counts.startswith("20 of 20 frames refined, 4 of 5 known lengths used")


def test_a_suspect_length_is_named_first_with_its_error() -> None:
    verdict = judge(survey.build())

    assert verdict.level == "look"
    assert "'R3 hedge' disagrees with the rest by 0.210 m" in verdict.reasons[0]
    assert verdict.reasons[0] in verdict.sentence


def test_every_flaw_of_the_survey_is_among_the_reasons() -> None:
    reasons = " ".join(judge(survey.build()).reasons)

    for flaw in (
        "1 pick suspect",
        "DSC_0011.jpg",
        "DSC_0005.jpg",
        "to the tree",
        "R6 fence",
        "1.62",
    ):
        assert flaw in reasons


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"converged": False}, "did not converge"),
        ({"degrees_of_freedom": 0}, "Nothing is redundant"),
        ({"chi2_probability": 1e-5}, "disagree more than their sigmas"),
    ],
)
def test_a_doubtful_adjustment_is_not_good(change: dict[str, Any], words: str) -> None:
    result = survey.build(clean=True)
    doubtful = replace(result, solution=replace(result.solution, **change))

    assert words in judge(doubtful).sentence


def test_a_check_outside_three_sigma_is_not_good() -> None:
    result = survey.build(clean=True)
    error = result.point_checks.error_m.copy()
    error[1, 2] = 0.1  # of 0.03
    checks = replace(result.point_checks, error_m=error)

    assert "three sigma: P29" in judge(replace(result, point_checks=checks)).sentence


def test_a_withheld_length_outside_three_sigma_is_not_good() -> None:
    result = survey.build(clean=True)
    checks = replace(result.line_checks, z=np.full(len(result.line_checks.z), -3.2))

    assert "three sigma: R4 wall" in judge(replace(result, line_checks=checks)).sentence


def test_other_solutions_of_the_lengths_are_told() -> None:
    verdict = judge(survey.build(telemetry=False, clean=True))

    assert "1 other camera position" in verdict.sentence
