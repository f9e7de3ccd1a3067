"""Points that one photo shows, beside several that were found off the ground."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scenes import make_scene

from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.message import Message
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.minima import Participants, best_minima
from uavgram.stages.refine.off_ground.heights import with_free
from uavgram.stages.refine.off_ground.unseen import with_unseen_heights

HEIGHTS = {0: 1.0, 1: 2.0, 2: 1.5, 3: 0.8}
ONCE, TWICE = ("P10", "P11"), "P9"
FOUND = tuple(f"P{k}" for k in HEIGHTS)


def survey_with(found: tuple[str, ...], once: tuple[str, ...]) -> tuple[Survey, Refined]:
    """Points off the ground, some freed; some are in the first photo only, one in two."""
    full = make_scene(4, frames=6, heights=HEIGHTS).survey
    survey = replace(full, height_above_m=np.zeros(len(full.label)))
    left = {survey.label.index(name): 1 for name in once} | {survey.label.index(TWICE): 2}
    keep = np.ones(len(survey.pick_label), dtype=np.bool_)
    for k, label in enumerate(survey.pick_label.tolist()):
        keep[k] = left.get(label, 1) > 0
        left[label] = left.get(label, 99) - 1
    survey = with_free(survey, list(found))
    lines = np.zeros(len(survey.line_start), dtype=np.bool_)
    return survey, best_minima(Participants(survey, keep, lines, {}))


@cache
def treated(
    found: tuple[str, ...] = FOUND, once: tuple[str, ...] = ONCE
) -> tuple[Survey, Survey, Refined, tuple[Message, ...]]:
    """The survey before, then what it became."""
    survey, refined = survey_with(found, once)
    assert set(np.unique(survey.pick_label).tolist()) == set(range(len(survey.label)))
    return (survey, *with_unseen_heights(survey, refined, found))


def test_the_sigma_is_that_of_points_of_which_a_share_stands_so_high() -> None:
    before, survey, refined, _ = treated()
    points = len(before.label) - len(ONCE)  # all others are in two photos or more
    share = len(FOUND) / points
    sigma = np.sqrt(share * np.mean(np.square(list(HEIGHTS.values()))))
    once = np.isin(survey.label, ONCE)
    assert survey.height_sigma_m[once] == pytest.approx(sigma, rel=0.05)
    own = refined.adjustment.survey
    taken = own.height_sigma_m[np.isin(own.label, ONCE)]
    assert taken == pytest.approx(survey.height_sigma_m[once])


def test_points_in_two_photos_keep_what_they_had() -> None:
    before, survey, *_ = treated()
    others = ~np.isin(survey.label, ONCE)
    assert survey.height_sigma_m[others].tolist() == before.height_sigma_m[others].tolist()


def test_the_height_of_a_point_is_known_no_better_than_said() -> None:
    _, survey, refined, _ = treated()
    adjustment = refined.adjustment
    height = adjustment.state.point[adjustment.label_rows(ONCE), 2]
    assert np.abs(height).max() < float(survey.height_sigma_m.max())
    assert adjustment.minimum.converged


@pytest.mark.parametrize("count", [1, 2])
def test_one_or_two_are_exceptions(count: int) -> None:
    before, survey, _, messages = treated(FOUND[:count])
    assert survey is before
    assert messages == ()


def test_where_every_point_is_in_two_photos_nothing_is_done() -> None:
    before, survey, _, messages = treated(once=())
    assert survey is before
    assert messages == ()


@pytest.mark.parametrize("once", [ONCE, ONCE[:1]])
def test_the_message_names_them_and_says_what_to_do(once: tuple[str, ...]) -> None:
    _, survey, _, (message,) = treated(once=once)
    sigma_m = survey.height_sigma_m[survey.label.index(once[0])]
    assert (message.code, message.labels) == ("heights-unseen", once)
    several = len(once) > 1
    assert message.text.startswith("2 points are" if several else "The point 'P10' is")
    assert f"pick {'them' if several else 'it'} in a second photo" in message.text
    assert f"where {len(FOUND)} others stand off the ground" in message.text
    assert message.text.endswith(f"taken as uncertain by {sigma_m:.2f} m.")
