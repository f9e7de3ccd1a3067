"""Numbers while an adjustment takes long: first order where that says enough, grey where not."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from large_photos import write_large_project
from opened_pages import PageOpener
from picking_pages import eventually, measured, to_page, wait_until_adjusted
from picking_server import Served, served
from playwright.sync_api import expect
from unsure import unsure

from uavgram.pipeline.pick.live_survey import LiveAdjustment, Observations

GREY = 'body[data-numbers="old"]'
ADJUSTED = '#mode[data-mode="adjusted"]'


Slow = tuple[Served, threading.Event]


@pytest.fixture
def slow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Slow]:
    """A server whose full adjustments wait, from when `hold` is cleared until it is set again."""
    project = write_large_project(tmp_path, 1600, 1200, labels=25)
    with served(project) as server:
        survey, hold = server.picking.survey, threading.Event()
        hold.set()
        adjust = survey.adjust

        def held(observed: Observations) -> LiveAdjustment:
            hold.wait(60)
            return adjust(observed)

        monkeypatch.setattr(survey, "adjust", held)
        yield server, hold
        hold.set()


def test_a_drag_moves_the_numbers_while_a_full_adjustment_takes_its_time(
    slow: Slow, open_page: PageOpener
) -> None:
    server, hold = slow
    page = open_page(server)
    wait_until_adjusted(page)
    before = measured(page)["D1"]
    pick = server.picking.state.pick("photo0.jpg", "P1")
    assert pick is not None
    x, y = to_page(page, pick.u_px, pick.v_px)
    hold.clear()
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 9, y)  # the first answer to a drag may be the full one, and waits now
    page.wait_for_timeout(50)
    for k in range(10, 30):
        page.mouse.move(x + k, y)
        page.wait_for_timeout(20)
    page.wait_for_selector('#mode[data-mode="linearised"]')
    first = measured(page)["D1"]
    assert first != before
    expect(page.locator("body")).to_have_attribute("data-numbers", "first-order")
    expect(page.locator("#verdict")).to_have_attribute("data-level", "none")
    page.mouse.move(x + 60, y)
    eventually(page, lambda: measured(page)["D1"] != first)
    hold.set()
    page.mouse.up()
    wait_until_adjusted(page)
    assert not open_page.errors


def test_numbers_are_grey_until_they_belong_to_what_is_picked(
    slow: Slow, open_page: PageOpener
) -> None:
    server, hold = slow
    page = open_page(server)
    page.emulate_media(color_scheme="dark")
    wait_until_adjusted(page)
    hold.clear()
    page.locator("#label").fill("New")
    page.mouse.click(*to_page(page, 700.0, 500.0))
    page.wait_for_selector(GREY)  # no first order: there is a point more than there was
    color = page.locator("td.value").first.evaluate("cell => getComputedStyle(cell).color")
    assert re.fullmatch(r"rgb\(17\d, 17\d, 18\d\)", color)
    hold.set()
    page.wait_for_selector(GREY, state="detached")
    page.wait_for_selector(ADJUSTED)
    assert not open_page.errors


def test_a_value_that_another_solution_changes_shows_the_other_one_beside_it(
    slow: Slow, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, _ = slow
    survey, adjust = server.picking.survey, server.picking.survey.adjust

    def ambiguous(observed: Observations) -> LiveAdjustment:
        adjusted = adjust(observed)
        result = unsure(adjusted.result, "D1", (12.3456, 45.6789))
        return replace(adjusted, computed=adjusted.computed._replace(result=result))

    monkeypatch.setattr(survey, "adjust", ambiguous)
    page = open_page(server)
    page.locator("#label").fill("New")
    page.mouse.click(*to_page(page, 700.0, 500.0))
    row = page.locator('[data-row="measure D1"]')
    expect(row).to_contain_text(re.compile(r"m\s*or 12\.\d+, 45\.\d+"))
    other = page.locator('table[aria-label="Measurements"] tr[data-row]').nth(1)
    expect(other).not_to_contain_text(" or ")
    assert not open_page.errors
