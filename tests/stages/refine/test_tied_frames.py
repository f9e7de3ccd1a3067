"""No log, hardly a pick: ties place all frames, lengths tell their scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tied_flights import Conditions, tied_flight
from tied_surveys import TiedSurvey, tied_survey

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints
from uavgram.model.options import SolveOptions
from uavgram.model.survey import NO_SIGHTINGS
from uavgram.stages.refine import refine
from uavgram.stages.refine.tied_frames import add_tied_frames


@pytest.fixture(scope="module")
def small() -> TiedSurvey:
    """Eight photos, eight labels, three lengths that no photo need see together."""
    return tied_survey(tied_flight(Conditions(photos=8, seed=4, density=200.0)))


def distances(place: Floats) -> Floats:
    """(K, K) between points (K, n)."""
    return np.asarray(np.linalg.norm(place[:, None] - place[None], axis=2))


def wrong_rows(survey: TiedSurvey) -> Ints:
    """Rows of the ties that are wrong, in points that two photos or more show."""
    return np.flatnonzero(survey.flight.wrong)


def placed(adjustment: Adjustment, survey: TiedSurvey) -> Floats:
    """(K, K) errors of distances between labels, as a share of the height."""
    own, names = adjustment.survey.label, survey.survey.label
    true = survey.world[[names.index(name) for name in own], :2]
    return (distances(adjustment.state.point[:, :2]) - distances(true)) / survey.flight.height_m


def test_ties_and_lengths_measure_a_scene_without_a_log(small: TiedSurvey) -> None:
    survey, left_out = add_tied_frames(small.survey)
    assert len(survey.candidate_poses) == len(survey.frame_id) == 8
    assert not np.isin(wrong_rows(small), survey.ties.row).any()
    assert left_out >= set(wrong_rows(small).tolist())
    refined, messages = refine(small.survey, SolveOptions())
    (told,) = (one.text for one in messages if one.code == "ties-left-out")
    assert f"of {len(small.survey.ties.frame)} sightings" in told  # both searches as one
    assert len(refined.adjustment.survey.frame_id) == 8
    assert not refined.pick_reason
    assert np.abs(placed(refined.adjustment, small)).max() < 0.003


def test_first_poses_have_the_scale_of_the_lengths(small: TiedSurvey) -> None:
    survey, _ = add_tied_frames(small.survey)
    center = np.array([one.center_world_m[0] for one in survey.candidate_poses])
    frames = [int(name[1:3]) for name in survey.frame_id]
    true = small.flight.center[frames]
    np.testing.assert_allclose(distances(center), distances(true), atol=0.01 * 30.0)
    np.testing.assert_allclose(center[:, 2], true[:, 2], atol=0.3)


def test_without_ties_the_same_survey_cannot_begin(small: TiedSurvey) -> None:
    survey = replace(small.survey, ties=NO_SIGHTINGS)
    assert add_tied_frames(survey)[0].candidate_poses == ()
    with pytest.raises(GeometryError, match="nothing shows where the photos were taken"):
        refine(survey, SolveOptions())


def test_without_a_length_nothing_tells_the_scale(small: TiedSurvey) -> None:
    none = np.zeros(0)
    survey = replace(
        small.survey,
        line_start=none.astype(int),
        line_end=none.astype(int),
        line_name=(),
        line_tape=(),
        line_along=(),
        length_m=none,
        length_sigma_m=none,
    )
    assert add_tied_frames(survey)[0].candidate_poses == ()


def test_control_points_tell_the_axes(small: TiedSurvey) -> None:
    survey = replace(
        small.survey,
        gauge="world",
        control_label=np.arange(4),
        control_world_m=small.world[:4],
        control_sigma_m=np.full((4, 3), 0.02),
    )
    found, _ = add_tied_frames(survey)
    center = np.array([one.center_world_m[0] for one in found.candidate_poses])
    frames = [int(one.frame_id[1:3]) for one in found.candidate_poses]
    np.testing.assert_allclose(center, small.flight.center[frames], atol=0.5)
