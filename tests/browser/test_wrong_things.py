"""What goes wrong on site: the light, the rows and the button that writes say so."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from opened_pages import PageOpener
from picking_pages import eventually, wait_until_adjusted
from picking_server import Served, served
from playwright.sync_api import Browser, Locator, Page, expect

from uavgram.synthetic.demo import write_demo
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import simulate

Change = dict[str, Any]
PHOTO = "IMG_0006.jpg"

ANOTHER_TAB = """(change) => new Promise((done) => {
    const key = sessionStorage.getItem("uavgram-key");
    const socket = new WebSocket(`ws://${location.host}/socket?tab=${key}`);
    socket.onopen = () => socket.send(JSON.stringify({...change, seq: 1}));
    socket.onmessage = ({data}) => {
        const answer = JSON.parse(data);
        if (answer.seq !== 1) return;
        socket.close();
        done(answer);
    };
})"""


@dataclass(frozen=True)
class Site:
    """The built-in survey on the page."""

    server: Served
    page: Page
    opener: PageOpener

    def tell(self, change: Change) -> None:
        """Make a change as another tab would, and wait until this page has its verdict."""
        answer = self.page.evaluate(ANOTHER_TAB, change)
        assert answer["t"] == "changed", answer
        self.judged(answer["version"])

    def judged(self, version: int) -> None:
        body = self.page.locator("body")
        expect(body).to_have_attribute("data-live-for", f"{version}")
        wait_until_adjusted(self.page)

    def row(self, name: str) -> Locator:
        return self.page.locator(f'[data-row="{name}"]')

    def place(self, image: str, label: str, by_px: float = 0.0) -> Change:
        """A pick as it is, moved sideways."""
        pick = self.server.picking.state.pick(image, label)
        assert pick is not None
        number = self.server.picking.index[image]
        at = {"u_px": pick.u_px + by_px, "v_px": pick.v_px}
        return {"t": "place", "image": number, "label": label, **at}

    def length(self, name: str, length_m: float) -> Change:
        """A known length that reads otherwise."""
        line = next(one for one in self.server.picking.state.lines if one.name == name)
        return {"t": "line", **vars(line), "was": name, "length_m": round(length_m, 4)}

    def reading(self, name: str) -> float:
        return next(one.length_m for one in self.server.picking.state.lines if one.name == name)


def write_site(folder: Path) -> Path:
    """The built-in survey with grey photos: what they show is looked for elsewhere."""
    survey = simulate(Scenario())
    size = (survey.calibration.height_px, survey.calibration.width_px)
    blank = np.full(size, 128, np.uint8)
    write_demo(folder, survey, (blank for _ in survey.frame_id))
    return folder / "project.yaml"


@pytest.fixture(scope="module")
def opened_once(chromium: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    opener = PageOpener(chromium)
    with served(write_site(tmp_path_factory.mktemp("site"))) as server:
        yield Site(server, opener(server), opener)
        opener.close()


@pytest.fixture
def site(opened_once: Site) -> Iterator[Site]:
    """In order; and what was done is taken back."""
    site, before = opened_once, opened_once.server.picking.state
    wait_until_adjusted(site.page)
    says(site.page, "green", "In order", "Write results")
    yield site
    while site.server.picking.state != before:
        site.tell({"t": "undo"})
    assert not site.opener.errors


def says(page: Page, level: str, light: str, button: str) -> None:
    """The light, the values' colour and the button that writes are of one mind."""
    expect(page.locator("#verdict")).to_have_attribute("data-level", level)
    expect(page.locator("body")).to_have_attribute("data-level", level)
    expect(page.locator("#light")).to_have_text(re.compile(f"^{light}"))
    expect(page.get_by_role("button", name=button)).to_have_attribute("data-level", level)


FAULT = re.compile("doubtful|contradicted")


def test_the_same_label_at_another_place(site: Site) -> None:
    site.tell(site.place(PHOTO, "P5", by_px=150.0))

    says(site.page, "amber", "Check: ", "Write results, with 1 warning")
    expect(site.page.locator("#first")).to_contain_text("P5")
    expect(site.row("point P5")).to_have_attribute("data-status", FAULT)
    expect(site.row("point R1")).to_have_attribute("data-status", "ok")


def test_labels_swapped_among_many_are_named_and_put_right_by_a_button(site: Site) -> None:
    page, number = site.page, site.server.picking.index[PHOTO]
    right = site.server.picking.state
    site.tell({"t": "swap", "image": number, "label": "P5", "other": "P13"})
    swapped = site.server.picking.state.picks
    expect(page.locator("#verdict")).to_have_attribute("data-level", re.compile("amber|red"))
    expect(page.locator("#first")).to_contain_text(re.compile("P5.*P13|P13.*P5"))
    for row in ("point P5", "measure car to car"):
        expect(site.row(row)).to_have_attribute("data-status", FAULT)
    strip = page.locator(f'#strip [data-image="{number}"]')
    expect(strip).to_have_attribute("data-status", FAULT)
    page.locator("#first").get_by_role("button", name="Show me").click()
    mark = page.locator('.mark[data-label="P5"], .mark[data-label="P13"]').first
    expect(mark).to_have_class(re.compile("suspect"))
    page.locator('#first [name="mend"]').first.dblclick()  # which is no two swaps
    says(page, "green", "In order", "Write results")
    assert {pick.key: pick for pick in site.server.picking.state.picks} == {
        pick.key: pick for pick in right.picks
    }
    page.get_by_role("alert").get_by_role("button", name="Undo").click()
    eventually(page, lambda: site.server.picking.state.picks == swapped)


