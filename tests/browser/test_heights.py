"""Heights on the page: free by one key, told with their sigmas, and seen from the side."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from opened_pages import PageOpener
from picking_pages import eventually, measured, show_photo, wait_until_adjusted
from picking_server import Served, served
from playwright.sync_api import Page, expect

from uavgram.model.message import Correction, Message, Remedy
from uavgram.model.result.reliability import Reason, Verdict
from uavgram.pipeline.pick.live_survey import LiveAdjustment, Observations


@pytest.fixture
def server(data_dir: Path, tmp_path: Path) -> Iterator[Served]:
    """A survey with a flight log, and a point that one photo shows."""
    folder = tmp_path / "survey"
    leave = shutil.ignore_patterns("out", "*.tlog", "measure.csv")
    shutil.copytree(data_dir / "calm_nadir", folder, ignore=leave)
    (folder / "measure.csv").write_text("name,kind,points\nD1,distance,R1;R2\n")
    with (folder / "picks.csv").open("a") as picks:
        picks.write("IMG_0046.jpg,alone,1500.0,1300.0,0.8\n")
    with served(folder / "project.yaml") as running:
        yield running


def choose(page: Page, label: str) -> None:
    """Select a point by its name."""
    page.keyboard.press("/")
    page.keyboard.type(label)
    page.keyboard.press("Enter")


def is_free(server: Served, label: str) -> bool:
    return any(pick.is_free for pick in server.picking.state.picks if pick.label == label)


def test_one_key_frees_a_height_and_the_page_tells_it_or_why_not(
    server: Served, open_page: PageOpener
) -> None:
    page = open_page(server)
    show_photo(page, server.picking.index["IMG_0046.jpg"])
    wait_until_adjusted(page)
    choose(page, "R1")
    page.keyboard.press("q")
    stands = page.get_by_role("status", name="How high it stands")
    expect(stands).to_have_text(
        re.compile(r"^\d\.\d+ m (above|below) the ground, ± [\d.]+ (mm|cm|m)$")
    )
    height = page.get_by_role("radiogroup", name="Height")
    expect(height.get_by_role("radio", name="Free")).to_be_checked()
    expect(page.locator('.mark[data-label="R1"] text')).to_have_text(
        re.compile(r"^R1 [↑↓]\d\.\d+ m")
    )
    assert is_free(server, "R1")
    page.keyboard.press("q")
    expect(height.get_by_role("radio", name="On the ground")).to_be_checked()
    expect(stands).to_be_empty()
    page.keyboard.press("Control+z")
    expect(height.get_by_role("radio", name="Free")).to_be_checked()
    page.get_by_label("Height over ground").fill("0.1")
    page.keyboard.press("Enter")
    page.get_by_label("Uncertainty of the height").fill("0.02")
    page.keyboard.press("Enter")
    expect(height.get_by_role("radio", name="As stated")).to_be_checked()
    eventually(
        page,
        lambda: (
            {
                (pick.height_m, pick.height_sigma_m, pick.is_free)
                for pick in server.picking.state.picks
                if pick.label == "R1"
            }
            == {(0.1, 0.02, False)}
        ),
    )
    choose(page, "alone")
    page.keyboard.press("q")
    expect(stands).to_contain_text("one photo does not tell its height")
    assert not open_page.errors


def test_a_height_that_nobody_stated_is_told_and_freed_by_a_button(
    server: Served, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = server.picking.survey
    adjust = survey.adjust
    text = "Two points fit off the ground."
    told = Message("warning", "point-off-ground", text, labels=("R1",))
    free = Correction(action="free", label="R1")
    mend = Remedy(action="free", words="Free the height of R1", corrections=(free,))
    reason = Reason(cause=told.code, text=text, labels=("R1",), plain=text, mend=mend)
    why = Verdict(level="amber", reasons=(reason,))

    def telling(observed: Observations) -> LiveAdjustment:
        """What tells of heights is tested elsewhere."""
        found = adjust(observed)
        if observed.picks.is_free.any():
            return found
        messages = (*found.result.messages, told)
        result = replace(found.result, messages=messages, verdict=why)
        return replace(found, computed=found.computed._replace(result=result))

    monkeypatch.setattr(survey, "adjust", telling)
    page = open_page(server)
    show_photo(page, server.picking.index["IMG_0046.jpg"])
    choose(page, "alone")
    page.keyboard.press("Shift+Delete")  # a change, so that it is adjusted anew
    expect(page.get_by_role("button", name="Free the height of R1")).to_be_visible()
    choose(page, "R1")
    stands = page.get_by_role("status", name="How high it stands")
    expect(stands).to_contain_text("Nobody said so")
    stands.get_by_role("button", name="Free its height").click()
    expect(stands).to_contain_text("the ground, ±")
    expect(page.get_by_role("button", name="Free the height of R1")).to_have_count(0)
    assert is_free(server, "R1")
    # What rests on a point that is removed everywhere is named.
    page.keyboard.press("Shift+Delete")
    expect(page.locator("#notice")).to_contain_text("went with R1: Undo (Ctrl+Z)")
    assert not open_page.errors


def test_a_profile_and_a_volume_by_keyboard_are_seen_from_the_side(
    server: Served, open_page: PageOpener
) -> None:
    page = open_page(server)
    wait_until_adjusted(page)
    keyboard = page.keyboard
    keyboard.press("9")
    for label in ("R1", "R7", "R2"):
        choose(page, label)
        keyboard.press("Enter")
    keyboard.press("Enter")
    side = page.get_by_role("img", name="PR1 from the side")
    expect(side).to_be_visible()
    expect(side.locator("circle")).to_have_count(3)
    page.get_by_text("Numbers", exact=True).click()
    table = page.get_by_role("table", name="Points from the side")
    expect(table.get_by_role("row")).to_have_count(4)
    assert table.evaluate("box => box.scrollWidth <= box.parentElement.clientWidth")
    keyboard.press("Escape")
    keyboard.press("8")
    for label in ("R1", "R2", "R7", "R4"):
        choose(page, label)
        keyboard.press("Enter")
    keyboard.press("Enter")
    form = page.get_by_role("form", name="New VO1")
    form.get_by_label("Over").select_option("level")
    form.get_by_role("textbox", name="Level").fill("-1,5")
    keyboard.press("Enter")
    eventually(page, lambda: "m³" in measured(page).get("VO1", ""))
    (volume,) = (one for one in server.picking.state.requests if one.name == "VO1")
    assert volume.parameters == (("level", -1.5),)
    keyboard.press("Escape")
    keyboard.press("3")
    choose(page, "R1")
    keyboard.press("Enter")
    keyboard.press("Enter")
    expect(page.get_by_text("not measured").first).to_have_attribute(
        "title", re.compile("'R1' is a point on it")
    )
    page.get_by_role("button", name="Change VO1").click()
    expect(page.get_by_role("img", name="VO1 from the side")).to_be_visible()
    assert not open_page.errors
