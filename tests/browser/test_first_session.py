"""From photos, log and camera to measurements without writing a file: by mouse and keyboard."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import click_mark, measured, place, show_photo, wait_until_adjusted
from picking_server import served
from playwright.sync_api import expect

from uavgram.cli import main
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

PHOTOS = ("IMG_0045.jpg", "IMG_0046.jpg", "IMG_0048.jpg")
ENDS = [f"R{k}" for k in range(1, 9)]
OTHERS = ["P9", "P12", "P15"]
DISTANCES = (("R1", "P12"), ("P9", "P15"), ("P12", "P15"))


@pytest.fixture
def empty_survey(data_dir: Path, tmp_path: Path) -> tuple[Path, Path]:
    source = data_dir / "calm_nadir"
    project = tmp_path / "survey"
    leave = shutil.ignore_patterns("*.csv", "out", "*.tlog", "project.yaml")
    shutil.copytree(source, project, ignore=leave)
    assert main(["new", str(project)]) == 0
    return source, project


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_first_session_gives_the_numbers_of_a_run(
    empty_survey: tuple[Path, Path], open_page: PageOpener, data_dir: Path
) -> None:
    source, project = empty_survey
    picks = rows_of(source / "picks.csv")
    lines = rows_of(source / "lines.csv")[:4]
    with served(project / "project.yaml") as server:
        page = open_page(server)
        expect(page.locator(".steps")).to_contain_text("Mark two points")
        for photo in PHOTOS:
            show_photo(page, server.picking.index[photo])
            for row in picks:
                if row["image"] == photo and row["label"] in (*ENDS, *OTHERS):
                    place(page, row["label"], float(row["u_px"]), float(row["v_px"]))
        show_photo(page, server.picking.index["IMG_0046.jpg"])
        for row in lines:
            page.keyboard.press("l")
            click_mark(page, row["from"])
            click_mark(page, row["to"])
            page.keyboard.type(row["length_m"])
            page.keyboard.press("Enter")
        page.keyboard.press("d")
        for start, end in DISTANCES:
            click_mark(page, start)
            click_mark(page, end)
        expect(page.locator('table[aria-label="Measurements"] tr[data-row]')).to_have_count(3)
        expect(page.locator('table[aria-label="Known lengths"] tr[data-row]')).to_have_count(4)
        wait_until_adjusted(page)
        shown = measured(page)
        assert not open_page.errors
        assert not open_page.strangers
    result = compute(read_inputs(project / "project.yaml")).result
    found = result.measurements
    truth = json.loads((data_dir / "truth" / "calm_nadir.json").read_text())["points"]
    for k, name in enumerate(found.name):
        value, sigma = found.value[k], found.sigma[k]
        number, _, error, _ = shown[name].split(" ")
        digits = len(number.partition(".")[2])
        assert (number, error) == (f"{value:.{digits}f}", f"{sigma:.{digits}f}")
        start, end = (truth[label] for label in found.points[k])
        real = sum((a - b) ** 2 for a, b in zip(start, end, strict=True)) ** 0.5
        assert abs(value - real) < 3.0 * sigma