def test_a_length_in_feet(site: Site) -> None:
    site.tell(site.length("L1", site.reading("L1") / 0.3048))

    says(site.page, "amber", "Check: ", "Write results, with 1 warning")
    expect(site.page.locator("#first")).to_contain_text(re.compile("L1.* feet"))
    expect(site.row("line L1")).to_have_attribute("data-status", FAULT)
    expect(site.row("line L3")).to_have_attribute("data-status", "ok")


def test_a_reading_that_is_off_by_a_decimetre(site: Site) -> None:
    expect(site.page.get_by_role("table", name="Known lengths")).to_contain_text(
        re.compile(
            r"a tape misread by less than \d\.\d cm would not be noticed; it would make "
            r".* wrong by up to 0\.\d\d m"
        )
    )
    site.tell(site.length("L2", site.reading("L2") + 0.1))

    says(site.page, "amber", "Check: ", "Write results, with 1 warning")
    expect(site.row("line L2")).to_have_attribute("data-status", FAULT)
    expect(site.row("line L2").locator(".is-doubtful")).to_have_count(2)
    first = site.page.locator("#first")
    expect(first).to_contain_text("L2")
    first.get_by_role("button", name="Remove the length L2").click()
    says(site.page, "green", "In order", "Write results")


def test_labels_swapped_where_little_tells_are_never_in_order(site: Site) -> None:
    index, state = site.server.picking.index, site.server.picking.state
    others = [
        {"t": "unpick", "image": index[pick.image], "label": pick.label}
        for pick in state.picks
        if pick.image != PHOTO
    ]
    swap = {"t": "swap", "image": index[PHOTO], "label": "P5", "other": "P7"}
    site.tell({"t": "all", "changes": [*others, swap]})

    expect(site.page.locator("#verdict")).to_have_attribute("data-level", re.compile("amber|red"))
    expect(site.page.locator("#light")).to_have_text(re.compile("^(Check|Do not use): "))
    expect(site.row("measure car to car")).to_have_attribute("data-status", re.compile("not|doubt"))
    expect(site.row("point P5")).to_have_attribute("data-status", re.compile("not|doubt"))


def test_two_tabs_have_one_light(site: Site) -> None:
    second = site.opener(site.server)
    site.tell(site.length("L2", site.reading("L2") + 0.1))

    for page in (site.page, second):
        expect(page.locator("#verdict")).to_have_attribute("data-level", re.compile("amber|red"))
        expect(page.locator('[data-row="line L2"]')).to_have_attribute("data-status", FAULT)
    assert second.locator("#light").inner_text() == site.page.locator("#light").inner_text()
    second.context.close()


def test_a_page_that_is_closed_while_it_writes_comes_back_with_the_same_light(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, may_end = threading.Event(), threading.Event()

    def run() -> None:
        begun.set()
        may_end.wait(60)

    monkeypatch.setattr(site.server.pick.project, "_run", run)
    site.tell(site.length("L2", site.reading("L2") + 0.1))
    leaving = site.opener(site.server)
    leaving.get_by_role("button", name="Write results, with 1 warning").click()
    assert begun.wait(60)
    leaving.context.close()
    back = site.opener(site.server)
    wait_until_adjusted(back)

    says(back, "amber", "Check: ", "Write results, with 1 warning")
    expect(back.locator('[data-row="line L2"]')).to_have_attribute("data-status", FAULT)
    may_end.set()
    back.context.close()


def test_without_the_program_nothing_is_in_order(tmp_path: Path, open_page: PageOpener) -> None:
    with served(write_site(tmp_path / "site")) as server:
        page = open_page(server)
        value = page.locator("td.value > span").first
        wait_until_adjusted(page)
        says(page, "green", "In order", "Write results")
        before = value.evaluate("one => getComputedStyle(one).color")

    says(page, "none", "Not checked: no connection", "Nothing can be written")
    expect(page.locator("body")).to_have_attribute("data-numbers", "lost")
    expect(value).not_to_have_css("color", before)
    expect(value).to_have_css("font-style", "italic")


def test_a_photo_that_is_lost_while_the_page_is_open_can_be_left_out_there(
    tmp_path: Path, open_page: PageOpener
) -> None:
    with served(write_site(tmp_path / "site")) as server:
        page = open_page(server)
        wait_until_adjusted(page)
        lost = next(
            path for path in sorted((tmp_path / "site").rglob("IMG_*")) if path.name != PHOTO
        )
        lost.unlink()
        page.keyboard.press("w")
        way_out = page.get_by_role("button", name=f"Leave {lost.name} out").first
        expect(way_out).to_be_visible()
        expect(page.locator("#notice")).not_to_contain_text("leave_out")
        way_out.click()
        eventually(page, lambda: lost.name in server.picking.survey.inputs.project.leave_out)
        wait_until_adjusted(page)
