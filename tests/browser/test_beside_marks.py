"""Clicks beside a mark, and numbers after a line: nothing is taken for what it may not be."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import drawn, eventually, place, show_photo, to_page
from picking_projects import PickingProject
from picking_server import Served, served
from playwright.sync_api import Locator, Page, expect
from textured_ground import NAMES, write_textured

ASIDE_PX = 15
"""On the screen: within the mark's ring, and at fit zoom many pixels of the photo."""

both_windows = pytest.mark.parametrize(
    "window", [(1366, 768), (1920, 1080)], ids=lambda window: f"{window[0]}x{window[1]}"
)


def question(page: Page) -> Locator:
    return page.get_by_role("alertdialog")


def picks(server: Served) -> dict[str, tuple[float, float]]:
    return {one.label: (one.u_px, one.v_px) for one in server.picking.state.picks}


def beside(page: Page, at: tuple[float, float]) -> tuple[float, float]:
    """A place of the page beside a pixel of the photo."""
    x, y = to_page(page, *at)
    return x + ASIDE_PX, y


@both_windows
def test_a_click_beside_a_mark_is_asked_about_and_changes_nothing_by_itself(
    planted: PickingProject, open_page: PageOpener, window: tuple[int, int]
) -> None:
    with served(planted.path) as server:
        page = open_page(server, *window)
        place(page, "first", *planted.marks_px[0])
        before = picks(server)
        page.locator("#label").fill("")
        for answer in (["Escape"], ["1"], ["ArrowDown", "Enter"]):
            page.mouse.click(*beside(page, before["first"]))
            expect(question(page)).to_contain_text("first is very near. Which point is this?")
            expect(page.locator(".mark")).to_have_count(1)
            page.keyboard.press("Enter")  # by itself it answers nothing
            expect(page.locator("#notice")).to_contain_text("Enter was not used")
            expect(question(page)).to_be_visible()
            for key in answer:
                page.keyboard.press(key)
            expect(question(page)).to_have_count(0)
        expect(page.locator('.mark.selected[data-label="first"]')).to_have_count(1)
        assert picks(server) == before
        page.mouse.click(*beside(page, before["first"]))
        page.keyboard.press("Control+Enter")  # nothing is changed behind it
        expect(page.locator("#notice")).to_contain_text("Ctrl+Enter was not used")
        page.keyboard.press("Control+z")  # takes back the click that led to it, and nothing else
        expect(question(page)).to_have_count(0)
        expect(page.locator("#saved")).to_have_text("saved")
        assert picks(server) == before
        page.mouse.click(*beside(page, before["first"]))
        question(page).get_by_role("button", name="A new point").click()
        expect(page.locator(".mark")).to_have_count(2)
        eventually(page, lambda: len(picks(server)) == 2)
        after = picks(server)
        assert after.pop("first") == before["first"]
        scale = float(page.locator(".pane").get_attribute("data-scale") or "")
        ((u, v),) = after.values()
        assert math.dist((u, v), before["first"]) * scale == pytest.approx(ASIDE_PX, abs=0.5)
        assert not open_page.errors


@both_windows
def test_a_press_beside_a_mark_that_slips_does_not_move_the_mark(
    planted: PickingProject, open_page: PageOpener, window: tuple[int, int]
) -> None:
    with served(planted.path) as server:
        page = open_page(server, *window)
        place(page, "first", *planted.marks_px[0])
        before = picks(server)
        x, y = beside(page, before["first"])
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 5, y + 3, steps=3)
        page.mouse.up()
        drawn(page)
        expect(page.locator("#saved")).to_have_text("saved")
        assert picks(server) == before
        x, y = to_page(page, *before["first"])  # on the mark itself it does
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 30, y, steps=3)
        page.mouse.up()
        eventually(page, lambda: picks(server) != before)
        assert not open_page.errors


