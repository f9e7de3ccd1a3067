"""What a person does on the picking page, as functions of a Playwright page."""

from __future__ import annotations

import re
import time
from collections.abc import Callable

from playwright.sync_api import Locator, Page, expect

LONGEST_WAIT_S = 60.0


class Counted:
    """A person's hands on a page: counts clicks and keys, a key that is held as well.

    Attributes
    ----------
    count
        Clicks and keys, without those of numbers.
    typed
        Keys of numbers.
    """

    def __init__(self, page: Page) -> None:
        self.count, self.typed, self._page = 0, 0, page

    def click(self, x: float, y: float) -> None:
        self._page.mouse.click(x, y)
        self.count += 1

    def press(self, button: Locator) -> None:
        """Click what has a name."""
        button.click()
        self.count += 1

    def key(self, name: str) -> None:
        self._page.keyboard.press(name)
        self.count += len(name.split("+"))

    def digits(self, text: str) -> None:
        self._page.keyboard.type(text)
        self.typed += len(text)


def drawn(page: Page) -> None:
    """Wait until what the last key or move asked for is drawn, however busy the machine is."""
    page.evaluate(
        "() => new Promise(then => requestAnimationFrame(() => requestAnimationFrame(then)))"
    )


def to_page(page: Page, u: float, v: float) -> tuple[float, float]:
    """CSS pixel of the page at which the first pane says that a pixel of the photo is."""
    drawn(page)
    box = page.locator(".pane svg.marks").first.bounding_box()
    assert box is not None
    data = page.locator(".pane").first.evaluate("pane => ({...pane.dataset})")
    left, top, scale = (float(data[name]) for name in ("left", "top", "scale"))
    return box["x"] + (u + 0.5 - left) * scale, box["y"] + (v + 0.5 - top) * scale


def eventually(page: Page, holds: Callable[[], bool]) -> None:
    """Wait for what comes to be by itself."""
    until = time.monotonic() + LONGEST_WAIT_S
    while not holds():
        assert time.monotonic() < until, f"it did not come about within {LONGEST_WAIT_S} s"
        page.wait_for_timeout(50)


def show_photo(page: Page, number: int) -> None:
    """Choose a photo in the strip and wait until it is sharp."""
    page.locator(f'#strip [data-image="{number}"]').click()
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")


def place(page: Page, label: str, u: float, v: float) -> None:
    """Name a point and click it in the photo that is shown."""
    page.locator("#label").fill(label)
    page.mouse.click(*to_page(page, u, v))
    expect(page.locator(f'.mark[data-label="{label}"]')).to_have_count(1)


def click_mark(page: Page, label: str) -> None:
    """Click the middle of a mark."""
    mark = page.locator(f'.mark[data-label="{label}"]')
    x, y = (float(part) for part in re.findall(r"[-\d.]+", mark.get_attribute("transform") or ""))
    box = page.locator(".pane svg.marks").first.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + x, box["y"] + y)


def wait_until_adjusted(page: Page) -> None:
    """Wait for a full adjustment of the state as it is."""
    expect(page.locator("#mode")).to_have_attribute("data-mode", "adjusted")
    expect(page.locator("body")).to_have_attribute("data-numbers", "current")


def wait_until_pictured(page: Page, photo: str) -> None:
    """Wait until a photo can be seen: a click before that marks nothing."""
    expect(page.locator(f'[data-image^="{photo}"][data-pictured="true"]')).to_be_visible()


def measured(page: Page) -> dict[str, str]:
    """Values as the page shows them, by the names of the measurements."""
    rows = page.locator('table[aria-label="Measurements"] tr[data-row]')
    found = rows.evaluate_all("all => all.map(row => [row.dataset.row, row.cells[1].innerText])")
    return {name.removeprefix("measure "): value for name, value in found}
