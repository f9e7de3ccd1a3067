"""A jump of the log's position in a whole run: said first, and the frames behind it freed."""

from pathlib import Path

import pytest
from hostile_conditions import CONDITIONS
from hostile_project import write_project
from hostile_surveys import make_survey

from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.views.survey.verdict import verdict_sentence


@pytest.mark.parametrize("seed", [0, 1])
def test_a_gps_jump_is_said_first_and_no_clock_is_blamed(tmp_path: Path, seed: int) -> None:
    survey = make_survey(CONDITIONS["gps_jump_10m"], seed)
    result = compute(read_inputs(write_project(survey, tmp_path)), curved=False).result
    warnings = [m for m in result.messages if m.level == "warning"]
    assert warnings[0].text.startswith("The log's position jumps by 10.0 m between photo ")
    assert 3 <= len(warnings[0].frames) <= 6
    assert not any("clock drift" in m.text for m in result.messages)
    assert not any(m.code in ("telemetry-strained", "group-misfit") for m in warnings)
    assert "position jumps by 10.0 m" in verdict_sentence(result)
    rows = result.measurements
    for name, value, sigma in zip(rows.name, rows.value, rows.sigma, strict=True):
        assert abs(value - survey.truth[name]) < 4.5 * sigma


@pytest.mark.parametrize("condition", ["clean", "plane"])
def test_a_clean_survey_says_nothing_of_the_log(tmp_path: Path, condition: str) -> None:
    """Nor does that of an aircraft that turns hard, as its gyroscopes tell."""
    survey = make_survey(CONDITIONS[condition], 0)
    result = compute(read_inputs(write_project(survey, tmp_path)), curved=False).result
    codes = ("log-", "estimator-")
    assert not any(m.code.startswith(codes) for m in result.messages)
