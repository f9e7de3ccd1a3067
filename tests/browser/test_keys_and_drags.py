"""Keyboard alone suffices, marks have spoken names, and numbers move before the button is up."""

from __future__ import annotations

import re
import shutil
import time
from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import eventually, measured, show_photo, to_page, wait_until_adjusted
from picking_projects import PickingProject
from picking_server import Served, served
from playwright.sync_api import Page, expect

from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.parse import Message
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs


def picks_of(server: Served) -> dict[str, tuple[float, float]]:
    return {pick.label: (pick.u_px, pick.v_px) for pick in server.picking.state.picks}


def test_keyboard_alone_places_nudges_renames_and_undoes(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.locator("#label").fill("kerb")
        page.keyboard.press("Enter")  # to the photo
        page.keyboard.press("Enter")  # places it in the middle
        expect(
            page.get_by_role("button", name=re.compile("^kerb, u 1000.*, v 700"))
        ).to_be_visible()
        u, v = picks_of(server)["kerb"]
        for key in ("ArrowRight", "ArrowRight", "Shift+ArrowDown", "Alt+ArrowLeft"):
            page.keyboard.press(key)
        nudged = pytest.approx((u + 0.2 - 10.0, v + 1.0))
        eventually(page, lambda: picks_of(server)["kerb"] == nudged)
        page.keyboard.press("F2")
        page.keyboard.type("gully")
        page.keyboard.press("Enter")
        expect(page.get_by_role("button", name=re.compile("^gully, u"))).to_be_visible()
        page.keyboard.press("Escape")
        for _ in range(3):  # the name, the nudges as one step, the place
            page.keyboard.press("Control+z")
        expect(page.locator(".mark")).to_have_count(0)
        expect(page.locator("#undo")).to_be_disabled()
        page.keyboard.press("Control+Shift+z")
        expect(page.get_by_role("button", name=re.compile("^kerb, u"))).to_be_visible()
        page.keyboard.press("n")
        page.keyboard.press("Delete")
        expect(page.locator(".mark")).to_have_count(0)
        assert not open_page.errors


def test_nothing_is_marked_beside_the_photo(planted: PickingProject, open_page: PageOpener) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.locator("svg.marks").first.focus()
        readout = page.locator(".readout").first
        page.keyboard.press("Control+ArrowRight")
        for _ in range(100):
            if "beside the photo" in readout.inner_text():
                break
            page.keyboard.press("Control+ArrowRight")
        expect(readout).to_contain_text("beside the photo")
        page.keyboard.press("Enter")
        expect(page.locator("#notice")).to_contain_text("nothing was marked")
        expect(page.locator(".mark")).to_have_count(0)
        page.keyboard.press("f")
        page.keyboard.press("Enter")
        expect(page.locator(".mark")).to_have_count(1)
        assert not open_page.errors


KINDS = {
    "d": ("D1", ["R1", "R2"]),
    "a": ("A1", ["R1", "R2", "R7", "R4"]),
    "y": ("W1", ["R1", "R2", "R3"]),
    "j": ("J1", ["R1", "R2", "R3"]),
    "i": ("H1", ["R1", "R2", "R3"]),
    "v": ("V1", ["R1", "R3"]),
}
"""Key of each tool, the name that it gives, and the points to measure."""


def type_point(page: Page, label: str) -> None:
    """Take a point into what is being measured, by its name."""
    page.keyboard.press("/")
    page.keyboard.type(label)
    page.keyboard.press("Enter")  # selects it
    page.keyboard.press("Enter")  # takes it


def tab_to(page: Page, name: str) -> None:
    """Go on by Tab to what has this name."""
    for _ in range(80):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.getAttribute('aria-label')") == name:
            return
    pytest.fail(f"Tab does not lead to {name!r}")


def test_keyboard_alone_measures_each_kind_and_gives_the_numbers_of_a_run(
    copied_survey: Path, open_page: PageOpener
) -> None:
    (copied_survey.parent / "measure.csv").write_text("name,kind,points\n")
    (copied_survey.parent / "lines.csv").write_text("name,from,to,length_m,sigma_m\n")
    with served(copied_survey) as server:
        page = open_page(server)
        keyboard = page.keyboard
        keyboard.press("F6")
        keyboard.press("F6")  # past the tools, to the photo
        expect(page.locator("svg.marks")).to_be_focused()
        for start, end, length in (("R1", "R2", "11.52"), ("R3", "R4", "17.36")):
            keyboard.press("l")
            type_point(page, start)
            type_point(page, end)
            keyboard.type(length)
            keyboard.press("Enter")
        for key, (_, points) in KINDS.items():
            keyboard.press(key)
            for label in points:
                type_point(page, label)
            if len(points) > 3 or key in "yv":
                keyboard.press("Enter")  # no more points
            if key == "v":
                expect(page.get_by_role("textbox", name="Friction")).to_be_visible()
                keyboard.press("Enter")  # the friction that is proposed
        expect(page.locator('table[aria-label="Measurements"] tr[data-row]')).to_have_count(6)
        keyboard.press("p")
        for turn, photo in (("PageDown", "IMG_0047.jpg"), ("PageUp", "IMG_0046.jpg")):
            keyboard.press(turn)
            expect(page.locator(".pane")).to_have_attribute("data-image", photo)
        keyboard.press("/")
        keyboard.type("R8")
        keyboard.press("Enter")
        keyboard.press("F2")
        for value in ("0.5", "0.2"):  # its sigma here, and its height
            keyboard.press("Tab")
            keyboard.type(value)
        keyboard.press("Enter")
        expect(page.locator("svg.marks")).to_be_focused()
        tab_to(page, "Withhold L2: only judge it")
        keyboard.press("Enter")
        expect(page.get_by_role("button", name="Use L2")).to_be_visible()
        wait_until_adjusted(page)
        shown = measured(page)
        pick = server.picking.state.pick("IMG_0046.jpg", "R8")
        assert pick is not None
        assert (pick.sigma_px, pick.height_m) == (0.5, 0.2)
        assert not open_page.errors
    found = compute(read_inputs(copied_survey)).result
    assert found.lines.status == ("used", "checked")
    assert set(found.measurements.name) == set(shown)
    for name, value, sigma in zip(
        found.measurements.name, found.measurements.value, found.measurements.sigma, strict=True
    ):
        pace = 3.6 if name == "V1" else 1.0  # shown in km/h
        number, _, error = shown[name].split(" ")[:3]
        digits = len(number.partition(".")[2])
        assert number == f"{pace * value:.{digits}f}"
        assert error == f"{pace * sigma:.{digits}f}"


NEED_A_NAME = {
    *("button", "textbox", "combobox", "radio", "tab", "link", "application", "table", "region"),
    *("tabpanel", "radiogroup", "tablist", "navigation", "main", "complementary", "form"),
    *("dialog", "progressbar", "image", "group", "log"),
}


def nameless(page: Page) -> list[str]:
    """Roles of what a screen reader would come upon without a name (WAI-ARIA 1.2, 5.2.8)."""
    session = page.context.new_cdp_session(page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    return [
        node["role"]["value"]
        for node in nodes
        if not node["ignored"]
        and node["role"]["value"] in NEED_A_NAME
        and not node.get("name", {}).get("value", "").strip()
    ]


def test_everything_has_a_name_for_a_screen_reader_and_focus_is_seen(
    copied_survey: Path, open_page: PageOpener
) -> None:
    with served(copied_survey) as server:
        page = open_page(server)
        wait_until_adjusted(page)
        for tab in ("Measure", "Photos", "Camera", "Results"):
            expect(page.get_by_role("tabpanel", name=tab)).to_be_visible()
            assert nameless(page) == []
            page.keyboard.press("x")
        page.evaluate("document.querySelector('#undo').removeAttribute('id')")
        page.evaluate("document.querySelector('header button[title^=Undo]').textContent = ''")
        page.evaluate("document.querySelector('header button[title^=Undo]').title = ''")
        assert nameless(page) == ["button"]  # the test can fall
        seen = set()
        for _ in range(40):
            page.keyboard.press("Tab")
            focused = page.evaluate(
                """() => {
                    const at = document.activeElement;
                    const pane = at.closest(".pane");
                    const ring = at.matches(".mark") ? at.querySelector(".ring") : null;
                    const look = getComputedStyle(ring ?? at);
                    const frame = getComputedStyle(pane ?? at, "::after");
                    return [at.outerHTML.slice(0, 80), ring ? look.stroke !== "none"
                        : look.outlineStyle !== "none" || frame.borderTopStyle === "solid"];
                }"""
            )
            assert focused[1], focused[0]
            seen.add(focused[0])
        assert len(seen) > 25


def test_the_arrows_go_through_tools_tabs_and_photos(
    copied_survey: Path, open_page: PageOpener
) -> None:
    with served(copied_survey) as server:
        page = open_page(server)
        page.keyboard.press("F6")
        page.keyboard.press("ArrowRight")
        expect(page.get_by_role("radio", name="Length")).to_be_checked()
        for _ in range(2):
            page.keyboard.press("F6")
        page.keyboard.press("ArrowRight")
        expect(page.get_by_role("tab", name="Photos")).to_have_attribute("aria-selected", "true")
        page.keyboard.press("F6")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("Enter")
        expect(page.locator(".pane")).to_have_attribute("data-image", "IMG_0047.jpg")
        expect(page.locator("svg.marks")).to_be_focused()
        page.keyboard.press("PageDown")
        expect(page.locator(".pane")).to_have_attribute("data-image", "IMG_0048.jpg")
        assert not open_page.errors


def test_points_and_lengths_that_come_faster_than_they_are_confirmed_are_all_kept(
    planted: PickingProject, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        change = server.picking.change

        def slowly(message: Message) -> m.Changed:
            time.sleep(0.25)
            return change(message)

        monkeypatch.setattr(server.picking, "change", slowly)
        for u, v in planted.marks_px:
            page.mouse.click(*to_page(page, u, v))
        expect(page.locator(".mark")).to_have_count(4)
        assert set(picks_of(server)) == {"P1", "P2", "P3", "P4"}
        for start, end in (("P1", "P2"), ("P3", "P4")):
            page.keyboard.press("l")
            type_point(page, start)
            type_point(page, end)
            page.keyboard.type("1.5")
            page.keyboard.press("Enter")
        expect(page.locator('table[aria-label="Known lengths"] tr[data-row]')).to_have_count(2)
        assert not open_page.errors


def test_a_target_is_snapped_to_with_its_sigma(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        u, v = planted.marks_px[0]
        page.mouse.move(*to_page(page, u + 1.0, v - 1.0))
        page.keyboard.press("Shift+S")
        expect(page.locator(".mark")).to_have_count(1)
        (pick,) = server.picking.state.picks
        assert (pick.u_px, pick.v_px) == pytest.approx((u, v), abs=0.1)
        assert pick.sigma_px is not None
        assert 0 < pick.sigma_px < 0.5
        page.mouse.move(*to_page(page, 200.0, 200.0))
        page.keyboard.press("Escape")
        page.keyboard.press("s")
        expect(page.get_by_role("alert")).to_contain_text("no corner")


@pytest.fixture
def copied_survey(data_dir: Path, tmp_path: Path) -> Path:
    """A survey with all its picks, and little to measure."""
    project = tmp_path / "survey"
    leave = shutil.ignore_patterns("out", "*.tlog", "measure.csv")
    shutil.copytree(data_dir / "calm_nadir", project, ignore=leave)
    (project / "measure.csv").write_text("name,kind,points\nD1,distance,R1;R2\nD2,area,R1;R2;R7\n")
    return project / "project.yaml"


def test_numbers_move_before_the_button_is_up(copied_survey: Path, open_page: PageOpener) -> None:
    with served(copied_survey) as server:
        page = open_page(server)
        show_photo(page, server.picking.index["IMG_0046.jpg"])
        wait_until_adjusted(page)
        before, place = measured(page)["D1"], picks_of(server)["R2"]
        pick = server.picking.state.pick("IMG_0046.jpg", "R2")
        assert pick is not None
        x, y = to_page(page, pick.u_px, pick.v_px)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 20, y + 10)
        expect(page.locator('table[aria-label="Measurements"]')).not_to_contain_text(before)
        expect(page.locator("#mode")).to_contain_text(re.compile("first estimate|adjusted"))
        page.mouse.up()
        wait_until_adjusted(page)
        page.keyboard.press("Control+z")
        expect(page.locator('table[aria-label="Measurements"]')).to_contain_text(before)
        assert picks_of(server)["R2"] == place
        assert not open_page.errors


def test_four_panes_that_are_linked_show_the_same_ground(
    copied_survey: Path, open_page: PageOpener
) -> None:
    with served(copied_survey) as server:
        page = open_page(server, 1600, 1000)
        wait_until_adjusted(page)
        show_photo(page, server.picking.index["IMG_0045.jpg"])
        page.keyboard.press("Control+4")
        expect(page.locator(".pane")).to_have_count(4)
        page.locator(".pane svg.marks").first.focus()
        page.keyboard.press("k")
        page.mouse.move(*to_page(page, 1500, 1100))
        page.mouse.wheel(0, -900)
        mark = page.locator('.pane[data-image="IMG_0046.jpg"] .mark').first
        expect(mark).to_be_attached()

        def alike() -> bool:
            panes = page.locator(".pane")
            scales: list[float] = panes.evaluate_all(
                "panes => panes.map(pane => +pane.dataset.scale)"
            )
            return max(scales) < 1.6 * min(scales)

        eventually(page, alike)
        assert not open_page.errors


def test_a_letter_does_nothing_while_a_form_or_a_question_waits(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.keyboard.press("l")
        for u, v in planted.marks_px[:2]:
            page.mouse.click(*to_page(page, u, v))
        form = page.locator('form[data-row="entry"]')
        expect(form).to_be_visible()
        page.evaluate("() => document.activeElement.blur()")
        for key in ("q", "ArrowUp", "s", "w"):
            page.keyboard.press(key)
            expect(page.locator("#notice")).to_contain_text(f"{key.upper()} was not used: the form")
        page.keyboard.press("f")  # only the view
        page.keyboard.type("12.56")
        page.evaluate("() => document.activeElement.blur()")
        page.keyboard.press("Backspace")  # edits the number, and no mark
        expect(form.locator('input[name="length_m"]')).to_have_value("12.5")
        page.keyboard.press("Enter")
        eventually(page, lambda: [one.length_m for one in server.picking.state.lines] == [12.5])
        assert len(server.picking.state.picks) == 2

        page.keyboard.press("p")
        u, v = planted.marks_px[0]
        x, y = to_page(page, u, v)
        page.mouse.click(x + 15, y)  # so near that the page asks
        question = page.get_by_role("alertdialog")
        expect(question).to_be_visible()
        page.keyboard.press("Delete")
        page.keyboard.press("d")
        expect(page.locator("#notice")).to_contain_text("D was not used: answer the question")
        expect(question).to_be_visible()
        expect(page.locator('[data-tool="pick"]')).to_be_checked()
        assert not open_page.errors
