"""The verdict of whole runs: clean, with a fault that is planted, and of a real flight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hostile_conditions import Condition
from hostile_project import write_project
from hostile_surveys import make_survey

from uavgram.io.results.results_json import load_results, write_results
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


def test_a_withheld_length_twenty_sigmas_off_is_red_and_no_row_is_in_order(small: Inputs) -> None:
    lines = small.lines
    first = np.arange(len(lines.name)) == 0
    length = lines.length_m + 20.0 * np.hypot(lines.sigma_m, 0.01) * first
    withheld = replace(small, lines=replace(lines, adjust=~first, length_m=length))
    result = result_of(withheld)

    assert result.verdict.level == "red"
    assert result.verdict.reasons[0].lengths == (lines.name[0],)
    ends = {lines.start[0], lines.end[0]}
    for points, status in zip(result.measurements.points, result.measurements.status, strict=True):
        assert status == ("contradicted" if ends & set(points) else "doubtful")


def test_of_lengths_that_all_contradict_each_other_nothing_is_to_be_used(small: Inputs) -> None:
    """No single one of them explains it."""
    length = small.lines.length_m * np.resize([1.01, 0.99], len(small.lines.name))
    result = result_of(replace(small, lines=replace(small.lines, length_m=length)))

    assert result.verdict.level == "red"
    assert {"line-suspect", "misfit"} <= {reason.cause for reason in result.verdict.reasons}
    assert "group-misfit" not in {reason.cause for reason in result.verdict.reasons}
    assert set(result.measurements.status) == {"contradicted"}


def test_one_photo_leaves_what_it_alone_shows_unchecked(tmp_path: Path) -> None:
    result = result_of(surveyed(replace(SMALL, single=True), tmp_path, seed=1))
    status = np.array(result.measurements.status)

    assert result.verdict.level == "amber"
    assert [reason.cause for reason in result.verdict.reasons] == ["nothing-checks"]
    assert np.mean(status == "not-checked") > 0.8
    assert set(status) <= {"not-checked", "ok"}


def test_a_flight_with_one_length_is_amber_and_says_what_to_tape_next(data_dir: Path) -> None:
    result = result_of(read_inputs(data_dir / "cuav" / "project.yaml"))
    (reason,) = result.verdict.reasons

    assert result.verdict.level == "amber"
    assert reason.cause == "nothing-checks"
    assert set(reason.measurements) == {"south", "whole"}
    assert "an error in the length 'north' ('barrel0' to 'barrel1') shows only from" in reason.text
    assert reason.text.endswith("Tape next from 'barrel2' to 'barrel0', about 39.9 m.")
    assert set(result.measurements.status) == {"not-checked"}
