"""Photos of which all picks are wrong in one way, told as such, with the mend of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene

from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Cause, Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.causes.hypothesis import Diagnosis, correct_survey
from uavgram.stages.refine.causes.identification import identify_causes
from uavgram.stages.refine.causes.turned_photos import (
    propose_photos_elsewhere,
    propose_turned_photos,
)
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.refine.robust_candidate import MISPLACED

OPTIONS = {"frames": 6, "labels": 10, "lines": 4, "spread": 6.0, "tilt": 0.2}
WIDTH, HEIGHT = 2000, 1500


def without_the_photo(survey: Survey) -> Diagnosis:
    """The survey adjusted without all picks of f2, as they contradict the rest."""
    none = np.zeros(len(survey.line_start), dtype=np.bool_)
    taking = Participants(survey, np.ones(len(survey.pick_frame), dtype=np.bool_), none, {})
    taking = taking.leave_out_frame(2, MISPLACED)
    return Diagnosis(taking, find_best_minima(taking))


def cause_of(survey: Survey) -> Cause:
    diagnosis = without_the_photo(survey)
    found = identify_causes(diagnosis).causes
    (cause,) = (*found, *propose_photos_elsewhere(diagnosis, found))
    assert cause.message.frames == ("f2",)
    assert cause.settles == {"f2"}
    return cause


def with_pixels(survey: Survey, pixel_px: Floats) -> Survey:
    pixel = np.array(survey.pixel_px)
    pixel[survey.pick_frame == 2] = pixel_px
    return replace(survey, pixel_px=pixel)


@pytest.mark.parametrize(
    ("code", "shown"),
    [
        ("photo-mirrored", lambda u, v: (WIDTH - 1 - u, v)),
        ("photo-turned", lambda u, v: (WIDTH - 1 - u, HEIGHT - 1 - v)),
        # The top edge of what is shown is the left edge of the photo, from its bottom upwards.
        ("photo-turned", lambda u, v: (HEIGHT - 1 - v, u)),
        ("photo-turned", lambda u, v: (v, WIDTH - 1 - u)),
    ],
)
def test_a_photo_that_was_mirrored_or_turned_is_put_back(
    scene_factory: Callable[..., Scene],
    code: str,
    shown: Callable[[Floats, Floats], tuple[Floats, Floats]],
) -> None:
    survey = scene_factory(3001, **OPTIONS).survey
    assert (survey.calibration.width_px, survey.calibration.height_px) == (WIDTH, HEIGHT)
    right = survey.pixel_px[survey.pick_frame == 2]
    wrong = with_pixels(survey, np.stack(shown(*right.T), axis=1))
    (hypothesis,) = propose_turned_photos(without_the_photo(wrong))
    assert hypothesis.message is not None
    assert hypothesis.message(None).code == code
    assert hypothesis.mend is not None
    assert correct_survey(wrong, hypothesis.mend).pixel_px == pytest.approx(survey.pixel_px)


def test_a_turned_photo_that_nothing_but_the_log_contradicts_is_told(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(3001, **OPTIONS).survey
    wrong = with_pixels(survey, [WIDTH - 1, HEIGHT - 1] - survey.pixel_px[survey.pick_frame == 2])
    _, messages = refine(wrong, SolveOptions(noise="stated"))
    assert (messages[0].code, messages[0].frames) == ("photo-turned", ("f2",))


def test_labels_in_disorder_are_put_in_order(scene_factory: Callable[..., Scene]) -> None:
    survey = scene_factory(3001, **OPTIONS).survey
    label = np.array(survey.pick_label)
    picks = np.flatnonzero(survey.pick_frame == 2)
    label[picks] = np.roll(label[picks], 3)
    wrong = replace(survey, pick_label=label)
    cause = cause_of(wrong)
    assert cause.message.code == "labels-swapped"
    assert cause.mend is not None
    assert correct_survey(wrong, cause.mend).pick_label.tolist() == survey.pick_label.tolist()


def test_labels_that_fit_a_few_picks_only_put_no_photo_right(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(3001, **OPTIONS | {"labels": 24}).survey
    label = np.array(survey.pick_label)
    picks = np.flatnonzero(survey.pick_frame == 2)
    shown, anywhere = picks[: len(picks) * 2 // 5], picks[len(picks) * 2 // 5 :]
    label[shown] = np.roll(label[shown], 3)
    pixel = survey.pixel_px.copy()
    pixel[anywhere] = np.random.default_rng(5).uniform(100.0, 1400.0, (len(anywhere), 2))
    cause = cause_of(replace(survey, pick_label=label, pixel_px=pixel))

    assert cause.message.code == "photo-elsewhere"


def test_a_photo_of_another_place_is_told_as_such(scene_factory: Callable[..., Scene]) -> None:
    survey = scene_factory(3001, **OPTIONS).survey
    picks = np.flatnonzero(survey.pick_frame == 2)
    anywhere = np.random.default_rng(5).uniform(100.0, 1400.0, (len(picks), 2))
    cause = cause_of(with_pixels(survey, anywhere))
    assert cause.message.code == "photo-elsewhere"
    assert cause.mend is not None
    assert cause.mend.without_picks == frozenset(picks.tolist())
    assert [one.words for one in cause.message.instead] == ["Leave f2 out"]


def test_of_two_photos_without_a_log_nothing_shows_which_one_was_mirrored(
    scene_factory: Callable[..., Scene],
) -> None:
    pairs = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2))
    options = OPTIONS | {"frames": 2, "lines": len(pairs), "spread": 3.0}
    survey = scene_factory(3001, ends=pairs, telemetry=False, gauge="plane", **options).survey
    pixel = np.array(survey.pixel_px)
    mirrored = survey.pick_frame == 1
    pixel[mirrored, 0] = WIDTH - 1 - pixel[mirrored, 0]
    _, messages = refine(replace(survey, pixel_px=pixel), SolveOptions(noise="stated"))
    (message,) = [one for one in messages if one.code == "photo-mirrored"]

    assert set(message.frames) == {"f0", "f1"}
    assert "nothing shows which" in message.text
    assert message.mend is not None
    offered = [one.words for one in (message.mend, *message.instead)]
    assert sorted(offered) == [
        "Leave f0 out",  # where the photo itself was mirrored, its picks are right in it
        "Leave f1 out",
        "Put the picks of f0 back",
        "Put the picks of f1 back",
    ]
    assert not any("the log" in one.text for one in messages)


@pytest.mark.parametrize(
    ("code", "shown"),
    [
        ("photo-mirrored", lambda u, v: (WIDTH - 1 - u, v)),
        ("photo-turned", lambda u, v: (v, WIDTH - 1 - u)),
    ],
)
def test_the_only_photo_that_was_mirrored_or_turned_is_named(
    scene_factory: Callable[..., Scene],
    code: str,
    shown: Callable[[Floats, Floats], tuple[Floats, Floats]],
) -> None:
    """Its own points fit as well; only the log and control show it."""
    survey = scene_factory(3001, **OPTIONS | {"frames": 1}, control=3).survey
    wrong = replace(survey, pixel_px=np.stack(shown(*survey.pixel_px.T), axis=1))
    _, messages = refine(wrong, SolveOptions(noise="stated"))
    assert (messages[0].code, messages[0].frames) == (code, ("f0",))
    assert not {"photo-mirrored", "photo-turned"} & {
        one.code for one in refine(survey, SolveOptions(noise="stated"))[1]
    }


@pytest.mark.parametrize("telemetry", [True, False])
def test_labels_of_the_only_photo_that_moved_on_by_one_are_named(
    scene_factory: Callable[..., Scene], *, telemetry: bool
) -> None:
    pairs = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (4, 5))
    options = OPTIONS | {"frames": 1, "labels": 7, "lines": len(pairs), "spread": 4.0}
    gauge = "world" if telemetry else "plane"
    survey = scene_factory(3003, ends=pairs, telemetry=telemetry, gauge=gauge, **options).survey
    wrong = replace(survey, pick_label=np.roll(survey.pick_label, 1))
    refined, messages = refine(wrong, SolveOptions(noise="stated"))
    assert messages[0].code == "labels-swapped"
    mend = refined.causes[0].mend
    assert mend is not None
    assert correct_survey(wrong, mend).pick_label.tolist() == survey.pick_label.tolist()


def test_swapped_labels_of_the_only_photo_are_found_by_log_control_and_two_lengths(
    scene_factory: Callable[..., Scene],
) -> None:
    """Two lengths determine no pose of their own."""
    options = OPTIONS | {"frames": 1, "labels": 8, "lines": 2, "tilt": 0.05}
    survey = scene_factory(3005, control=2, ends=((0, 1), (1, 2)), **options).survey
    label = np.array(survey.pick_label)
    swapped = {0: 6, 6: 0}  # 0 is a control point
    wrong = replace(survey, pick_label=np.array([swapped.get(k, k) for k in label.tolist()]))
    _, messages = refine(wrong, SolveOptions(noise="stated"))
    assert messages[0].code == "labels-swapped-everywhere"
    assert set(messages[0].labels) == {survey.label[k] for k in swapped}
