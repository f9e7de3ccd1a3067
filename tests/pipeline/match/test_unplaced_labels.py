"""Labels of unknown height in several photos: those off the ground determine no pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from place_only_scenes import place_only

from uavgram.model.survey import Survey
from uavgram.pipeline.match.adjustment import find_unplaced, mark_sound_clicks
from uavgram.stages.refine.minima import Participants
from uavgram.stages.seed.headings import find_headings

RAISED_M = (1.4, 1.4, 1.4, 0.9, 0.9, 0.9, 5.3, 4.0)
LABELS = 20


def unplaced(survey: Survey) -> frozenset[str]:
    """The labels, where all picks and lengths take part."""
    every = np.ones(len(survey.pick_frame), np.bool_)
    none = np.zeros(len(survey.line_start), np.bool_)
    return find_unplaced(Participants(survey, every, none, {}), frozenset(survey.label))


@pytest.mark.parametrize("seed", [3, 4, 7])
def test_corners_of_cars_and_walls_are_told_from_the_ground_by_all_photos_together(
    seed: int,
) -> None:
    scene = place_only(seed, labels=LABELS, raised_m=RAISED_M)
    survey, _ = find_headings(scene.survey)
    off = {f"L{i:02d}" for i in range(LABELS - len(RAISED_M), LABELS)}

    assert unplaced(survey) == off & set(survey.label)


def test_a_label_in_one_photo_determines_none() -> None:
    survey, _ = find_headings(place_only(3, labels=LABELS, raised_m=RAISED_M).survey)
    first = np.unique(survey.pick_label, return_index=True)[1]
    some = np.zeros(len(survey.pick_label), np.bool_)
    some[first] = True
    alone = replace(
        survey,
        pick_frame=survey.pick_frame[some],
        pick_label=survey.pick_label[some],
        pixel_px=survey.pixel_px[some],
        pick_sigma_px=survey.pick_sigma_px[some],
    )

    assert unplaced(alone) == frozenset()


@pytest.mark.parametrize("seed", [3, 4])
def test_a_click_far_beside_the_others_is_the_only_one_left_out(seed: int) -> None:
    survey, _ = find_headings(place_only(seed, labels=LABELS, raised_m=RAISED_M).survey)
    shown = np.bincount(survey.pick_label)
    wrong = int(np.flatnonzero(shown[survey.pick_label] == shown.max())[0])
    pixel = survey.pixel_px.copy()
    pixel[wrong] += (60.0, -45.0)
    every = np.ones(len(pixel), np.bool_)
    none = np.zeros(len(survey.line_start), np.bool_)
    taking = Participants(replace(survey, pixel_px=pixel), every, none, {})

    sound = mark_sound_clicks(taking, frozenset(survey.label))

    assert np.flatnonzero(~sound).tolist() == [wrong]


def test_a_wrong_length_makes_no_click_wrong() -> None:
    survey, _ = find_headings(place_only(3, labels=LABELS, raised_m=RAISED_M).survey)
    length = survey.length_m.copy()
    length[0] += 1.0
    every = np.ones(len(survey.pick_frame), np.bool_)
    none = np.zeros(len(length), np.bool_)
    taking = Participants(replace(survey, length_m=length), every, none, {})

    assert mark_sound_clicks(taking, frozenset(survey.label)).all()
