"""A project in feet and inches: what the page shows, and what its fields take."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import click_mark, measured, show_photo, wait_until_adjusted
from picking_server import served
from playwright.sync_api import Page, expect

from uavgram.model.naming import IMPERIAL
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.views.units import format_quantity

CASES = json.loads(
    (Path(__file__).parents[1] / "support" / "unit_cases.json").read_text(encoding="utf-8")
)
UNITS = {
    "metric": {"length": "m", "speed": "km/h"},
    "ft": {"length": "ft", "speed": "mph"},
    "ft-in": {"length": "ft-in", "speed": "mph"},
    "m/s": {"length": "m", "speed": "m/s"},
}
WITH_ITS_MODULE = """async ([units, cases]) => {
    const own = await import("/page/elements/units.js?alone");
    own.useUnits(units);
    return {
        fields: cases.fields.map(({ text }) => own.parseLength(text)),
        kept: cases.kept.map((text) => own.fieldText(own.parseLength(text))),
        unchanged: cases.unchanged.flatMap((metres) => ["length", "small"].map(
            (sort) => own.parseLength(own.fieldText(metres, sort), sort))),
    };
}"""
METRIC = re.compile(r"\d (mm|cm|m|km/h|m/s|m²)(?![\w²/])")


@pytest.fixture
def survey(data_dir: Path, tmp_path: Path) -> Path:
    """A survey in feet and inches, in which one distance is measured."""
    folder = tmp_path / "survey"
    leave = shutil.ignore_patterns("out", "*.tlog", "measure.csv")
    shutil.copytree(data_dir / "calm_nadir", folder, ignore=leave)
    (folder / "measure.csv").write_text("name,kind,points\nD1,distance,R1;R2\n")
    project = folder / "project.yaml"
    project.write_text(f"{project.read_text()}\nunits: imperial\n")
    return project


def check_cases(page: Page) -> None:
    """The page reads and keeps typed lengths as the table says."""
    for name, units in UNITS.items():
        said = page.evaluate(WITH_ITS_MODULE, [units, CASES])
        assert said["unchanged"] == [metres for metres in CASES["unchanged"] for _ in range(2)]
        if name in CASES["fields"][0]:
            for case, metres in zip(CASES["fields"], said["fields"], strict=True):
                wanted = float("nan") if case[name] is None else case[name]
                assert metres == pytest.approx(wanted, rel=1e-9, nan_ok=True), case
        if name == "ft-in":
            bare = "13.2 ft"  # no multiple of a fraction that a tape has
            assert said["kept"] == [bare, *CASES["kept"][1:]]


def test_lengths_are_read_and_typed_in_feet_and_inches(survey: Path, open_page: PageOpener) -> None:
    with served(survey) as server:
        page = open_page(server)
        check_cases(page)
        show_photo(page, server.picking.index["IMG_0046.jpg"])
        wait_until_adjusted(page)
        page.keyboard.press("l")
        click_mark(page, "R1")
        click_mark(page, "R3")
        form = page.get_by_role("form", name=re.compile("^New length"))
        expect(form.get_by_label("Good to ±, inches")).to_have_value(re.compile(r"^0\.\d{1,3}$"))
        form.get_by_label("Length, feet").fill("13' 2 1/2\"")
        expect(form).to_contain_text("= 4.026 m")
        form.get_by_label("Length, feet").fill("wide")
        page.keyboard.press("Enter")
        expect(form.get_by_role("alert")).to_contain_text("13 ft 2 1/2 in")
        form.get_by_label("Length, feet").fill("13' 2 1/2\"")
        form.get_by_label("Good to ±, inches").fill("0.5")
        form.get_by_label("Use").select_option("check")
        lengths = page.get_by_label(re.compile("taped length in ft$"))
        before = lengths.count()
        page.keyboard.press("Enter")
        expect(form).to_have_count(0)
        expect(lengths).to_have_count(before + 1)  # the form goes before the server has answered
        line = server.picking.state.lines[-1]
        assert (line.length_m, line.sigma_m) == (4.0259, 0.0127)
        field = page.get_by_label(f"{line.name}, taped length in ft")
        expect(field).to_have_value("13 ft 2 1/2 in")
        wait_until_adjusted(page)
        shown = measured(page)
        text = page.locator("body").inner_text()
        assert not open_page.errors
    assert not [line for line in text.splitlines() if METRIC.search(line)]
    found = compute(read_inputs(survey)).result.measurements
    assert shown["D1"] == format_quantity(found.value[0], found.sigma[0], "m", IMPERIAL)
