"""What the report says of errors that the survey showed to be of another size than stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey
from uneven_ground import NOISE, uneven

from uavgram.model.result.reliability import Noise
from uavgram.model.result.result import Result
from uavgram.views.report import render_annex
from uavgram.views.report.measurements import describe_learnt_noise


def grown(result: Result, ratio: float, *, noise: Noise | None = NOISE) -> Result:
    """Sigmas that grew by `ratio`, the last one by a tenth more."""
    rows = result.measurements
    times = np.full(len(rows.sigma), ratio)
    times[np.flatnonzero(np.isfinite(rows.sigma))[-1]] *= 1.1
    return replace(result, measurements=replace(rows, sigma_stated=rows.sigma / times), noise=noise)


def test_growth_is_told_with_its_causes() -> None:
    result = grown(survey.build(), 1.9)
    sentence = (
        "The uncertainties are 1.9 to 2.1 times as large as with errors as stated, because "
        "the ground is not a plane and the picks are less exact than stated (1 px stated, 1.6 px "
        "found)."
    )
    assert describe_learnt_noise(result) == sentence
    assert sentence in render_annex(result)


def test_smaller_uncertainties_are_told_too() -> None:
    (picks,), flat = NOISE.picks, replace(NOISE.roughness[0], estimated_m=0.0, relief_m=0.0)
    noise = Noise(picks=(replace(picks, factor=0.5),), roughness=(flat,))
    assert describe_learnt_noise(grown(survey.build(), 0.5, noise=noise)) == (
        "The uncertainties are 0.5 to 0.6 times as large as with errors as stated, because "
        "the picks are more exact than stated (1 px stated, 0.5 px found)."
    )


@pytest.mark.parametrize(("ratio", "noise"), [(0.952, NOISE), (2.0, None)])
def test_nothing_is_told_of_little_changes_or_where_nothing_was_learnt(
    ratio: float, noise: Noise | None
) -> None:
    assert not describe_learnt_noise(grown(survey.build(), ratio, noise=noise))
    assert not describe_learnt_noise(survey.build(measures=()))


def test_the_drawing_says_in_words_what_colours_and_numbers_are() -> None:
    html, flat = render_annex(uneven(survey.build())), render_annex(survey.build())

    for words in ("ground above its plane", "below it", "centimetres above (+) or below (-)"):
        assert words in html
        assert words not in flat
    assert "ground off its plane [m]" in html
    assert "-0.200 ± 0.020" in html
    assert "off its plane [m]" not in flat