@both_windows
def test_a_length_between_two_ends_beside_each_other_takes_the_number_typed_after_it(
    planted: PickingProject, open_page: PageOpener, window: tuple[int, int]
) -> None:
    with served(planted.path) as server:
        page = open_page(server, *window)
        page.keyboard.press("l")
        page.mouse.click(*to_page(page, *planted.marks_px[0]))
        expect(page.locator('.mark[data-label="P1"]')).to_have_count(1)
        at = picks(server)["P1"]
        page.mouse.click(*to_page(page, *at))  # not a second end
        expect(page.locator("#notice")).to_contain_text("P1 is chosen already")
        page.mouse.click(*beside(page, at))
        expect(question(page)).to_contain_text("P1 is very near")
        page.keyboard.type("3.0")  # too early: neither an answer nor a tool
        expect(page.locator("#notice")).to_contain_text("was not used: answer the question first")
        page.mouse.click(*to_page(page, *planted.marks_px[1]))  # too early, too
        expect(page.locator("#notice")).to_contain_text("This click marked nothing")
        expect(question(page)).to_be_visible()
        page.keyboard.press("Enter")  # after the number: it answers nothing either
        expect(question(page)).to_be_visible()
        assert set(picks(server)) == {"P1"}
        expect(page.locator('[data-tool="length"]')).to_be_checked()
        question(page).get_by_role("button", name="A new point").click()
        form = page.get_by_role("form", name="New length P1 to P2")
        expect(form.get_by_label("Length")).to_be_focused()
        # The photo was moved meanwhile, another tab looked at: the number goes where it belongs.
        page.locator(".pane svg.marks").focus()
        page.keyboard.type("6.")
        page.locator("#tab-button-frames").click()
        page.keyboard.type("1")
        form.get_by_role("button", name="Add").focus()
        page.keyboard.type("7")
        expect(form.get_by_label("Length")).to_have_value("6.17")
        page.keyboard.press("Enter")
        eventually(page, lambda: len(server.picking.state.lines) == 1)
        (line,) = server.picking.state.lines
        assert (line.start, line.end, line.length_m) == ("P1", "P2", 6.17)
        assert not open_page.errors


NEAR_PX = 6
"""On the screen: a click so near means the mark, unless another end of a line is wanted."""


