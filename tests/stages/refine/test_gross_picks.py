"""One gross pick where points may depart from their plane: named alone, and nothing else moves."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from place_only_scenes import PlaceOnly, place_only

from uavgram.estimation.reliability.data_snooping import find_suspicions
from uavgram.estimation.reliability.redundancy import compute_test_statistics
from uavgram.model.options import GroundOptions, SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.seed.headings import find_headings

ROUGH_M = 0.66


def survey_with(frames: int, off_px: float, scene_seed: int = 1) -> tuple[Survey, int, PlaceOnly]:
    """A rough survey, one of whose picks is off; and which."""
    ground = GroundOptions(roughness_sigma_m=ROUGH_M, height_sigma_m=1.0)
    scene = place_only(scene_seed, frames=frames, labels=11, ground=ground)
    survey, _ = find_headings(scene.survey)
    often = np.bincount(survey.pick_label)[survey.pick_label]
    pick = int(np.flatnonzero(often >= min(frames, 3))[4])
    pixel = survey.pixel_px.copy()
    pixel[pick] += np.array([0.6, -0.8]) * off_px
    return replace(survey, pixel_px=pixel), pick, scene


@pytest.mark.parametrize(("frames", "off_px"), [(3, 60.0), (3, 500.0), (4, 200.0)])
def test_a_gross_pick_is_named_alone(frames: int, off_px: float) -> None:
    survey, pick, scene = survey_with(frames, off_px)
    refined, messages = refine(survey, SolveOptions())
    adjustment = refined.adjustment

    assert list(refined.pick_reason) == [pick]
    assert [m.code for m in messages] == ["pick-left-out"]
    (far,) = re.findall(r"(\d+) px away", messages[0].text)
    assert int(far) == pytest.approx(off_px, abs=10)
    assert np.abs(adjustment.minimum.blocks["roughness"].residual).max() < 4.0
    assert np.abs(scene.pose_errors(adjustment)).max() < 3.5
    assert len(list(find_suspicions(adjustment, compute_test_statistics(adjustment), 1e-4))) == 0


@pytest.mark.parametrize("off_px", [8.0, 15.0])
def test_a_moderate_pick_is_left_out_or_reported_first(off_px: float) -> None:
    survey, pick, _ = survey_with(4, off_px)
    refined, _ = refine(survey, SolveOptions())
    if refined.pick_reason:
        assert list(refined.pick_reason) == [pick]
        return
    adjustment = refined.adjustment
    accused = next(find_suspicions(adjustment, compute_test_statistics(adjustment), 0.001)).suspect
    assert (accused.kind, refined.pick_index[accused.row]) == ("pixels", pick)


def test_of_two_picks_of_a_point_nothing_tells_which_is_wrong() -> None:
    survey, pick, _ = survey_with(4, 700.0)
    mine = np.flatnonzero(survey.pick_label == survey.pick_label[pick])
    keep = np.ones(len(survey.pick_frame), dtype=bool)
    keep[[k for k in mine if k != pick][1:]] = False
    two = replace(
        survey,
        pick_frame=survey.pick_frame[keep],
        pick_label=survey.pick_label[keep],
        pixel_px=survey.pixel_px[keep],
        pick_sigma_px=survey.pick_sigma_px[keep],
    )
    refined, _ = refine(two, SolveOptions())

    left_out = {survey.label[two.pick_label[k]] for k in refined.pick_reason}
    assert left_out <= {survey.label[survey.pick_label[pick]]}
    departure = refined.adjustment.minimum.blocks["roughness"].residual
    assert np.abs(departure).max() < 10.0


def test_right_picks_of_a_rough_ground_stay() -> None:
    survey, _, _ = survey_with(4, 0.0)
    refined, messages = refine(survey, SolveOptions())

    assert refined.pick_reason == {}
    assert messages == ()
