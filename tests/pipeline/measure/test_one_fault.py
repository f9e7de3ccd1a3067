"""One wrong reading that takes part gives one warning, though it bends what was withheld."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import Inputs, read_inputs
from uavgram.synthetic.demo import write_demo
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import simulate

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