def test_a_reading_that_is_refused_takes_no_later_click_and_belongs_to_its_own_line(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.keyboard.press("l")
        for at in planted.marks_px[:2]:
            page.mouse.click(*to_page(page, *at))
        page.keyboard.type("5 1/2")
        page.keyboard.press("Enter")
        form = page.get_by_role("form", name="New length P1 to P2")
        expect(form.get_by_role("alert")).to_contain_text("5 1/2 is no number")
        for at in planted.marks_px[2:]:
            page.mouse.click(*to_page(page, *at))
            expect(page.locator("#notice")).to_contain_text("This click marked nothing: correct")
        page.locator('.mark[data-label="P1"]').click()  # nor does a mark become an end
        expect(form.get_by_label("Length")).to_be_focused()
        assert set(picks(server)) == {"P1", "P2"}
        page.keyboard.type("21,734")
        expect(form).to_contain_text("= 21.734 m")
        for at in planted.marks_px[2:]:
            page.mouse.click(*to_page(page, *at))
        page.keyboard.type("9,317 m")
        page.keyboard.press("Enter")
        eventually(page, lambda: len(server.picking.state.lines) == 2)
        assert [(one.start, one.end, one.length_m) for one in server.picking.state.lines] == [
            ("P1", "P2", 21.734),
            ("P3", "P4", 9.317),
        ]
        page.get_by_role("button", name="Change length L1").click()
        page.mouse.click(*to_page(page, *planted.marks_px[1]))  # a new line: P2 to P3
        page.mouse.click(*to_page(page, *planted.marks_px[2]))
        page.keyboard.type("7.5")
        page.keyboard.press("Enter")
        eventually(page, lambda: len(server.picking.state.lines) == 3)
        assert [one.length_m for one in server.picking.state.lines] == [21.734, 9.317, 7.5]
        assert not open_page.errors


def test_a_number_without_a_line_does_nothing_and_the_other_end_may_be_very_near(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.keyboard.press("l")
        page.mouse.click(*to_page(page, *planted.marks_px[0]))
        scale = page.locator(".pane").get_attribute("data-scale")
        expect(page.locator('.mark[data-label="P1"]')).to_have_count(1)
        page.mouse.click(*to_page(page, *picks(server)["P1"]))
        expect(page.locator("#notice")).to_contain_text("P1 is chosen already")
        page.keyboard.type("1.7 m")
        page.keyboard.press("Enter")
        expect(page.locator("#notice")).to_contain_text("1.7 m was not used")
        expect(page.locator('[data-tool="length"]')).to_be_checked()
        assert page.locator(".pane").get_attribute("data-scale") == scale
        x, y = to_page(page, *picks(server)["P1"])
        page.mouse.click(x + NEAR_PX, y)
        expect(question(page)).to_contain_text("P1 is very near")
        question(page).get_by_role("button", name="A new point").click()
        expect(page.get_by_role("form", name="New length P1 to P2")).to_be_visible()
        eventually(page, lambda: set(picks(server)) == {"P1", "P2"})
        page.keyboard.type("0.2")
        page.keyboard.press("d")  # a number after a refused click of another tool
        x, y = to_page(page, *picks(server)["P2"])
        for _ in range(2):
            page.mouse.click(*to_page(page, *planted.marks_px[1]))
        expect(page.locator("#notice")).to_contain_text("is chosen already")
        page.keyboard.type("4.5")
        page.keyboard.press("Enter")
        expect(page.locator("#notice")).to_contain_text("4.5 was not used")
        expect(page.locator('[data-tool="distance"]')).to_be_checked()
        eventually(page, lambda: set(picks(server)) == {"P1", "P2", "P3"})
        assert not open_page.errors


def test_a_line_without_a_reading_is_a_distance_and_a_typed_reading_is_written_without_enter(
    planted: PickingProject, open_page: PageOpener
) -> None:
    written: list[str] = []

    def read_tables(project: Path) -> None:
        written.append((project.parent / "lines.csv").read_text(encoding="utf-8"))

    with served(planted.path, run=read_tables) as server:
        page = open_page(server)
        page.keyboard.press("l")
        for at in planted.marks_px[:3]:
            page.mouse.click(*to_page(page, *at))
        eventually(page, lambda: len(server.picking.state.requests) == 1)  # by the third click
        (wanted,) = server.picking.state.requests
        assert (wanted.kind, wanted.points) == ("distance", ("P1", "P2"))
        notice = page.locator("#notice")
        expect(notice).to_contain_text("No reading was typed: D1, the distance P1 – P2")
        page.mouse.click(*to_page(page, *planted.marks_px[3]))
        page.keyboard.press("Enter")  # of an empty form, too
        expect(notice).to_contain_text("D2, the distance P3 – P4")
        eventually(page, lambda: len(server.picking.state.requests) == 2)
        notice.get_by_role("button", name="It was taped: enter the reading").click()
        expect(page.get_by_role("form", name="New length P3 to P4")).to_be_visible()
        eventually(page, lambda: len(server.picking.state.requests) == 1)
        page.keyboard.type("12.34")
        page.locator("button[name=export]").click()
        eventually(page, lambda: bool(written))
        assert "12.34" in written[0]  # the last reading is in what was written
        assert [one.name for one in server.picking.state.requests] == ["D1"]


def test_a_tools_key_ends_a_reading_unless_it_belongs_to_a_number_or_a_unit(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.keyboard.press("l")
        for at in planted.marks_px[:2]:
            page.mouse.click(*to_page(page, *at))
        form = page.get_by_role("form", name="New length P1 to P2")
        expect(form.get_by_label("Length")).to_be_focused()
        page.keyboard.type("1717cm")  # C is a tool as well
        expect(form.get_by_label("Length")).to_have_value("1717cm")
        page.keyboard.press("d")
        eventually(page, lambda: len(server.picking.state.lines) == 1)
        assert server.picking.state.lines[0].length_m == pytest.approx(17.17)
        expect(page.locator('[data-tool="distance"]')).to_be_checked()
        for at in planted.marks_px[1:3]:
            page.mouse.click(*to_page(page, *at))
        eventually(page, lambda: len(server.picking.state.requests) == 1)
        assert not open_page.errors


@both_windows
def test_a_click_beside_a_hollow_mark_does_not_accept_it(
    tmp_path: Path, open_page: PageOpener, window: tuple[int, int]
) -> None:
    textured = write_textured(tmp_path)
    with served(textured.path) as server:
        page = open_page(server, *window)
        show_photo(page, 1)
        mark = page.locator('[data-proposal="P1"]')
        expect(mark).to_have_count(1)
        at = textured.pixel_px[NAMES[1], "P1"].tolist()
        page.mouse.click(*beside(page, (at[0], at[1])))
        answers = question(page).locator(".answers button")
        expect(answers).to_have_count(4)  # here, where it was found, a new point, nothing
        expect(answers.nth(0)).to_contain_text("P1, where you clicked")
        expect(mark).to_have_count(1)
        assert server.picking.state.pick(NAMES[1], "P1") is None
        answers.nth(1).click()  # where the program found it

        def source() -> str | None:
            pick = server.picking.state.pick(NAMES[1], "P1")
            return None if pick is None else pick.source

        eventually(page, lambda: source() == "match")
        pick = server.picking.state.pick(NAMES[1], "P1")
        assert pick is not None
        assert math.dist((pick.u_px, pick.v_px), at) < 0.5

        # On the mark, a click is a person's own observation, until it is taken back.
        page.keyboard.press("Control+z")
        expect(mark).to_have_count(1)
        x, y = to_page(page, at[0], at[1])
        page.mouse.click(x + 3, y)
        eventually(page, lambda: source() == "hand")
        pick = server.picking.state.pick(NAMES[1], "P1")
        assert pick is not None
        scale = float(page.locator(".pane").get_attribute("data-scale") or "")
        assert math.dist((pick.u_px, pick.v_px), at) * scale == pytest.approx(3.0, abs=0.7)
        picking = server.picking
        eventually(page, lambda: picking._search.searched == picking.version)
        page.get_by_role("button", name="Take the program's place instead").click()
        eventually(page, lambda: source() == "match")
        assert not open_page.errors
