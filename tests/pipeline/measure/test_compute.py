"""What a run says of what was mended: in its tables, its record and its verdict."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hostile_conditions import Condition
from hostile_project import write_project
from hostile_surveys import make_survey
from scenes import make_scene

from uavgram.io.results.results_json import load_results, write_results
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.result.result import Result
from uavgram.model.survey import Cause, Ends, SurveyCorrection
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import Inputs, read_inputs
from uavgram.pipeline.measure.observations import apply_corrections
from uavgram.stages.assemble import Assembled
from uavgram.stages.refine.causes.hypothesis import Diagnosis
from uavgram.stages.refine.causes.identification import IdentifiedCauses
from uavgram.synthetic.demo import write_demo
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import simulate

SMALL = Condition(labels=9, photos=5, picked_share=1.0, radius_m=12.0)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    """A project in which what is found to be wrong is mended."""
    folder = write_project(make_survey(SMALL, 0), tmp_path_factory.mktemp("small"))
    inputs = read_inputs(folder)
    solve = replace(inputs.project.solve, outliers="remove", noise="stated")
    return replace(inputs, project=replace(inputs.project, solve=solve))


def result_of(inputs: Inputs) -> Result:
    return compute(inputs, curved=False).result


@pytest.fixture(scope="module")
def right(small: Inputs) -> Result:
    return result_of(small)


def values_of(result: Result) -> Floats:
    return np.asarray(result.measurements.value)


def cause(mend: SurveyCorrection | None) -> Cause:
    message = Message("warning", "labels-swapped", "It is wrong.")
    return Cause(message=message, mend=mend, gain=99.0)


def swapped(inputs: Inputs, frame: int = 2) -> tuple[Inputs, list[int]]:
    """Two labels in a photo, and the rows of their picks."""
    picks = inputs.picks
    name = sorted(set(picks.image))[frame]
    one, other = [k for k, of in enumerate(picks.image) if of == name][:2]
    label = list(picks.label)
    label[one], label[other] = label[other], label[one]
    return replace(inputs, picks=replace(picks, label=tuple(label))), [one, other]


def test_tables_are_of_what_was_taken_wherever_the_survey_has_it(small: Inputs) -> None:
    """The survey has picks and lengths in another order, and not all of them."""
    survey = make_scene(1, frames=1, labels=7, lines=0).survey
    picks, lines = len(small.picks.label), len(small.lines.name)
    pick_at, line_at = np.arange(picks)[::-1] - 1, np.arange(lines)[::-1] - 1
    assembled = Assembled(
        survey=survey,
        pick_index=pick_at,
        line_index=line_at,
        pick_sigma_px=np.ones(picks),
    )
    causes = [
        cause(SurveyCorrection(label_of_pick={0: 3}, length_m={1: 7.25})),
        cause(None),
        cause(SurveyCorrection(pixel_of_pick={4: (12.0, 34.0)}, ends={0: Ends(5, 2)})),
        cause(SurveyCorrection(label_of_pick={0: 4})),
    ]
    found = apply_corrections(small, assembled, causes)
    row = {int(k): i for i, k in enumerate(pick_at)}
    label, pixel = list(small.picks.label), np.array(small.picks.pixel_px)
    label[row[0]], pixel[row[4]] = survey.label[4], (12.0, 34.0)
    assert found.picks.label == tuple(label)
    assert found.picks.pixel_px.tolist() == pixel.tolist()
    row = {int(k): i for i, k in enumerate(line_at)}
    start, end = list(small.lines.start), list(small.lines.end)
    length = np.array(small.lines.length_m)
    start[row[0]], end[row[0]], length[row[1]] = survey.label[5], survey.label[2], 7.25
    assert (found.lines.start, found.lines.end) == (tuple(start), tuple(end))
    assert found.lines.length_m.tolist() == length.tolist()


def test_labels_are_as_mended_picks_taken_out_are_removed_and_the_record_says_so(
    small: Inputs, right: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cause as it would be found: two labels to swap back, and the photo's third pick to go."""
    wrong, rows = swapped(small)
    out = rows[1] + 1

    def found(standing: Diagnosis) -> IdentifiedCauses:
        survey = standing.survey
        one, other, third = (
            int(np.flatnonzero((survey.pixel_px == small.picks.pixel_px[k]).all(axis=1))[0])
            for k in (*rows, out)
        )
        at = survey.pick_label
        if survey.label[at[one]] == small.picks.label[rows[0]]:
            return IdentifiedCauses((), (), ())
        mend = SurveyCorrection(
            label_of_pick={one: int(at[other]), other: int(at[one])},
            without_picks=frozenset([third]),
        )
        return IdentifiedCauses((cause(mend),), (None,), ((),), cost=0.0)

    stage = importlib.import_module("uavgram.stages.refine.at_stated_noise")
    monkeypatch.setattr(stage, "identify_causes", found)
    result = result_of(wrong)

    (record,) = result.removals
    assert record.cause == "labels-swapped"
    one, other = (repr(small.picks.label[k]) for k in rows)
    before, after = record.mended
    assert before.index(other) < before.index(one)
    assert after.index(one) < after.index(other)
    assert result.picks.label == right.picks.label
    assert [k for k, status in enumerate(result.picks.status) if status == "removed"] == [out]
    assert result.messages[0].code == "labels-swapped"
    assert (
        f". The program corrected it, check this: {before}; now {after}." in result.messages[0].text
    )
    assert result.verdict.level == "amber"
    assert "contradicted" not in result.measurements.status
    write_results(result, tmp_path / "results.json")
    assert load_results(tmp_path / "results.json").removals == result.removals


