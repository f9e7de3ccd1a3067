"""configs/demo.yaml is the built-in survey, written out for people to copy."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavgram.config.scenario import load_scenario
from uavgram.errors import InputError
from uavgram.model.scenario.scenario import Scenario


def test_the_file_that_people_copy_is_the_built_in_survey(repository: Path) -> None:
    assert load_scenario(repository / "configs" / "demo.yaml") == Scenario()


def test_every_number_of_the_built_in_survey_is_written_in_the_file(repository: Path) -> None:
    text = (repository / "configs" / "demo.yaml").read_text(encoding="utf-8")
    for group in ("site", "camera", "flight", "errors", "road"):
        for name in vars(getattr(Scenario(), group)):
            assert f"  {name}:" in text, name


def test_a_wrong_value_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("name: mine\nflight:\n  height_m: -3.0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"scenario.yaml:[23]: .*height_m"):
        load_scenario(path)


def test_an_unknown_key_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("name: mine\nflight:\n  hight_m: 30.0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"scenario.yaml:3: .*hight_m"):
        load_scenario(path)
