"""From a folder to the report in the browser alone: no file is edited, clicks and keys counted."""

from __future__ import annotations

import json
import math
import shutil
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from opened_pages import PageOpener
from picking_pages import Counted, eventually, to_page, wait_until_adjusted
from picking_server import Served, served
from playwright.sync_api import Page, expect

from uavgram.config.project import load_project
from uavgram.io.results.results_json import load_results
from uavgram.model.result.result import Result
from uavgram.picking.session.door import Door
from uavgram.pipeline.measure.run import run

MOST = 29
"""Clicks and keys for 4 lengths and 3 distances in 2 photos, mount and report; digits aside.

It takes 27, and one more for each of two points that need not be found in the second photo."""

STREET, BEACH = "Unfall Köln", "Strand"
FIRST, SECOND = "IMG_0030.jpg", "IMG_0031.jpg"
APART_PX = 80.0
"""Between points that are picked: nothing is clicked twice."""

Truth = dict[str, Any]


@pytest.fixture
def home(data_dir: Path, tmp_path: Path) -> Path:
    """Photos with a log of a fixed camera, and a DJI's photos, as they come from memory cards."""
    home = tmp_path / "home"
    only = shutil.ignore_patterns("*.csv", "*.yaml", "*.tlog", "out")
    shutil.copytree(data_dir / "street_oblique", home / STREET, ignore=only)
    shutil.copy(data_dir / "street_oblique" / "camera.yaml", home / STREET)
    shutil.copytree(data_dir / "brighton_beach", home / BEACH)
    return home


def apart(truth: Truth, count: int) -> list[str]:
    """Marks on the ground that both photos show, far from each other."""
    here, there = truth["pixels"][FIRST], truth["pixels"][SECOND]
    chosen: list[str] = []
    for label in sorted(here, key=lambda one: (one[0] != "R", one)):
        seen = label in there and here[label][2] and there[label][2]
        on_ground = abs(truth["height_above_ground_m"][label]) < 0.02
        free = all(math.dist(here[label][:2], here[other][:2]) > APART_PX for other in chosen)
        if label[0] in "RP" and seen and on_ground and free:
            chosen.append(label)
    return chosen[:count]


def length(truth: Truth, ends: tuple[str, str]) -> float:
    start, end = (truth["points"][label] for label in ends)
    return math.dist(start, end)


def results(page: Page) -> dict[str, str]:
    """Values of the results tab by the names of the measurements."""
    table = page.get_by_role("table", name="Results")
    rows = table.locator("tbody tr").all()
    cells = [row.locator("td").all_inner_texts() for row in rows]
    return {name: value for name, _, value, *_ in cells}


def check_report(page: Page, folder: Path) -> Result:
    """The results tab shows what was written, and its report opens."""
    panel = page.get_by_role("tabpanel", name="Results")
    expect(panel).to_contain_text("measurements computed")
    expect(panel.locator(".plan img")).to_be_visible()
    eventually(page, lambda: panel.locator(".plan img").evaluate("img => img.naturalWidth > 0"))
    with page.context.expect_page() as opened:
        panel.get_by_role("link", name="Report", exact=True).click()
    expect(opened.value.locator("h1").first).to_contain_text(folder.name)
    opened.value.close()
    result = load_results(folder / "out" / "results.json")
    assert set(results(page)) == set(result.measurements.name)
    return result