def test_lengths_in_feet_that_were_mended_make_nothing_red(small: Inputs, right: Result) -> None:
    feet = replace(small, lines=replace(small.lines, length_m=small.lines.length_m / 0.3048))
    result = result_of(feet)
    assert [one.cause for one in result.removals] == ["lengths-wrong-unit"]
    assert result.verdict.level == "amber"
    assert [one.cause for one in result.verdict.reasons] == ["lengths-wrong-unit"]
    assert result.lines.length_m == pytest.approx(small.lines.length_m)
    np.testing.assert_allclose(values_of(result), values_of(right), atol=1e-5)


# One wrong reading that takes part gives one warning, though it bends what was withheld.


Solve = Callable[[dict[str, float]], Result]

SIGNIFICANT = 3.3


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    survey = simulate(Scenario())
    blank = np.full((survey.calibration.height_px, survey.calibration.width_px), 128, np.uint8)
    folder = tmp_path_factory.mktemp("fault") / "survey"
    return read_inputs(write_demo(folder, survey, (blank for _ in survey.frame_id)))


@pytest.fixture
def solve(inputs: Inputs) -> Solve:
    """Compute the survey with errors in its lengths, by name [m]."""

    def run(error_m: dict[str, float]) -> Result:
        lines = inputs.lines
        length = lines.length_m + [error_m.get(name, 0.0) for name in lines.name]
        changed = replace(inputs, lines=replace(lines, length_m=length))
        return compute(changed, curved=False).result

    return run


def warned(result: Result) -> list[tuple[str, tuple[str, ...]]]:
    return [(m.code, m.lengths) for m in result.messages if m.level != "info"]


def test_a_wrong_length_is_the_only_thing_named_and_tables_are_of_the_result(solve: Solve) -> None:
    """Without it, the withheld length and the lengths as a kind fit."""
    result = solve({"L2": 0.1})
    (lengths,) = (group for group in result.solution.groups if group.name == "lengths")
    assert abs(result.lines.w[result.lines.name.index("L6")]) > SIGNIFICANT
    assert lengths.probability < 0.001
    assert warned(result) == [("line-suspect", ("L2",))]
    (reason,) = result.verdict.reasons
    assert reason.mend is not None
    assert result.verdict.level == "amber"


def test_a_withheld_length_that_is_wrong_itself_is_named_beside_the_other(solve: Solve) -> None:
    result = solve({"L2": 0.1, "L6": -0.3})
    named = [lengths for code, lengths in warned(result) if code == "line-suspect"]
    assert named == [("L2",), ("L6",)]
    assert result.verdict.level == "amber"  # all the other withheld lengths fit


def test_lengths_of_which_many_are_wrong_are_less_exact_than_stated(solve: Solve) -> None:
    """They are no exceptions, which would explain the misfit of their kind."""
    result = solve({"L1": 0.2, "L3": -0.2, "L4": 0.2, "L5": -0.2})
    assert result.verdict.level == "red"
    assert {code for code, _ in warned(result)} & {"group-misfit", "misfit", "many-suspects"}
