"""Keyboard alone suffices, marks have spoken names, and numbers move before the button is up."""

from __future__ import annotations

import re
import shutil

import pytest
from picking_pages import measured, show_photo, to_page, wait_until_adjusted
from picking_server import served
from playwright.sync_api import expect


def picks_of(server):
    return {pick.label: (pick.u_px, pick.v_px) for pick in server.desk.state.picks}


def eventually(page, holds):
    """Wait for what the server comes to know."""
    for _ in range(100):
        if holds():
            return
        page.wait_for_timeout(50)
    pytest.fail("it did not come about within 5 s")


def test_keyboard_alone_places_nudges_renames_and_undoes(planted, open_page):
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
        expect(page.get_by_role("button", name=re.compile("^kerb"))).to_be_visible()
        page.keyboard.press("n")
        page.keyboard.press("Delete")
        expect(page.locator(".mark")).to_have_count(0)
        assert not page.errors


def test_a_target_is_snapped_to_with_its_sigma(planted, open_page):
    with served(planted.path) as server:
        page = open_page(server)
        u, v = planted.marks_px[0]
        page.mouse.move(*to_page(page, u + 1.0, v - 1.0))
        page.keyboard.press("Shift+S")
        expect(page.locator(".mark")).to_have_count(1)
        (pick,) = server.desk.state.picks
        assert (pick.u_px, pick.v_px) == pytest.approx((u, v), abs=0.1)
        assert 0 < pick.sigma_px < 0.5
        page.mouse.move(*to_page(page, 200.0, 200.0))
        page.keyboard.press("Escape")
        page.keyboard.press("s")
        expect(page.get_by_role("alert")).to_contain_text("no corner")


@pytest.fixture
def copied_survey(data_dir, tmp_path):
    project = tmp_path / "survey"
    leave = shutil.ignore_patterns("out", "*.tlog", "measure.csv")
    shutil.copytree(data_dir / "calm_nadir", project, ignore=leave)
    (project / "measure.csv").write_text("name,kind,points\nD1,distance,R1;R2\nD2,area,R1;R2;R7\n")
    return project / "project.yaml"


def test_numbers_move_before_the_button_is_up(copied_survey, open_page):
    with served(copied_survey) as server:
        page = open_page(server)
        show_photo(page, server.desk.index["IMG_0046.jpg"])
        wait_until_adjusted(page)
        before, place = measured(page)["D1"], picks_of(server)["R2"]
        pick = server.desk.state.pick("IMG_0046.jpg", "R2")
        x, y = to_page(page, pick.u_px, pick.v_px)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 20, y + 10)
        expect(page.locator('table[aria-label="Measurements"]')).not_to_contain_text(before)
        expect(page.locator("#mode")).to_contain_text(re.compile("first order|adjusted"))
        page.mouse.up()
        wait_until_adjusted(page)
        page.keyboard.press("Control+z")
        expect(page.locator('table[aria-label="Measurements"]')).to_contain_text(before)
        assert picks_of(server)["R2"] == place
        assert not page.errors


def test_four_panes_that_are_linked_show_the_same_ground(copied_survey, open_page):
    with served(copied_survey) as server:
        page = open_page(server, 1600, 1000)
        wait_until_adjusted(page)
        show_photo(page, server.desk.index["IMG_0045.jpg"])
        page.keyboard.press("Control+4")
        expect(page.locator(".pane")).to_have_count(4)
        page.locator(".pane svg.marks").first.focus()
        page.keyboard.press("k")
        page.mouse.move(*to_page(page, 1500, 1100))
        page.mouse.wheel(0, -900)
        mark = page.locator('.pane[data-image="IMG_0046.jpg"] .mark').first
        expect(mark).to_be_attached()

        def alike():
            panes = page.locator(".pane")
            scales = panes.evaluate_all("panes => panes.map(pane => +pane.dataset.scale)")
            return max(scales) < 1.6 * min(scales)

        eventually(page, alike)
        assert not page.errors
