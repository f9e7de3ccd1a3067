"""What goes wrong around the page is said on it: photos that go, a program that hangs, a reload."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from opened_pages import PageOpener
from pick_pages import small_project
from picking_pages import eventually, place, show_photo, to_page
from picking_server import served
from playwright.sync_api import Dialog, expect

from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.parse import Message

HANGS_S = 7.0

TURN = """() => {
  document.querySelector('#strip [data-image="1"]').click();
  const {image, pictured, sharp} = document.querySelector('.pane').dataset;
  return {image, pictured, sharp};
}"""


def test_a_photo_that_was_removed_takes_no_click_and_says_so(
    tmp_path: Path, open_page: PageOpener
) -> None:
    with served(small_project(tmp_path, photos=3)) as server:
        page = open_page(server)
        place(page, "A", 100, 100)
        photo = tmp_path / "photos" / "P3.jpg"
        content = photo.read_bytes()
        photo.unlink()
        bar = page.locator("#outside")
        expect(bar).to_contain_text("P3.jpg was changed or removed by another program")
        page.locator('#strip [data-image="2"]').click()
        lost = page.locator(".pane .lost")
        expect(lost).to_contain_text("P3.jpg cannot be shown, so nothing can be clicked in it.")
        for _ in range(2):
            page.mouse.click(*to_page(page, 300, 200))
        page.locator(".pane svg.marks").focus()
        page.keyboard.press("Enter")  # places a point in the middle elsewhere
        expect(page.locator("#notice")).to_contain_text("P3.jpg cannot be shown")
        expect(page.get_by_role("alertdialog")).to_have_count(0)
        show_photo(page, 0)
        expect(lost).to_be_hidden()
        shown_at_once = page.evaluate(TURN)  # the frame in which the former photo is still seen
        assert shown_at_once == {"image": "P2.jpg", "pictured": "false", "sharp": "false"}
        show_photo(page, 0)
        place(page, "B", 200, 100)
        assert {pick.image for pick in server.picking.state.picks} == {"P1.jpg"}

        photo.write_bytes(content)  # it is back
        show_photo(page, 2)
        expect(lost).to_be_hidden()
        place(page, "C", 300, 200)

        photo.unlink()
        bar.get_by_role("button", name="Reload").click()
        page.wait_for_selector('.pane[data-sharp="true"]')
        expect(page.locator("#strip [data-image]")).to_have_count(2)
        assert not [one for one in open_page.errors if "404" not in one]


def test_a_photo_that_is_not_loaded_yet_takes_no_click(
    tmp_path: Path, open_page: PageOpener
) -> None:
    with served(small_project(tmp_path)) as server:
        page = open_page(server)
        tiles = "**/photo/1/*/*/*.jpg*"
        page.route(tiles, lambda _: None)  # no answer
        page.locator('#strip [data-image="1"]').click()
        page.mouse.click(*to_page(page, 300, 200))
        expect(page.locator("#notice")).to_contain_text("P2.jpg is still being loaded")
        page.unroute(tiles)
        page.reload()
        expect(page.locator(".pane").first).to_have_attribute("data-image", "P2.jpg")
        expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
        place(page, "A", 300, 200)
        assert [pick.label for pick in server.picking.state.picks] == ["A"]


def test_a_program_that_hangs_is_told_and_keeps_the_clicks(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(small_project(tmp_path)) as server:
        page = open_page(server)
        change = server.picking.change

        def hang(message: Message) -> m.Changed:
            monkeypatch.undo()
            time.sleep(HANGS_S)
            return change(message)

        monkeypatch.setattr(server.picking, "change", hang)
        for u in (100, 300):
            page.mouse.click(*to_page(page, u, 200))
        bar = page.locator("#outside")
        expect(bar).to_contain_text("The program is not answering.")
        expect(bar).to_contain_text("is not saved yet: this page keeps it")
        expect(bar).to_be_hidden()
        expect(page.locator(".mark.placed")).to_have_count(2)
        assert len(server.picking.state.picks) == 2
        assert not open_page.errors


def test_a_reading_that_is_being_typed_is_not_left_unasked(
    tmp_path: Path, open_page: PageOpener
) -> None:
    with served(small_project(tmp_path)) as server:
        page = open_page(server)
        asked: list[str] = []

        def stay(dialog: Dialog) -> None:
            asked.append(dialog.type)
            dialog.dismiss()

        page.on("dialog", stay)
        page.keyboard.press("l")
        for u in (100, 300):
            page.mouse.click(*to_page(page, u, 200))
        expect(page.locator(".mark.placed")).to_have_count(2)
        page.keyboard.type("12.3")
        page.evaluate("() => void location.reload()")
        eventually(page, lambda: asked == ["beforeunload"])
        expect(page.locator('[name="length_m"]')).to_have_value("12.3")
        page.keyboard.press("Enter")
        expect(page.get_by_label("L1, taped length in m")).to_have_value("12.3")
        page.reload()  # nothing is asked
        assert asked == ["beforeunload"]


DROP = """() => document.body.dispatchEvent(
  new DragEvent("drop", { bubbles: true, cancelable: true, dataTransfer: new DataTransfer() }))"""


def test_an_unusable_file_that_comes_into_an_open_project_is_named(
    tmp_path: Path, open_page: PageOpener
) -> None:
    with served(small_project(tmp_path)) as server:
        page = open_page(server)
        assert page.evaluate(DROP) is False  # the browser does not leave the page
        expect(page.locator("#notice")).to_contain_text("Files dropped here are not taken. Copy")
        (tmp_path / "photos" / "DJI_1.HEIC").write_bytes(b"\x00\x00\x00\x18ftypheic" + bytes(99))
        bar = page.locator("#outside")
        expect(bar).to_contain_text("New beside the photos: DJI_1.HEIC. Passed over: 1 x HEIC")
        expect(bar).to_contain_text("save it as JPEG")
        (tmp_path / "photos" / "DJI_1.HEIC").unlink()
        expect(bar).to_be_hidden()
        assert not open_page.errors