def test_two_projects_one_after_another_without_a_file_or_a_terminal(
    home: Path, data_dir: Path, open_page: PageOpener
) -> None:
    truth: Truth = json.loads((data_dir / "truth" / "street_oblique.json").read_text())
    with served(None, Door(roots=(home,)), run) as server:
        page = open_page(server, 1280, 800)
        does = Counted(page)
        does.press(page.get_by_role("button", name=f"Use {STREET}"))
        does.press(page.get_by_role("radio", name="45° down"))
        does.press(page.get_by_role("button", name="Begin"))
        survey_a_street(page, does, truth, server)
        result = check_report(page, home / STREET)

        assert does.count <= MOST, does.count
        project = load_project(home / STREET / "project.yaml")
        assert (project.mount.gimbal, project.mount.pitch_deg) == ("none", -45.0)
        found = result.measurements
        for k, ends in enumerate(wanted_of(apart(truth, 8))):
            assert abs(found.value[k] - length(truth, ends)) < 3.5 * found.sigma[k]
        assert (found.sigma < 0.5).all()

        page.get_by_role("button", name="Open another folder").click()
        opened = page.get_by_role("list", name="Opened before")
        expect(opened.get_by_role("button", name=f"Open {STREET}")).to_be_visible()
        page.get_by_role("button", name=f"Use {BEACH}").click()
        expect(page.locator(".found")).to_contain_text("3 photos of")
        expect(page.get_by_role("radio", name="As recorded")).to_be_checked()
        expect(page.locator(".way-of").first).to_contain_text("90° below the horizon")
        page.get_by_role("button", name="Begin").click()
        survey_a_beach(page)
        result = check_report(page, home / BEACH)
        assert result.measurements.value[0] > 1.0
        assert not open_page.errors
        assert not open_page.strangers


def wanted_of(labels: list[str]) -> list[tuple[str, str]]:
    """Three distances between ends of different lengths."""
    pairs = [pair for pair in combinations(range(8), 2) if pair[0] // 2 != pair[1] // 2]
    return [(labels[a], labels[b]) for a, b in (pairs[0], pairs[9], pairs[-1])]


def survey_a_street(page: Page, does: Counted, truth: Truth, server: Served) -> None:
    """Enter four lengths, ask for three distances, take the second photo over, and write."""
    labels, here = apart(truth, 8), truth["pixels"][FIRST]
    taped = [(labels[k], labels[k + 1]) for k in range(0, 8, 2)]
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    does.press(page.locator("#strip button", has_text=FIRST[:-4]))
    expect(page.locator(".pane").first).to_have_attribute("data-image", FIRST)
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    does.key("l")
    for count, ends in enumerate(taped, 1):
        for label in ends:
            does.click(*to_page(page, *here[label][:2]))
        expect(page.locator(".mark.placed, .mark.found")).to_have_count(2 * count)
        does.digits(f"{length(truth, ends):.3f}")
        if count == 1:
            does.key("Enter")  # the others are taken by the next click, or by this:
    does.key("Enter")
    does.key("d")
    for ends in wanted_of(labels):
        for label in ends:
            does.click(*to_page(page, *here[label][:2]))
    does.key("PageDown")
    expect(page.locator(".pane").first).to_have_attribute("data-image", SECOND)
    names = [f"P{k + 1}" for k in range(len(labels))]
    search = server.picking._search
    eventually(page, lambda: all((SECOND, name) in search.outcomes for name in names))
    found = sum(search.outcomes[SECOND, name].found is not None for name in names)
    assert found >= 6
    expect(page.locator("[data-proposal]")).to_have_count(found)
    does.key("Control+Enter")
    expect(page.locator(".mark.placed, .mark.found")).to_have_count(found)
    for name, label in zip(names, labels, strict=True):
        if server.picking.state.pick(SECOND, name) is None:  # the point that is expected there
            does.click(*to_page(page, *truth["pixels"][SECOND][label][:2]))
    expect(page.locator(".mark.placed, .mark.found")).to_have_count(len(labels))
    wait_until_adjusted(page)
    does.key("w")


def survey_a_beach(page: Page) -> None:
    """Measure a distance in one photo, scaled by a length."""
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    page.keyboard.press("l")
    for u, v in ((1200, 900), (2600, 1100)):
        page.mouse.click(*to_page(page, u, v))
    expect(page.locator(".mark[data-label]")).to_have_count(2)
    page.keyboard.type("40")
    page.keyboard.press("Enter")
    page.keyboard.press("d")
    for u, v in ((1300, 2000), (2900, 2100)):
        page.mouse.click(*to_page(page, u, v))
    wait_until_adjusted(page)
    page.keyboard.press("w")
