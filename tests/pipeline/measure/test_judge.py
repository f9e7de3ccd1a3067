"""The verdict of whole runs: clean, with a fault that is planted, and of a real flight."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hostile_conditions import Condition
from hostile_project import write_project
from hostile_surveys import make_survey

from uavgram.io.results.results_json import load_results, write_results
from uavgram.model.observations import Picks
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import Inputs, read_inputs

SMALL = Condition(labels=9, photos=5, picked_share=1.0, radius_m=12.0)


def result_of(inputs: Inputs) -> Result:
    return compute(inputs, curved=False).result


def surveyed(condition: Condition, folder: Path, seed: int = 0) -> Inputs:
    return read_inputs(write_project(make_survey(condition, seed), folder))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    return surveyed(SMALL, tmp_path_factory.mktemp("small"))


def test_a_clean_survey_with_every_point_in_several_photos_is_green(
    small: Inputs, tmp_path: Path
) -> None:
    result = result_of(small)

    assert result.verdict.level == "green"
    assert result.verdict.reasons == ()
    assert set(result.measurements.status) == {"ok"}
    write_results(result, tmp_path / "results.json")
    assert load_results(tmp_path / "results.json").verdict == result.verdict


def test_a_withheld_length_twenty_sigmas_off_is_amber_and_no_row_is_in_order(small: Inputs) -> None:
    """It may be wrong itself, or the result."""
    lines = small.lines
    first = np.arange(len(lines.name)) == 0
    length = lines.length_m + 20.0 * np.hypot(lines.sigma_m, 0.01) * first
    withheld = replace(small, lines=replace(lines, adjust=~first, length_m=length))
    result = result_of(withheld)

    assert result.verdict.level == "amber"
    assert result.verdict.reasons[0].lengths == (lines.name[0],)
    ends = {lines.start[0], lines.end[0]}
    for points, status in zip(result.measurements.points, result.measurements.status, strict=True):
        assert status == ("contradicted" if ends & set(points) else "doubtful")


@pytest.mark.parametrize("error", [0.02, 0.05, 0.1])
def test_of_lengths_that_all_contradict_each_other_nothing_is_to_be_used(
    small: Inputs, error: float
) -> None:
    """Three fit without the other three, so nothing shows which are right.

    One percent is less than points may be off that were picked beside what was taped.
    """
    wrong = np.resize([1.0 + error, 1.0 - error], len(small.lines.name))
    result = result_of(
        replace(small, lines=replace(small.lines, length_m=small.lines.length_m * wrong))
    )

    assert result.verdict.level == "red"
    assert result.lines.status.count("removed") == 3
    assert any(
        reason.cause == "many-suspects"
        and "3 of 6 known lengths and things do not fit" in reason.text
        for reason in result.verdict.reasons
    )
    assert set(result.measurements.status) == {"contradicted"}


def test_two_wrong_lengths_of_six_are_left_out_and_all_else_is_used(small: Inputs) -> None:
    sound, length = result_of(small), small.lines.length_m + np.array([2.0, 0, 0, -1.0, 0, 0])
    result = result_of(replace(small, lines=replace(small.lines, length_m=length)))

    assert result.verdict.level == "amber"
    assert result.lines.status == ("removed", "used", "used", "removed", "used", "used")
    off = result.measurements.value - sound.measurements.value
    assert np.abs(off / result.measurements.sigma).max() < 2.0


def test_one_photo_leaves_what_it_alone_shows_unchecked(tmp_path: Path) -> None:
    inputs = surveyed(replace(SMALL, single=True), tmp_path, seed=1)
    result = result_of(inputs)
    status = np.array(result.measurements.status)

    assert result.verdict.level == "amber"
    clicks, length = result.verdict.reasons
    assert clicks.cause == length.cause == "nothing-checks"
    assert re.search(r"a wrong click on any of \d+ points \(P3, ", clicks.text)
    assert "an error in the length 'L1' ('P1' to 'P2') would not" in length.text
    assert np.mean(status == "not-checked") > 0.8
    assert set(status) <= {"not-checked", "ok"}

    # An error of that length moves a measurement far, and is not noticed, as predicted.
    wrong = np.where(np.array(inputs.lines.name) == "L1", -0.3, 0.0)
    lines = replace(inputs.lines, length_m=inputs.lines.length_m + wrong)
    moved = result_of(replace(inputs, lines=lines))
    assert [reason.cause for reason in moved.verdict.reasons] == ["nothing-checks"] * 2
    off = moved.measurements.value - result.measurements.value
    assert np.abs(off / result.measurements.sigma).max() > 5.0


def test_a_flight_with_one_length_is_checked_as_far_as_the_log_is_exact(data_dir: Path) -> None:
    """An error in the length shows once it moves a measurement by seven sigmas; ten are allowed."""
    flight = read_inputs(data_dir / "cuav" / "project.yaml")
    result = result_of(flight)
    assert result.verdict.level == "green"
    assert set(result.measurements.status) == {"ok"}

    exact = replace(flight.lines, sigma_m=0.2 * flight.lines.sigma_m)
    result = result_of(replace(flight, lines=exact))
    (reason,) = result.verdict.reasons
    assert result.verdict.level == "amber"
    assert reason.cause == "nothing-checks"
    assert "an error in the length 'north' ('barrel0' to 'barrel1') would not" in reason.text
    assert reason.plain == (
        "An error in the length 'north' ('barrel0' to 'barrel1') would not be noticed."
    )
    assert reason.mend is not None
    assert reason.mend.action == "tape"


def clicked_again(inputs: Inputs, off_px: dict[str, float] | None = None) -> Inputs:
    """Every click made twice: the second a pixel beside the first, or so far from it."""
    picks, rng = inputs.picks, np.random.default_rng(3)
    count = len(picks.image)
    away = np.array([(off_px or {}).get(label, 0.0) for label in picks.label])
    again = picks.pixel_px + rng.normal(0.0, 1.0, (count, 2)) + away[:, None]
    twice = Picks(
        image=picks.image * 2,
        label=picks.label * 2,
        area=picks.area * 2,
        source=picks.source * 2,
        pixel_px=np.concatenate([picks.pixel_px, again]),
        sigma_px=np.tile(picks.sigma_px, 2),
        height_m=np.tile(picks.height_m, 2),
    )
    return replace(inputs, picks=twice)


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    return surveyed(replace(SMALL, single=True), tmp_path_factory.mktemp("single"), seed=1)


def test_clicks_that_were_made_again_check_each_other(single: Inputs) -> None:
    once, twice = result_of(single), result_of(clicked_again(single))

    clicks = "a wrong click"
    assert any(clicks in reason.text for reason in once.verdict.reasons)
    assert not any(clicks in reason.text for reason in twice.verdict.reasons)
    assert sum(status == "ok" for status in twice.measurements.status) > sum(
        status == "ok" for status in once.measurements.status
    )
    assert len(twice.picks.image) == 2 * len(once.picks.image)
    assert np.nanmean(twice.picks.redundancy) > 0.4
    sigma = twice.measurements.sigma / once.measurements.sigma
    assert 0.6 < np.nanmedian(sigma) < 1.0


def test_of_two_clicks_far_from_each_other_nothing_is_in_order(single: Inputs) -> None:
    """Of a point at the end of no length: nothing shows which of the two is right."""
    taped = {*single.lines.start, *single.lines.end}
    label = next(one for one in single.picks.label if one not in taped)
    result = result_of(clicked_again(single, {label: 150.0}))
    of_label = [label in points for points in result.measurements.points]
    status = np.array(result.measurements.status)

    assert result.verdict.level in ("amber", "red")
    assert "ok" not in status[of_label]


def test_a_row_that_was_copied_counts_once(single: Inputs) -> None:
    picks = single.picks
    rows = [*range(len(picks.image)), 0, 1]
    copied = Picks(
        image=tuple(picks.image[i] for i in rows),
        label=tuple(picks.label[i] for i in rows),
        pixel_px=picks.pixel_px[rows],
        sigma_px=picks.sigma_px[rows],
        height_m=picks.height_m[rows],
    )
    once, twice = result_of(single), result_of(replace(single, picks=copied))

    np.testing.assert_array_equal(twice.measurements.sigma, once.measurements.sigma)
    assert twice.measurements.status == once.measurements.status
    assert twice.picks.status[-2:] == ("unused", "unused")
    (message,) = (one for one in twice.messages if one.code == "pick-duplicate")
    assert repr(picks.label[0]) in message.text


def test_what_does_not_fit_is_no_verdict_where_nothing_is_measured(small: Inputs) -> None:
    result = result_of(replace(small, requests=()))

    assert result.verdict.level is None
    assert result.measurements.status == ()
