"""Tools of the page: every kind that can be measured, and what each says of what it needs."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import (
    click_mark,
    eventually,
    measured,
    place,
    show_photo,
    to_page,
    wait_until_adjusted,
    wait_until_pictured,
)
from picking_projects import PickingProject
from picking_server import served
from playwright.sync_api import Locator, Page, expect

from uavgram.model.observations import MEASUREMENT_FORMS
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

WITHOUT_NUMBERS = {"pick", "length"}
"""Tools that measure nothing: one marks a place, one takes a length as known."""


def entry(page: Page, name: str) -> Locator:
    """The form that asks for what clicks cannot say."""
    return page.get_by_role("form", name=name)


def key_in(title: str | None) -> str:
    """The key that the title of a tool names."""
    named = re.search(r"\((\w)\): \w", title or "")
    assert named is not None, title
    return named[1]


def type_label(page: Page, label: str) -> None:
    """Name a point, and do with it what the tool does."""
    page.keyboard.press("/")
    page.keyboard.type(label)
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")


def test_every_kind_of_measurement_has_a_tool_with_a_key_of_its_own(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.get_by_role("button", name="More").click()  # each says there what it is for
        tools = page.get_by_role("radiogroup", name="tool").get_by_role("radio")
        titles = {
            tool.get_attribute("data-tool"): tool.get_attribute("title") for tool in tools.all()
        }
        assert set(titles) == set(MEASUREMENT_FORMS) | WITHOUT_NUMBERS
        keys = {kind: key_in(title) for kind, title in titles.items()}
        assert len(set(keys.values())) == len(keys)
        for kind, key in keys.items():
            page.keyboard.press(key.lower())
            expect(page.locator(f'[data-tool="{kind}"]')).to_be_checked()
        page.keyboard.press("?")
        named = page.get_by_role("dialog").locator("dt").all_inner_texts()
        assert set(keys.values()) <= {key for words in named for key in words.split()}
        assert not open_page.errors


def test_keys_change_nothing_behind_an_open_menu(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        place(page, "A", *planted.marks_px[0])
        before = server.picking.state
        menu = page.get_by_role("radiogroup", name="More tools")
        page.get_by_role("button", name="More").click()
        expect(menu).to_be_visible()
        for key in ("Control+z", "Delete", "w"):
            page.locator("#more").focus()  # not on a tool
            page.keyboard.press(key)
        page.keyboard.press("Escape")
        expect(menu).to_be_hidden()
        assert server.picking.state == before
        assert not server.desk.is_busy
        page.get_by_role("button", name="More").click()
        page.keyboard.press("9")  # as the menu shows
        expect(page.locator('[data-tool="profile"]')).to_be_checked()
        assert not open_page.errors


def test_a_number_typed_after_a_drawn_distance_is_no_shortcut(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.keyboard.press("d")
        for u, v in planted.marks_px[:2]:
            page.mouse.click(*to_page(page, u, v))
        eventually(page, lambda: len(server.picking.state.requests) == 1)
        page.keyboard.type("24.5")
        expect(page.get_by_role("alert")).to_contain_text("choose Taped length (L)")
        expect(page.locator('[data-tool="distance"]')).to_be_checked()
        page.keyboard.press("Escape")
        page.keyboard.press("5")
        expect(page.locator('[data-tool="vertical_distance"]')).to_be_checked()
        assert not open_page.errors


@pytest.fixture
def survey(data_dir: Path, tmp_path: Path) -> Path:
    """A survey with a flight log, in which one distance is measured."""
    folder = tmp_path / "survey"
    leave = shutil.ignore_patterns("out", "*.tlog", "measure.csv")
    shutil.copytree(data_dir / "calm_nadir", folder, ignore=leave)
    (folder / "measure.csv").write_text("name,kind,points\nD1,distance,R1;R2\n")
    return folder / "project.yaml"


def test_a_coordinate_and_a_speed_by_keyboard_alone_have_the_numbers_of_a_run(
    survey: Path, open_page: PageOpener
) -> None:
    with served(survey) as server:
        page = open_page(server)
        show_photo(page, server.picking.index["IMG_0044.jpg"])
        page.keyboard.press("c")
        type_label(page, "R1")
        page.keyboard.press("h")
        type_label(page, "car then")  # in the middle of the photo
        expect(page.get_by_role("button", name=re.compile("^car then, u"))).to_be_visible()
        expect(page.get_by_role("tabpanel")).to_contain_text("Now show another photo")
        page.keyboard.press("PageDown")
        wait_until_pictured(page, "IMG_0045")
        type_label(page, "car later")
        form = entry(page, "New S1")
        expect(form).to_contain_text(
            re.compile(r"car then: IMG_0044.jpg, \d\d:\d\d:\d\d\.\d\d UTC")
        )
        expect(form).to_contain_text(re.compile(r"Between the two photos: \d+\.\d\d s"))
        expect(form.get_by_role("textbox", name="Name")).to_be_focused()
        expect(form.get_by_role("button", name="Add")).to_be_enabled()
        page.keyboard.press("Enter")
        eventually(page, lambda: "km/h" in measured(page).get("S1", ""))
        wait_until_adjusted(page)
        shown = measured(page)
        assert not open_page.errors
    result = compute(read_inputs(survey)).result
    found = dict(zip(result.measurements.name, result.measurements.value.tolist(), strict=True))
    point = result.points.label.index("R1")
    wanted = {
        "E": found["C1 east"],
        "N": found["C1 north"],
        "lat": result.points.latitude_deg[point],
        "lon": result.points.longitude_deg[point],
        "speed": found["S1"] * 3.6,
    }
    said = dict(line.split(" ", 1) for line in shown["C1"].splitlines()) | {"speed": shown["S1"]}
    assert set(said) == set(wanted)
    for name, value in wanted.items():
        number = re.match(r"-?\d+\.(\d+)", said[name])
        assert number is not None, name
        assert number[0] == f"{value:.{len(number[1])}f}", name
        assert len(number[1]) >= {"lat": 6, "lon": 6}.get(name, 1)


def test_a_speed_says_why_its_points_will_not_do(survey: Path, open_page: PageOpener) -> None:
    with served(survey) as server:
        page = open_page(server)
        show_photo(page, server.picking.index["IMG_0046.jpg"])
        page.keyboard.press("h")
        click_mark(page, "R1")
        notice = page.locator("#notice")
        expect(notice).to_contain_text(
            re.compile(r"R1 is picked in \d photos \(IMG_.*label of its own")
        )
        page.locator("#label").fill("R2")  # is elsewhere, too: what moves gets a label of its own
        for u, v in ((700.0, 500.0), (900.0, 500.0)):
            page.mouse.click(*to_page(page, u, v))
        form = entry(page, "New S1")
        why = "R9 and R10 are both picked in IMG_0046.jpg. A speed needs two photos"
        expect(form.get_by_role("status")).to_contain_text(why)
        expect(form.get_by_role("button", name="Add")).to_be_disabled()
        assert {"R9", "R10"} <= set(server.picking.state.labels)
        assert not open_page.errors


def test_what_is_wrong_is_said_beside_its_field_and_nothing_else_is_changed(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        for label, (u, v) in zip(("A", "B", "C"), planted.marks_px, strict=False):
            place(page, label, u, v)
        for end, length in (("B", "1,5"), ("C", "2.5")):
            page.keyboard.press("l")
            type_label(page, "A")
            type_label(page, end)
            form = entry(page, f"New length A to {end}")
            wrong = form.get_by_role("alert")
            for typed, why in (
                ("abc", "abc is no number"),
                ("1,500 mm", "meant as 1.500 mm or 1500 mm"),
            ):
                form.get_by_label("Length").fill(typed)
                page.keyboard.press("Enter")
                expect(wrong).to_contain_text(why)
                expect(form.get_by_label("Length")).to_be_focused()
            form.get_by_label("Length").fill(length)
            form.get_by_label("Name").fill("base")
            page.keyboard.press("Enter")
        expect(wrong).to_contain_text("There is a length base already")
        form.get_by_label("Name").fill("other")
        page.keyboard.press("Enter")
        expect(page.get_by_role("button", name="Remove other")).to_be_visible()
        page.keyboard.press("p")
        page.keyboard.press("/")
        page.keyboard.type("C")
        page.keyboard.press("Enter")
        page.keyboard.press("F2")
        page.keyboard.type("B")
        page.keyboard.press("Enter")
        question = page.get_by_role("alertdialog", name="There is a point B already")
        page.keyboard.press("Enter")  # chooses nothing by itself
        expect(question).to_be_visible()
        page.keyboard.press("ArrowDown")
        expect(question.get_by_role("button", name="one point: merge them")).to_be_focused()
        page.keyboard.press("Escape")
        expect(question).to_have_count(0)
        expect(page.locator('.mark.selected[data-label="C"]')).to_have_count(1)
        expect(page.locator("#label")).to_have_value("C")
        lines = [(line.name, line.end, line.length_m) for line in server.picking.state.lines]
        assert lines == [("base", "B", 1.5), ("other", "C", 2.5)]
        assert set(server.picking.state.labels) == {"A", "B", "C"}
        page.keyboard.press("h")
        page.keyboard.press("Enter")
        expect(page.locator("#notice")).to_contain_text("The time of photo.jpg is not known")
        assert not open_page.errors


def test_rows_of_a_table_are_gone_through_and_removed_by_keyboard(
    planted: PickingProject, open_page: PageOpener
) -> None:
    measure = planted.path.with_name("measure.csv")
    rows = [f"D{k},distance,A;{label}" for k, label in enumerate("BCD")]
    measure.write_text("\n".join(["name,kind,points", *rows]) + "\n")
    with served(planted.path) as server:
        page = open_page(server)
        page.get_by_role("button", name="Remove D0").focus()
        page.keyboard.press("ArrowDown")
        expect(page.get_by_role("button", name="Remove D1")).to_be_focused()
        page.keyboard.press("Enter")
        expect(page.get_by_role("button", name="Remove D2")).to_be_focused()
        page.keyboard.press("Enter")  # the last one: on to the one before
        expect(page.get_by_role("button", name="Remove D0")).to_be_focused()
        assert [one.name for one in server.picking.state.requests] == ["D0"]
        assert not open_page.errors


def test_a_page_whose_program_has_ended_says_so(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.clock.install()
        server.stop()
        expect(page.locator("#mode")).to_have_text("no connection")
        page.clock.run_for(3_000)  # it takes no time
        expect(page.get_by_role("alert")).to_contain_text("The program does not answer")
        expect(page.get_by_role("alert")).to_contain_text("as you did before, by the icon")
