"""A survey whose names a spreadsheet would run: its tables do not, and its photos are named."""

from __future__ import annotations

import csv

from small_projects import Project

import uavgram
from uavgram.io.tables.csv_tables import Columns, is_formula, read_table

COMMAND = "=cmd|' /C calc'!A0"


def test_measurements_csv_runs_nothing_and_keeps_the_name(project: Project) -> None:
    project.cell("measure.csv", 1, "name", COMMAND)
    old = (project / "picks.csv").read_text().splitlines()[1].split(",")[0]
    (project / "photos" / old).rename(project / "photos" / f"={old}")
    text = (project / "picks.csv").read_text().replace(old, f"={old}")
    (project / "picks.csv").write_text(text)
    result = uavgram.run(project.path)
    assert result.measurements.name[0] == COMMAND
    path = project.out / "measurements.csv"
    with path.open(encoding="utf-8", newline="") as stream:
        assert not any(is_formula(cell) for row in csv.reader(stream) for cell in row)
    read = read_table(path, Columns(text=("name", "kind"), others=True))
    assert read.text["name"] == result.measurements.name
    (said,) = [m.text for m in result.messages if m.code == "photo-name-formula"]
    assert said.startswith(
        f"1 of the photos' names begin as a formula does (the first is '={old}')"
    )
