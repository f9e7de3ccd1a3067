"""Undetected errors, priors, removals and second order, in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey
from scipy.stats import norm

from uavgram.model.result.reliability import (
    ChecksOverall,
    Effects,
    Evidence,
    PriorResults,
    RemovalRecord,
    SecondOrder,
    WeakestLinks,
)
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PointChecks
from uavgram.views.report import render_annex, render_report
from uavgram.views.survey.reliability import line_limits, overall_words, prior_table


def judged(result: Result) -> Result:
    rows = result.measurements
    count, first = len(rows.name), rows.name[0]

    def effects(n: int, change: float) -> Effects:
        return Effects(
            on=(first,) + ("",) * (n - 1),
            change=np.array([change] + [np.nan] * (n - 1)),
            sigmas=np.array([1.0] + [np.nan] * (n - 1)),
        )

    return replace(
        result,
        evidence=Evidence(
            lines=effects(len(result.lines.name), 0.0421),
            picks=effects(len(result.picks.image), 0.01),
            priors=PriorResults(
                kind=("telemetry",),
                name=("image x axis",),
                frame_id=("IMG_<7>.jpg",),
                unit=("deg",),
                residual=np.array([5.7]),
                w=np.array([6.2]),
                redundancy=np.array([0.9]),
                bias=np.array([4.31]),
                effects=effects(1, -0.0133),
            ),
            weakest=WeakestLinks(
                what=("length 'south'",) * count,
                bias=np.array([0.0912] * count),
                unit=("m",) * count,
                change=np.array([0.0421] * count),
                unchecked=(tuple(f"pick of 'P{k}' in 'a.jpg'" for k in range(8)),) * count,
            ),
        ),
        second_order=SecondOrder(
            bias=np.array([0.125] * count),
            sigma=np.array([0.377] * count),
            curvature=np.array([0.5] * count),
            off=np.array([True] + [False] * (count - 1)),
        ),
        removals=(
            RemovalRecord(
                what="length 'north'",
                w=-25.94,
                group=("pick of 'Q' in 'b.jpg'",),
                rivals=("length 'east'",),
                variance_factor_before=9.12,
                variance_factor_after=1.03,
                change=(0.0456,) * count,
            ),
        ),
        checks_overall=ChecksOverall(
            count=7, chi2=8.25, probability=0.31, rms_error_m=0.0567, mean_error_percent=0.42
        ),
    )


def test_priors_are_marked_from_the_limit_that_they_share() -> None:
    result = judged(survey.build())
    assert result.evidence is not None
    one = result.evidence.priors
    limit = norm.isf(10 * 0.001 / 40 / 2)  # of forty; three coordinates of control have theirs
    w = np.array([limit + 0.01, limit - 0.01] + [0.0] * 38 + [3.3, -3.28, 0.0])
    priors = replace(
        one,
        kind=("telemetry",) * 40 + ("control",) * 3,
        name=one.name * 43,
        frame_id=one.frame_id * 43,
        unit=one.unit * 43,
        residual=w,
        w=w,
        redundancy=np.full(43, 0.9),
        bias=np.ones(43),
        effects=Effects(on=("",) * 43, change=np.full(43, np.nan), sigmas=np.full(43, np.nan)),
    )
    table = prior_table(replace(result, evidence=replace(result.evidence, priors=priors)))
    assert table.bad[:4] == (True, False, True, False)


def test_the_report_says_what_could_be_wrong_unseen() -> None:
    page = render_report(judged(survey.build())) + render_annex(judged(survey.build()))
    page = page.replace("&#39;", "'")
    assert "an undetected error of 0.0912 m in the length 'south' would move it by 0.042" in page
    assert "'P5' in 'a.jpg' and 2 more" in page
    assert "+0.042" in page
    assert "IMG_&lt;7&gt;.jpg" in page
    assert "4.31 °" in page
    assert "± 0.38 m is more realistic than ±" in page
    assert "the value tends to be 0.12 m too large" in page
    assert "1. The length 'north' (w = -25.9); variance factor 9.12 before, 1.03 after." in page
    assert "No test can distinguish it from: pick of 'Q' in 'b.jpg'." in page
    assert "It could also have been: length 'east'." in page


def test_errors_of_lengths_and_of_points_are_summed_up_apart() -> None:
    made = judged(survey.build())
    points = PointChecks(
        label=("C1", "C2"),
        error_m=np.array([[0.3, -0.4, 1.0], [0.3, 0.4, 2.0]]),
        sigma_m=np.ones((2, 3)),
        mahalanobis=np.ones(2),
    )
    words = overall_words(replace(made, point_checks=points))
    feet = replace(made.provenance, options=(("units.length", "ft"),))

    assert words.startswith("Root mean square errors: 1 length 0.017 m (0.42 % on average); ")
    assert "; 2 points 0.35 m in east and north, 1.58 m in height; chi-square" in words
    assert "1 length 0.056 ft" in overall_words(replace(made, provenance=feet))


def test_a_result_without_evidence_has_a_report_without_all_this() -> None:
    page = render_report(survey.build()) + render_annex(survey.build())
    assert "Errors that would not be detected" not in page
    assert "Removed as blunders" not in page


# What the report and the recording mark as odd is what the tests suspect.


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
