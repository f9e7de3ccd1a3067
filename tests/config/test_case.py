"""`case:` of a project file: the head of its report."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavgram.config.project import load_project
from uavgram.errors import InputError
from uavgram.model.options import option_pairs
from uavgram.model.provenance import Case, case_from_options

HEAD = "images: a.jpg\ncamera: unknown\npicks: picks.csv\n"


def project_with(folder: Path, text: str) -> Path:
    (folder / "project.yaml").write_text(HEAD + text)
    return folder / "project.yaml"


def test_a_case_is_read_as_it_is_written(tmp_path: Path) -> None:
    text = "case: {number: 12/26, date: 2026-03-01, agency: PD, more: {Road: wet}}\n"
    project = load_project(project_with(tmp_path, text), unfinished=True)

    assert project.case == Case(
        number="12/26", date="2026-03-01", agency="PD", more={"Road": "wet"}
    )
    assert case_from_options(option_pairs(project)) == (
        ("Case number", "12/26"),
        ("Date", "2026-03-01"),
        ("Agency", "PD"),
        ("Road", "wet"),
    )


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("case: {nubmer: a}", "case.*nubmer"),
        ("case: {number: 12}", r"case\.number.*must be text"),
        ("case: {more: {Road: [wet]}}", r"case\.more.*must be text"),
    ],
)
def test_a_mistake_in_it_is_told_with_its_line(text: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf"project\.yaml:4: {why}"):
        load_project(project_with(tmp_path, text + "\n"), unfinished=True)
