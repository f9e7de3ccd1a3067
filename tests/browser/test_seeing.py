"""Dark photos can be seen, and the map says which photo was taken where and when."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import eventually
from picking_server import Served, served
from playwright.sync_api import Page, expect

DARK, BRIGHT = 55.0, 75.0  # the middle of the photo is 37, brightened 94
MEAN_GREY = """canvas => {
  const {width, height} = canvas, side = Math.min(width, height) / 2;
  const [left, top] = [(width - side) / 2, (height - side) / 2];
  const {data} = canvas.getContext('2d').getImageData(left, top, side, side);
  let sum = 0;
  for (let k = 0; k < data.length; k += 4) sum += data[k] + data[k + 1] + data[k + 2];
  return sum / (3 * data.length / 4);
}"""


@pytest.fixture
def server(data_dir: Path, tmp_path: Path) -> Iterator[Served]:
    """A flight whose photos are nearly black, with its log; most is picked in the fourth photo."""
    folder = tmp_path / "survey"
    shutil.copytree(data_dir / "cuav", folder, ignore=shutil.ignore_patterns("out"))
    with served(folder / "project.yaml") as running:
        yield running


def grey(page: Page, canvas: str) -> float:
    """How bright a canvas is in its middle."""
    return float(page.locator(canvas).evaluate(MEAN_GREY))


def test_dark_photos_are_seen_and_the_map_leads_from_one_to_another(
    server: Served, open_page: PageOpener
) -> None:
    page = open_page(server)
    pane, control = page.locator(".pane"), page.locator("button.tone")
    photos, state = [photo.name for photo in server.picking.photos], server.picking.state
    expect(pane).to_have_attribute("data-image", photos[3])
    expect(control).to_contain_text("Brightened for display")
    eventually(page, lambda: grey(page, "canvas.photo") > BRIGHT)
    pane.hover(position={"x": 250, "y": 450})  # away from the dark spot in its middle
    expect(page.locator(".loupe")).to_be_visible()
    eventually(page, lambda: grey(page, ".loupe") > BRIGHT)

    page.keyboard.press("0")
    expect(control).not_to_contain_text("display")
    eventually(page, lambda: grey(page, "canvas.photo") < DARK and grey(page, ".loupe") < DARK)
    control.click()
    expect(page.get_by_role("button", name="As it is")).to_have_attribute("aria-pressed", "true")
    page.get_by_label("Brightness", exact=True).press("End")
    expect(control).to_contain_text("Changed for display")
    eventually(page, lambda: grey(page, "canvas.photo") > BRIGHT)
    page.keyboard.press("Escape")
    expect(page.get_by_label("Brightness", exact=True)).to_be_hidden()

    page.get_by_role("tab", name="Photos").click()
    dots = page.locator(".map button")
    expect(dots).to_have_count(len(photos))
    dots.nth(1).press("Enter")
    expect(pane).to_have_attribute("data-image", photos[1])
    expect(dots.nth(1)).to_have_attribute("aria-current", "true")
    expect(dots.nth(1)).to_have_accessible_name(re.compile(rf"^{photos[1]}, 01:00:50\.9 UTC$"))
    expect(control).to_contain_text("Brightened for display")
    page.get_by_role("button", name=f"{photos[3]},").first.click()
    expect(control).to_contain_text("Changed for display")
    assert server.picking.state == state
    assert not open_page.errors
    assert not open_page.strangers
