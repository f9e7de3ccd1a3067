"""The round in which points are clicked again: no mark is shown, and each click is a second row."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from csv_rows import read_rows
from large_photos import write_large_project
from opened_pages import PageOpener
from picking_pages import eventually, place, to_page, wait_until_adjusted
from picking_server import served
from playwright.sync_api import Locator, Page, expect

from uavgram.model.result.reliability import Reason, Verdict
from uavgram.model.result.result import Result
from uavgram.picking.session.session import PickSession
from uavgram.pipeline.pick.live_survey import LiveAdjustment, Observations

LOADED = "all => all.length > 0 && all.every(one => one.naturalWidth > 0)"
MIDDLE = """box => {
  const tile = box.querySelector("img");
  const [, column, row] = /(\\d+)\\/(\\d+)\\.jpg/.exec(tile.src);
  const at = (number, offset, side) => number * 512 - parseFloat(offset) + side / 2 - 0.5;
  return [at(column, tile.style.left, box.clientWidth), at(row, tile.style.top, box.clientHeight)];
}"""
"""The pixel of the photo in the middle of a small picture, by its first tile."""

PLACES = {"New": (700.0, 500.0), "Other": (900.0, 640.0)}


def unchecked(result: Result) -> Result:
    """Two points are clicked once."""
    reason = Reason(
        cause="nothing-checks",
        text="'D1' is not checked: a wrong click on New or Other would not be noticed.",
        plain="Not checked: mark New and Other in one more photo, or click them again.",
        labels=tuple(PLACES),
        measurements=("D1",),
    )
    return replace(result, verdict=Verdict(level="amber", reasons=(reason,)))


def leave_unchecked(picking: PickSession, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each adjustment of a session end with the two points that nothing checks."""
    adjust = picking.survey.adjust

    def adjusted(observed: Observations) -> LiveAdjustment:
        found = adjust(observed)
        return replace(found, computed=found.computed._replace(result=unchecked(found.result)))

    monkeypatch.setattr(picking.survey, "adjust", adjusted)


def check_picture(page: Page, label: str) -> None:
    """The surroundings of the first click are shown, without its mark and not quite around it."""
    crop = page.locator("#notice").get_by_role("img", name=f"Surroundings of {label}")
    expect(crop).to_be_visible()
    side = crop.evaluate("box => getComputedStyle(box, '::after').content")
    assert side in {"none", "normal"}  # no ring in its middle
    eventually(page, lambda: bool(crop.locator("img").evaluate_all(LOADED)))
    u, v = crop.evaluate(MIDDLE)
    away = max(abs(u - PLACES[label][0]), abs(v - PLACES[label][1]))
    assert 0.0 < away < 10.0
    page.mouse.click(*centre(crop))  # is no click in the photo
    expect(page.locator("#notice")).to_contain_text(f"Click {label} again")


def centre(crop: Locator) -> tuple[float, float]:
    box = crop.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_each_point_is_shown_without_a_mark_and_its_second_click_is_kept(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = write_large_project(tmp_path, 1600, 1200, labels=25)
    with served(project) as server:
        leave_unchecked(server.picking, monkeypatch)
        page = open_page(server)
        for label, at in PLACES.items():
            place(page, label, *at)
            page.keyboard.press("Escape")
        wait_until_adjusted(page)
        marks = page.locator(".pane svg.marks > *")
        again = page.get_by_role("button", name="Click again")
        expect(page.locator("#first")).to_contain_text("Not checked: mark New and Other")
        again.click()
        for label, (u, v) in PLACES.items():
            expect(page.locator("#notice")).to_contain_text(f"Click {label} again")
            expect(marks.locator("visible=true")).to_have_count(0)
            check_picture(page, label)
            page.mouse.click(*to_page(page, u + 1.0, v - 1.0))
        expect(page.locator("#notice")).to_contain_text("All were clicked again")
        expect(page.locator('.mark[data-label="New"]')).to_be_visible()

        def rows() -> list[tuple[str, float, float]]:
            found = [row for row in read_rows(tmp_path / "picks.csv") if row["label"] in PLACES]
            return [(row["label"], float(row["u_px"]), float(row["v_px"])) for row in found]

        eventually(page, lambda: len(rows()) == 4)
        for label, (u, v) in PLACES.items():
            first, second = [row[1:] for row in rows() if row[0] == label]
            assert first == pytest.approx((u, v), abs=1.0)
            assert second == pytest.approx((u + 1.0, v - 1.0), abs=1.0)
            assert second != first
        wait_until_adjusted(page)
        again.click()  # nothing is left to be clicked again
        expect(page.locator('.mark[data-label="New"]')).to_be_visible()
        page.keyboard.press("Control+z")
        eventually(page, lambda: len(rows()) == 3)
        assert not open_page.errors


def test_a_second_click_far_from_the_first_is_asked_about_and_taken_back(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(write_large_project(tmp_path, 1600, 1200, labels=25)) as server:
        leave_unchecked(server.picking, monkeypatch)
        page = open_page(server)
        u, v = PLACES["New"]
        place(page, "New", u, v)
        page.keyboard.press("Escape")
        wait_until_adjusted(page)
        page.get_by_role("button", name="Click again").click()
        question = page.get_by_role("alertdialog")

        def rows() -> list[tuple[float, float]]:
            found = [row for row in read_rows(tmp_path / "picks.csv") if row["label"] == "New"]
            return [(float(row["u_px"]), float(row["v_px"])) for row in found]

        expect(page.get_by_label("Label", exact=True).first).to_have_value("New")
        expect(page.locator("p.hint")).to_contain_text("Next click: marks New once more")
        page.mouse.click(*to_page(page, u + 80.0, v - 60.0))
        expect(question).to_contain_text("This click is 100 px from your first one on New")
        question.get_by_role("button", name="Take it back").click()
        expect(question).to_have_count(0)
        expect(page.locator("#notice")).to_contain_text("Click New again")
        assert len(rows()) == 1
        page.mouse.click(*to_page(page, u + 80.0, v - 60.0))
        question.get_by_role("button", name="New is here").click()
        eventually(page, lambda: rows() == [pytest.approx((u + 80.0, v - 60.0), abs=1.0)])
        assert not open_page.errors


def test_escape_ends_the_round(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(write_large_project(tmp_path, 1600, 1200, labels=25)) as server:
        leave_unchecked(server.picking, monkeypatch)
        page = open_page(server)
        place(page, "New", *PLACES["New"])
        page.keyboard.press("Escape")
        wait_until_adjusted(page)
        page.get_by_role("button", name="Click again").click()
        expect(page.locator('.mark[data-label="New"]')).to_be_hidden()
        page.keyboard.press("Shift+T")  # says something else for a while
        expect(page.locator("#notice")).not_to_contain_text("Click New again")
        expect(page.locator("#notice")).to_contain_text("Click New again")
        for key in ("s", "d", "Delete", "Enter", "."):  # are no second click, and end nothing
            page.keyboard.press(key)
        expect(page.locator("#notice")).to_contain_text("Click New again")
        expect(page.locator('[data-tool="pick"]')).to_be_checked()
        rows = read_rows(tmp_path / "picks.csv")
        assert [row["label"] for row in rows].count("New") == 1
        page.keyboard.press("Escape")
        expect(page.locator("#notice")).to_be_hidden()
        expect(page.locator('.mark[data-label="New"]')).to_be_visible()
        assert not open_page.errors
