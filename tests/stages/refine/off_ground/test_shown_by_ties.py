"""Ties without a match say how uneven the ground is, so that no length bends photos to a plane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tied_flights import Conditions, tied_flight
from tied_surveys import TiedSurvey, tied_survey

from uavgram.stages.refine.begin.tied_frames import with_tied_frames
from uavgram.stages.refine.sound_ties import SoundTies, with_sound_ties

RELIEF_M = 0.05
"""Of the points of made-up flights."""


@pytest.fixture(scope="module")
def flat() -> TiedSurvey:
    """A flight over uneven ground that was said to be smooth, and houses."""
    flight = tied_flight(Conditions(photos=6, seed=4, density=120.0, houses=True))
    return tied_survey(flight)


def sound(survey: TiedSurvey, roughness_m: float) -> SoundTies:
    """With some roughness stated."""
    grounds = tuple(replace(one, roughness_sigma_m=roughness_m) for one in survey.survey.grounds)
    begun, _ = with_tied_frames(replace(survey.survey, grounds=grounds))
    return with_sound_ties(begun)


def test_the_ground_gets_the_roughness_that_ties_show(flat: TiedSurvey) -> None:
    found = sound(flat, 0.0)

    (ground,) = found.survey.grounds
    assert np.isclose(ground.roughness_sigma_m, RELIEF_M, rtol=0.2)  # some 100 points
    assert found.shown.probability[0] < 1e-6
    assert not found.shown.off_ground


def test_a_ground_stated_to_be_rougher_stays_so(flat: TiedSurvey) -> None:
    found = sound(flat, 2.0 * RELIEF_M)

    assert not found.shown.roughness_m
    assert found.survey.grounds[0].roughness_sigma_m == 2.0 * RELIEF_M
