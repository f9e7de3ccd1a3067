"""A first session by keyboard alone, on a page in which axe finds nothing to keep people out."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from axe_checks import AXE, keeps_out, with_axe
from opened_pages import PageOpener
from picking_pages import measured, wait_until_adjusted, wait_until_pictured
from picking_server import Served, served
from playwright.sync_api import Page, expect


@pytest.fixture
def server(data_dir: Path, tmp_path: Path) -> Iterator[Served]:
    """A flight with its log, in which nothing is picked."""
    folder = tmp_path / "survey"
    leave = shutil.ignore_patterns("out", "*.tlog", "picks.csv", "lines.csv", "measure.csv")
    shutil.copytree(data_dir / "calm_nadir", folder, ignore=leave)
    with served(folder / "project.yaml") as server:
        yield server


@pytest.fixture(params=["light", "dark"])
def page(server: Served, open_page: PageOpener, request: pytest.FixtureRequest) -> Iterator[Page]:
    page = open_page(server)
    page.emulate_media(color_scheme=request.param)
    ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", ground))) > 3 * 128) == (request.param == "light")
    with_axe(page)
    yield page
    assert not open_page.errors


def press(page: Page, *keys: str) -> None:
    for key in keys:
        page.keyboard.press(key)


def name(page: Page, label: str) -> None:
    """Say which point comes next, and do with it what the tool in hand does."""
    press(page, "/")
    page.keyboard.type(label)
    press(page, "Enter", "Enter")


def done(page: Page, count: int) -> None:
    expect(page.locator(".steps summary")).to_have_text(f"First steps: {count} of 4 done")


def test_a_first_session_needs_no_mouse(server: Served, page: Page) -> None:
    done(page, 0)
    assert keeps_out(page) == []
    press(page, "?")
    expect(page.get_by_role("dialog", name="Help")).to_be_visible()
    assert keeps_out(page) == []
    press(page, "Escape")
    expect(page.get_by_role("dialog", name="Help")).to_be_hidden()

    name(page, "A")
    expect(page.locator(".mark[data-label]")).to_have_count(1)
    press(page, *["Control+ArrowRight"] * 3)
    name(page, "B")
    expect(page.locator(".mark[data-label]")).to_have_count(2)
    done(page, 1)
    press(page, "d")
    name(page, "A")
    name(page, "B")
    done(page, 2)
    wait_until_adjusted(page)
    assert re.match(r"\d+\.\d+ \u00b1", measured(page)["D1"])

    press(page, "p", "PageDown")
    wait_until_pictured(page, "IMG_0042")
    name(page, "A")  # in the middle of the photo, where it is not
    expect(page.get_by_role("alertdialog")).to_be_visible()
    assert keeps_out(page) == []
    press(page, "Escape")
    expect(page.get_by_role("alertdialog")).to_have_count(0)
    for label in "AB":
        press(page, "/")
        page.keyboard.type(label)
        press(page, "Enter", "g", "Enter")
        expect(page.locator(f'.mark[data-label="{label}"]')).to_have_count(1)
    done(page, 3)
    press(page, "l")
    name(page, "A")
    name(page, "B")
    expect(page.get_by_role("form", name="New length A to B")).to_be_visible()
    assert keeps_out(page) == []
    page.keyboard.type("12.5")
    press(page, "Enter")
    expect(page.locator(".steps")).to_have_count(0)  # all is done
    wait_until_adjusted(page)
    assert keeps_out(page) == []

    press(page, "Control+z")
    done(page, 3)
    assert [line.name for line in server.picking.state.lines] == []

    if AXE.is_file():  # it can fall
        page.evaluate("const at = document.querySelector('#label'); at.parentNode.replaceWith(at)")
        assert any(found.startswith("label: ") for found in keeps_out(page))
