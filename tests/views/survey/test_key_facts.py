"""What a reader wants to know first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import synthetic_survey as survey

from uavgram.model.message import Message
from uavgram.views.survey.key_facts import (
    frame_counts,
    frame_states,
    key_facts,
    largest_ellipse,
    least_certain_length,
)


def test_the_facts_answer_the_four_questions() -> None:
    facts = dict(key_facts(survey.build()))

    assert facts["photos"].startswith("20 photos")
    assert facts["least certain length for its size"] == "road width: 6.310 ± 0.012 m (0.19 %)"
    assert (
        facts["known length that fits worst"] == "R3 hedge, P17 to P23: +0.210 m off (13.5 sigma)"
    )
    assert facts["largest 95 % ellipse within the survey (half axes)"] == "P24: 4.7 cm × 2.8 cm"


def test_a_removed_length_without_a_statistic_may_fit_worst() -> None:
    lines = survey.build().lines
    residual, w = lines.residual_m.copy(), lines.w.copy()
    residual[0], w[0] = 3.2, np.nan
    status = ("removed", *lines.status[1:])
    changed = replace(lines, residual_m=residual, w=w, status=status)
    facts = dict(key_facts(replace(survey.build(), lines=changed)))

    assert facts["known length that fits worst"].startswith(f"{lines.name[0]}, ")
    assert "+3.200 m off" in facts["known length that fits worst"]
    assert facts["known length that fits worst"].endswith("removed)")


def test_the_largest_ellipse_is_that_within_the_survey() -> None:
    points = survey.build().points
    within = points.relative.ellipse_95_m.copy()
    within[7] = [0.5, 0.1]
    changed = replace(points, relative=replace(points.relative, ellipse_95_m=within))
    result = replace(survey.build(), points=changed)

    assert largest_ellipse(result) == 7
    assert np.argmax(points.ellipse_95_m[:, 0]) != 7


def test_the_least_known_point_is_that_against_its_neighbours() -> None:
    points = survey.build().points
    sigma = np.full(len(points.label), 0.012)
    sigma[[3, 9]] = np.nan, 0.031
    around = (("P02", "P04"),) * len(points.label)
    rated = replace(points, neighbour_sigma_m=sigma, neighbours=around)
    facts = dict(key_facts(replace(survey.build(), points=rated)))

    fact = facts["point least known against its neighbours"]
    assert fact == f"{points.label[9]}: ± 3.1 cm (P02, P04)"


def test_areas_angles_and_coordinates_are_no_lengths() -> None:
    result = survey.build()
    sigma = result.measurements.sigma.copy()
    for name in ("patch", "bend", "rest position east", "skid speed"):
        sigma[result.measurements.name.index(name)] = 100.0
    worse = replace(result, measurements=replace(result.measurements, sigma=sigma))
    row = least_certain_length(worse)

    assert row is not None
    assert result.measurements.name[row] == "road width"


def test_a_survey_without_points_has_only_frames_to_tell() -> None:
    facts = key_facts(survey.build(lines=(), measures=(), point_count=0))

    assert [question for question, _ in facts] == ["photos"]


def test_a_single_point_has_no_shape() -> None:
    result = survey.build(point_count=1, lines=(), measures=())
    nothing = replace(result.points.relative, ellipse_95_m=np.zeros((1, 2)))
    alone = replace(result, points=replace(result.points, relative=nothing))

    assert largest_ellipse(alone) is None


# What became of each frame.


def strained(frame_id: str) -> Message:
    """What it says in words is nobody's business: the frame is in its data."""
    return Message("warning", "telemetry-strained", "Look at it.", frames=(frame_id,))


def test_a_suspect_pick_makes_a_frame_one_to_check() -> None:
    states = frame_states(survey.build())

    assert states[0] == "check"
    assert states[1] == "refined"
    assert (states[5], states[11], states[14]) == ("unmatched", "rejected", "seeded")


def test_strained_telemetry_makes_a_frame_one_to_check() -> None:
    result = survey.build(clean=True)
    name = result.frames.frame_id[3]
    states = frame_states(replace(result, messages=(strained(name),)))

    assert set(frame_states(result)) == {"refined"}
    assert [i for i, state in enumerate(states) if state == "check"] == [3]


def test_a_frame_that_is_not_refined_keeps_its_status_whatever_its_picks() -> None:
    result = survey.build()
    messages = tuple(strained(result.frames.frame_id[i]) for i in (5, 11, 14))

    assert frame_states(replace(result, messages=messages)) == frame_states(result)


def test_the_counts_say_how_many_and_whether_any_was_rejected() -> None:
    assert frame_counts(survey.build()) == (
        "20 photos: 17 refined (1 to check), 1 no picks, 1 not in the log, 1 rejected"
    )
    assert frame_counts(survey.build(clean=True)) == "20 photos: 20 refined, none rejected"
    assert frame_counts(survey.build(frame_count=1)).startswith("1 photo: 1 refined")
