"""The light, the rows and the drawing say what the server judged, and nothing of their own."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from large_photos import write_large_project
from opened_pages import PageOpener
from picking_pages import eventually, place, wait_until_adjusted
from picking_server import Served, served
from playwright.sync_api import Locator, Page, expect
from standings import with_status

from uavgram.model.message import Correction, Message, Remedy, propose_photo_removal
from uavgram.model.result.reliability import Reason, Verdict
from uavgram.model.result.result import Result
from uavgram.pipeline.pick.live_survey import LiveAdjustment, Observations

SWAPPED = Reason(
    cause="labels-swapped",
    text="P1 and P2 seem to be swapped in photo0.jpg: swap them there.",
    frames=("photo0.jpg",),
    labels=("P1", "P2"),
)
IN_SIGHT = "row => row.getBoundingClientRect().bottom < 600"
MANY = tuple(Message("warning", "frame-left-out", f"Photo {k} was left out.") for k in range(30))


def contradicted(result: Result) -> Result:
    red = Verdict(level="red", reasons=(SWAPPED,))
    found = with_status(result, "contradicted", "doubtful", "not-checked", "ok")
    return replace(found, verdict=red, messages=MANY)


def in_order(result: Result) -> Result:
    return replace(with_status(result, "ok"), verdict=Verdict(level="green"), messages=())


def row(page: Page, name: str) -> Locator:
    """Row of a measurement."""
    return page.locator(f'[data-row="measure {name}"]')


def one_length_off(result: Result) -> Result:
    again = Remedy(
        action="read",
        words="Read L2 again",
        corrections=(Correction(action="read", length="L2"),),
    )
    out = Remedy(
        action="remove-length",
        words="Remove the length L2",
        corrections=(Correction(action="remove-length", length="L2"),),
    )
    off = Reason(cause="line-suspect", text="L2 does not fit.", lengths=("L2",), mend=again)
    amber = Verdict(level="amber", reasons=(replace(off, instead=(out,)),))
    return replace(with_status(result, "ok"), verdict=amber, messages=())


def change_results(
    monkeypatch: pytest.MonkeyPatch, server: Served, change: Callable[[Result], Result]
) -> None:
    """Let each adjustment of the page have a changed result."""
    survey, adjust = server.picking.survey, server.picking.survey.adjust

    def adjusted(observed: Observations) -> LiveAdjustment:
        found = adjust(observed)
        return replace(found, computed=found.computed._replace(result=change(found.result)))

    monkeypatch.setattr(survey, "adjust", adjusted)


def test_a_length_that_does_not_fit_is_read_again_before_it_is_removed(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(write_large_project(tmp_path, 1600, 1200, labels=25)) as server:
        change_results(monkeypatch, server, one_length_off)
        page = open_page(server)
        place(page, "New", 700.0, 500.0)
        buttons = page.locator("#first button")
        expect(buttons).to_have_text(["Read L2 again", "Show me", "Remove the length L2"])
        expect(buttons.first).to_have_class("main")
        wait_until_adjusted(page)
        buttons.first.click()
        expect(page.get_by_role("form", name="Change length P3 to P4")).to_be_visible()
        expect(page.get_by_label("Length, metres")).to_be_focused()
        assert not open_page.errors


def test_the_light_the_rows_and_the_drawing_follow_the_verdict(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(write_large_project(tmp_path, 1600, 1200, labels=25)) as server:
        survey, adjust = server.picking.survey, server.picking.survey.adjust
        judged = contradicted

        def adjusted(observed: Observations) -> LiveAdjustment:
            """What passes the verdict is tested elsewhere."""
            found = adjust(observed)
            return replace(found, computed=found.computed._replace(result=judged(found.result)))

        monkeypatch.setattr(survey, "adjust", adjusted)
        page = open_page(server)
        place(page, "New", 700.0, 500.0)
        light, why = page.locator("#light"), page.locator("#why")
        expect(light).to_have_text("Do not use: it does not fit together")
        expect(page.locator("#verdict")).to_have_attribute("data-level", "red")
        expect(page.locator("#first")).to_contain_text(SWAPPED.text)
        for name, status in zip(
            ("D1", "D2", "D3", "D4"), ("contradicted", "doubtful", "doubtful", ""), strict=True
        ):
            expect(row(page, name)).to_have_attribute("data-status", status)
            expect(row(page, name).get_by_role("img")).to_have_count(1 if status else 0)
        value = page.locator('[data-row="measure D1"] .is-contradicted')
        assert value.evaluate("one => getComputedStyle(one).textDecorationLine") == "line-through"
        expect(page.locator("g.measured.contradicted text")).to_contain_text("(contradicted)")
        expect(page.locator('.mark.suspect[data-label="P1"]')).to_have_count(1)
        expect(page.locator('[data-row="measure D1"] .standing')).to_have_attribute(
            "title", re.compile(re.escape(SWAPPED.text))
        )
        assert not page.get_by_text("Photo 3 was left out.").is_visible()
        page.keyboard.press("Escape")  # the form of the new point stood over the numbers
        for opened in (False, True):  # thirty warnings, and the numbers are in sight
            if opened:
                why.locator("summary").click()
                expect(why.get_by_role("listitem")).to_have_count(len(MANY))
            eventually(page, lambda: row(page, "D3").evaluate(IN_SIGHT))

        judged = in_order
        page.keyboard.press("Control+z")
        expect(light).to_contain_text("In order: all")
        wait_until_adjusted(page)
        table = page.get_by_role("table", name="Measurements")
        expect(table.locator(".standing, .is-contradicted, .is-doubtful")).to_have_count(0)
        expect(page.locator("#first")).to_contain_text("Only large mistakes would be noticed")
        expect(why).to_be_hidden()
        assert not open_page.errors


def swapped_in_either(result: Result) -> Result:
    """Two swaps, of which one is right."""
    swaps = tuple(
        Remedy(
            action="swap",
            words=f"Swap P1 and P2 in {photo}",
            corrections=(Correction(action="swap", frame=photo, label="P1", other="P2"),),
        )
        for photo in ("photo0.jpg", "photo1.jpg")
    )
    amber = Verdict(level="amber", reasons=(replace(SWAPPED, mend=swaps[0], instead=swaps[1:]),))
    return replace(with_status(result, "ok"), verdict=amber, messages=())


def test_two_swaps_are_told_apart_by_pictures_of_all_places(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(write_large_project(tmp_path, 1600, 1200, labels=25)) as server:
        change_results(monkeypatch, server, swapped_in_either)
        page = open_page(server)
        place(page, "New", 700.0, 500.0)
        compared = page.locator("#first .compared")
        expect(compared).to_contain_text("Only one of these is right. Compare the places")
        names = [f"{label} in photo{k}.jpg" for label in ("P1", "P2") for k in (0, 1)]
        for name in names:
            expect(compared.get_by_role("img", name=name, exact=True)).to_have_count(1)
        assert not open_page.errors


def two_ways_out(result: Result) -> Result:
    """A photo of another place, and a camera that hung otherwise than stated."""
    elsewhere = Reason(
        cause="photo-elsewhere",
        text="The photo 'photo0.jpg' shows another place.",
        plain="photo0 shows another place.",
        frames=("photo0.jpg",),
        instead=(propose_photo_removal("photo0.jpg"),),
    )
    turned = Reason(cause="gimbal-off", text="The camera is turned: check `mount`.")
    amber = Verdict(level="amber", reasons=(elsewhere, turned))
    return replace(with_status(result, "ok"), verdict=amber, messages=())


def test_a_photo_is_left_out_and_the_set_up_opened_by_buttons_of_the_verdict(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(write_large_project(tmp_path, 1600, 1200, labels=25)) as server:
        change_results(monkeypatch, server, two_ways_out)
        page = open_page(server)
        place(page, "New", 700.0, 500.0)
        wait_until_adjusted(page)
        expect(page.locator("#first button")).to_have_text(["Show me", "Leave photo0 out"])
        expect(page.locator("#first")).to_contain_text("Look whether the photo belongs")
        page.locator("#why summary").click()
        set_up = page.locator("#reasons").get_by_role("button", name="Open the set-up")
        expect(set_up).to_be_enabled()
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.keyboard.press("Escape")  # the form of the new point
        set_up.click()
        eventually(page, lambda: any("/door/close?to=setup" in url for url in asked))
        doubt = page.locator("#setup .mount").get_by_role("alert")
        expect(doubt).to_contain_text("The camera is turned")  # at the field that it means
