"""What the program finds in other photos: hollow marks, accepted, refused, and asked for."""

from __future__ import annotations

from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import drawn, eventually, place, show_photo, to_page
from picking_server import served
from playwright.sync_api import expect
from textured_ground import NAMES, write_textured

NEW = "P6"

LISTED = """(window.shown = [], [...document.querySelectorAll(
    '[data-row^="found "], [data-row^="found "] + tr.beneath')])"""
"""Rows of what was found, and of their pictures."""


@pytest.fixture
def project(tmp_path: Path) -> tuple[Path, tuple[float, float]]:
    """Three photos with picks in the first, and where one more is to be clicked there."""
    textured = write_textured(tmp_path)
    rows = textured.picks.read_text().splitlines(keepends=True)
    textured.picks.write_text("".join(row for row in rows if NEW not in row))
    u, v = textured.pixel_px[NAMES[0], NEW].tolist()
    return textured.path, (u, v)


def test_a_click_is_proposed_accepted_refused_and_asked_for(
    project: tuple[Path, tuple[float, float]], open_page: PageOpener
) -> None:
    path, there = project
    with served(path) as server:
        page = open_page(server)
        expect(page.locator("#mode")).to_have_attribute("data-mode", "adjusted")
        page.locator("#label").fill(NEW)
        page.mouse.click(*to_page(page, *there))
        proposed = page.get_by_role("table", name="Found by the program")
        mine = proposed.locator(f'tr[data-row^="found {NEW} "]')
        expect(mine).to_have_count(2)

        # The list leads to the hollow mark, and the full stop makes it a pick of the program.
        mine.first.locator('[name="go"]').click()
        mark = page.locator(f'[data-proposal="{NEW}"]')
        expect(mark).to_have_count(1)
        expect(page.locator(".pane").first).to_have_attribute("data-image", NAMES[1])
        before = len(server.picking.state.picks)
        drawn(page)
        page.keyboard.press(".")
        expect(page.locator(f'.mark.match[data-label="{NEW}"]')).to_have_count(1)
        expect(mine).to_have_count(1)
        assert len(server.picking.state.picks) == before + 1  # and not one more under the pointer
        page.keyboard.press("Control+z")
        expect(mark).to_have_count(1)

        # Refused, it is asked for; what is asked for leads to its place.
        page.keyboard.press("Delete")
        expect(mark).to_have_count(0)
        asked = page.locator(".asked li", has_text=NEW)
        expect(asked).to_contain_text("was refused")
        show_photo(page, 0)
        asked.locator('[name="go"]').first.click()
        expect(page.locator(".pane").first).to_have_attribute("data-image", NAMES[1])
        expect(page.locator(f'[data-predicted="{NEW}"]')).to_have_count(1)

        # All that is left is refused, and that taken back.
        page.locator('[name="refuse-label"]').click()
        expect(mine).to_have_count(0)
        page.locator('#notice [name="offer"]').click()
        expect(mine).to_have_count(1)

        # All of the point that is left, by key.
        page.keyboard.press("Shift+Enter")
        eventually(page, lambda: server.picking.state.pick(NAMES[2], NEW) is not None)
        assert server.picking.state.pick(NAMES[1], NEW) is None
        assert not open_page.errors


def test_rows_that_stay_are_not_made_anew(
    project: tuple[Path, tuple[float, float]], open_page: PageOpener
) -> None:
    path, (u, v) = project
    with served(path) as server:
        page = open_page(server)
        write = page.locator('[name="accept-export"]')
        expect(write).to_be_enabled()
        listed = page.evaluate(f"{LISTED}.map(row => (shown.push(row), row.dataset.row))")
        assert listed.count(None) == len(listed) / 2 > 1  # pictures are beneath
        page.locator('[data-row^="point "] [name="select"]').first.click()  # comes first now
        show_photo(page, 1)
        place(page, NEW, u, v)  # is searched in the other photos
        expect(write).to_be_disabled()
        expect(write).to_be_enabled()
        assert page.evaluate("shown.every(row => row.isConnected)")
        assert not open_page.errors


CUT_OFF = """() => [...document.querySelectorAll("#panel button")]
    .filter((one) => one.getClientRects().length && one.getBoundingClientRect().right > innerWidth)
    .map((one) => one.name)
"""


def test_what_a_find_is_accepted_by_is_in_sight_beside_a_long_label(
    project: tuple[Path, tuple[float, float]], open_page: PageOpener
) -> None:
    path, there = project
    long = "Blockierspur Ende rechts hinten"
    with served(path) as server:
        page = open_page(server, 1024, 700)
        expect(page.locator("#mode")).to_have_attribute("data-mode", "adjusted")
        place(page, long, *there)
        expect(page.locator(f'tr[data-row^="found {long} "]')).to_have_count(2)
        eventually(page, lambda: page.evaluate(CUT_OFF) == [])
        assert not open_page.errors
