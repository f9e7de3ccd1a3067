"""What commands tell of a project in feet, on both outputs."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sample_results import sample_result

from uavgram.cli import main, terminal
from uavgram.cli.terminal import (
    log_to_stderr,
    print_lines,
    print_unchanged,
    set_project_units,
    set_result,
    set_units,
)
from uavgram.errors import InputError
from uavgram.model.naming import IMPERIAL, METRIC


@pytest.fixture(autouse=True)
def metric_again() -> Iterator[None]:
    yield
    set_units(METRIC)


def test_text_is_told_in_the_units_of_the_project_and_json_is_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "camera.yaml").touch()
    (tmp_path / "project.yaml").write_text(
        "images: '*.jpg'\ncamera: camera.yaml\npicks: picks.csv\nunits: imperial\n"
    )
    set_project_units(tmp_path)
    print_lines("found at 1.40 m")
    print_unchanged('{"height": "1.40 m"}')
    log_to_stderr(verbose=False)
    logging.getLogger("uavgram").warning("off by 3.2 cm")
    said = capsys.readouterr()

    assert said.out == 'found at 4 ft 7 in\n{"height": "1.40 m"}\n'
    assert said.err == "off by 1.26 in\n"


def test_errors_are_told_in_them_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(_: list[str]) -> None:
        set_units(IMPERIAL)
        raise InputError(tmp_path / "lines.csv", "the ends lie 12.3 m apart")

    monkeypatch.setattr("uavgram.cli.entry.app", failing)
    assert main([]) == 1
    assert "the ends lie 40 ft 4 in apart" in capsys.readouterr().err


def test_a_project_that_cannot_be_read_is_told_in_metres(tmp_path: Path) -> None:
    set_units(IMPERIAL)

    assert set_project_units(tmp_path / "nowhere.yaml") == METRIC
    assert terminal.convert_units("1.40 m") == "1.40 m"


def test_lengths_of_a_result_are_told_from_their_exact_values(
    capsys: pytest.CaptureFixture[str],
) -> None:
    result = sample_result()
    taped = replace(result.lines, length_m=np.full(len(result.lines.name), 13.1064))  # 43 ft
    set_units(IMPERIAL)
    print_lines("taped 13.11 m")
    set_result(replace(result, lines=taped))
    print_lines("taped 13.11 m")
    set_units(IMPERIAL)
    print_lines("taped 13.11 m")

    rounded = "taped 43 ft 1/4 in"
    assert capsys.readouterr().out.splitlines() == [rounded, "taped 43 ft 0 in", rounded]
