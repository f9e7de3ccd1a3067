"""configs/plan.yaml: what a user copies names every key of a plan, with its real default."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path

from uavgram.model.planned import PlanRequest
from uavgram.synthetic.scenario_file import format_scenario, load_scenario


def test_the_example_names_every_key_with_its_default(repository: Path) -> None:
    path = repository / "configs" / "plan.yaml"
    text, request = path.read_text(), load_scenario(path).plan
    assert request is not None
    for field in fields(PlanRequest):
        assert re.search(rf"^  (# )?{field.name}:", text, re.MULTILINE), field.name
    assert request == replace(
        PlanRequest(area=request.area), wanted=request.wanted, area=request.area
    )


def test_a_scenario_with_a_plan_is_written_as_it_was_read(repository: Path, tmp_path: Path) -> None:
    for name in ("plan.yaml", "demo.yaml"):
        scenario = load_scenario(repository / "configs" / name)
        copy = tmp_path / name
        copy.write_text(format_scenario(scenario))
        assert load_scenario(copy) == scenario
