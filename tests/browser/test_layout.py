"""Nothing lies over another thing, and nothing is cut off, in windows of five sizes."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import click_mark, eventually, place, show_photo, wait_until_adjusted
from picking_projects import PickingProject
from picking_server import served
from playwright.sync_api import expect

import uavgram

SIZES = [(720, 450), (1024, 700), (1280, 720), (1920, 1080), (2560, 1400)]

CUT_OFF = """() => [...document.querySelectorAll("header, #panel > *, .scroll, #panel table")]
    .filter((box) => box.scrollWidth > box.clientWidth + 1).map((box) => box.outerHTML.slice(0, 60))
"""
OVERLAPPING = """(choice) => {
    const boxes = [...document.querySelectorAll(choice)]
        .filter((one) => getComputedStyle(one).display !== "none" && one.getClientRects().length)
        .map((one) => [one.textContent || one.id || one.tagName, one.getBoundingClientRect()])
        .filter(([, box]) => box.width > 0);
    const found = [];
    boxes.forEach(([name, a], k) => {
        for (const [other, b] of boxes.slice(k + 1)) {
            const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
            const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
            if (wide > 2 && high > 2) found.push([name, other]);
        }
    });
    return found;
}"""


WHOLE = """one => {
    const range = document.createRange();
    range.selectNodeContents(one);
    return range.getBoundingClientRect().bottom <= one.getBoundingClientRect().bottom + 1;
}"""
MIDDLE = """one => {
    const { left, top, width, height } = one.getBoundingClientRect();
    return [left + width / 3, top + height / 2];
}"""


@pytest.fixture
def survey(data_dir: Path, tmp_path: Path) -> Path:
    """Two marks that lie close together, a length that does not fit, and all kinds of values."""
    folder = tmp_path / "survey"
    shutil.copytree(data_dir / "calm_nadir", folder, ignore=shutil.ignore_patterns("out", "*.tlog"))
    with (folder / "picks.csv").open("a") as picks:
        picks.write("IMG_0046.jpg,close by,1590.0,1412.0,0.8\n")  # beside R1
    (folder / "measure.csv").write_text(
        "name,kind,points,parameters\n"
        "A name that is far longer than there is room for,distance,R1;P12,\n"
        "A1,area,R1;R2;R7;R4,\nskid,skid_speed,R6;P2,mu=0.7;mu_sigma=0.05\n"
        "way,polyline,R1;R2;R3;R4;R5;R6;R7;R8;P2;P3;P6;P8,\nangle,angle,P8;P3;P22,\n"
    )
    return folder / "project.yaml"


def test_nothing_overlaps_and_nothing_is_cut_off(survey: Path, open_page: PageOpener) -> None:
    with served(survey) as server:
        page = open_page(server)
        show_photo(page, server.picking.index["IMG_0046.jpg"])
        wait_until_adjusted(page)
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            for tab in ("Photos", "Camera", "Measure"):
                page.get_by_role("tab", name=tab).click()
                expect(page.get_by_role("tabpanel", name=tab)).to_be_visible()
                eventually(page, lambda: page.evaluate(CUT_OFF) == [])
            assert page.evaluate(OVERLAPPING, "header > *:not(.unseen)") == [], width
            expect(page.get_by_role("button", name="Help")).to_be_in_viewport(ratio=1)
            eventually(page, lambda: page.evaluate(OVERLAPPING, "svg.marks text") == [])
            assert page.evaluate(OVERLAPPING, "#panes, #panel, #strip, header") == [], width
        page.evaluate("document.querySelector('#project').style.minWidth = '900px'")
        page.set_viewport_size({"width": 1280, "height": 720})
        eventually(page, lambda: page.evaluate(CUT_OFF) != [])  # the test can fall
        assert not open_page.errors


def test_the_verdict_is_shown_whole_or_scrolls_visibly_and_a_notice_covers_nothing(
    survey: Path, open_page: PageOpener
) -> None:
    with served(survey) as server:
        page = open_page(server)
        show_photo(page, server.picking.index["IMG_0046.jpg"])
        wait_until_adjusted(page)
        text = page.locator("#first > span").first
        text.evaluate("one => { one.textContent += ' more'.repeat(40); }")
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            assert text.evaluate(WHOLE)
            edge = page.locator("#verdict").evaluate("one => getComputedStyle(one).backgroundImage")
            assert edge.count("gradient") == 2  # shows where more follows
            assert page.locator("#mode").evaluate("one => one.scrollWidth <= one.clientWidth")
            page.mouse.move(*page.locator("svg.marks").evaluate(MIDDLE))
            expect(page.locator(".loupe")).to_be_visible()
            page.keyboard.press("Shift+T")  # says something
            expect(page.locator("#notice")).to_be_visible()
            boxes = "#notice, .loupe, .choices > *, .readout"
            assert page.evaluate(OVERLAPPING, boxes) == [], width
            page.keyboard.press("Shift+T")
            page.keyboard.press("Escape")
        assert not open_page.errors


def test_the_plan_covers_no_result(survey: Path, open_page: PageOpener) -> None:
    uavgram.run(survey)
    with served(survey) as server:
        page = open_page(server, 1024, 700)
        page.get_by_role("tab", name="Results").click()
        table, plan = page.get_by_role("table", name="Results"), page.locator(".plan img")
        expect(table.locator(".status").first).to_be_visible()
        expect(plan).to_be_visible()
        for width, height in ((1001, 700), (1024, 700), (1400, 900)):
            page.set_viewport_size({"width": width, "height": height})
            left, right = table.bounding_box(), plan.bounding_box()
            assert left is not None
            assert right is not None
            assert left["x"] + left["width"] <= right["x"]
            assert table.locator(".status").first.evaluate(
                "one => one.scrollWidth <= one.clientWidth"
            )
        assert not open_page.errors


def test_both_buttons_of_an_entry_stand_in_one_row(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server, 1280, 800)
        place(page, "A", *planted.marks_px[0])
        place(page, "B", *planted.marks_px[1])
        page.keyboard.press("l")
        click_mark(page, "A")
        click_mark(page, "B")
        buttons = page.get_by_role("form", name="New length A to B").get_by_role("button").all()
        tops = [button.evaluate("one => one.getBoundingClientRect().top") for button in buttons]
        assert len(tops) == 2
        assert tops[0] == tops[1]
        assert not open_page.errors
