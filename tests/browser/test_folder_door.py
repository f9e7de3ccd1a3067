"""The door of the page: by keyboard, for who sees little, and when something is in the way."""

from __future__ import annotations

import asyncio
import errno
import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
import pytest
from axe_checks import keeps_out, with_axe
from opened_pages import PageOpener
from pick_pages import small_project
from picking_pages import eventually, place
from picking_server import Served, served
from playwright.sync_api import Page, expect

from uavgram.config.project import load_project
from uavgram.imaging.photos.tiles import TiledPhotos
from uavgram.picking.session.folder_chooser import FolderChooser
from uavgram.picking.web.server import PickServer


@pytest.fixture
def home(tmp_path: Path) -> Path:
    home = tmp_path / "home"
    small_project(home / "flight")
    (home / "flight" / "project.yaml").unlink()
    (home / "nothing").mkdir()
    (home / "nothing" / "DJI_0001.MP4").write_bytes(b"x")
    return home


@pytest.fixture
def server(home: Path) -> Iterator[Served]:
    with served(None, FolderChooser(roots=(home,))) as server:
        yield server


@pytest.fixture
def page(server: Served, open_page: PageOpener) -> Iterator[Page]:
    page = open_page(server, 1280, 800)
    with_axe(page)
    yield page
    assert not [one for one in open_page.errors if "409" not in one]
    assert not open_page.strangers


def tab_to(page: Page, name: str) -> None:
    """Go to a button by Tab alone."""
    for _ in range(60):
        page.keyboard.press("Tab")
        if page.locator(":focus").evaluate(
            "at => at.getAttribute('aria-label') ?? at.innerText"
        ) == (name):
            return
    raise AssertionError(f"no way to {name!r} by Tab")


def test_a_project_is_set_up_by_keyboard_and_changed_later(home: Path, page: Page) -> None:
    assert keeps_out(page) == []
    tab_to(page, "Use flight")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", name="flight")).to_be_focused()
    assert keeps_out(page) == []
    page.get_by_role("radio", name="As recorded").focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    expect(page.get_by_role("radio", name="45° down")).to_be_checked()
    page.get_by_label("A reading of the tape").fill("0,5")
    page.get_by_text("Case, for the head").click()
    page.get_by_label("Case number").fill("7/26 <b>")
    assert keeps_out(page) == []
    page.keyboard.press("Enter")
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    project = load_project(home / "flight", unfinished=True)
    assert (project.mount.pitch_deg, project.tape.reading_sigma_m) == (-45.0, 0.005)
    assert project.case.number == "7/26 <b>"

    page.get_by_role("tab", name="Results").click()
    with_axe(page)
    expect(page.get_by_role("tabpanel", name="Results")).to_contain_text("Nothing is written yet")
    page.reload()  # stays where it was
    expect(page.get_by_role("tabpanel", name="Results")).to_contain_text("Nothing is written yet")
    with_axe(page)
    assert keeps_out(page) == []
    page.get_by_role("tab", name="Measure").click()
    place(page, "A", 101.25, 99.75)
    place(page, "B", 151.25, 99.75)
    page.get_by_role("tab", name="Camera").click()
    page.get_by_role("button", name="Change camera, mount").click()
    expect(page.get_by_role("radio", name="45° down")).to_be_checked()
    expect(page.get_by_label("Case number")).to_have_value("7/26 <b>")
    page.get_by_label("Degrees below the horizon").fill("60")
    page.get_by_role("button", name="Open the project").click()
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    assert load_project(home / "flight", unfinished=True).mount.pitch_deg == -60.0
    measured = page.locator('[data-row="measure D1"]')
    expect(measured).to_have_count(1)
    page.locator("#undo").click()  # of what was marked before
    expect(measured).to_have_count(0)


def test_what_is_in_the_way_is_said_in_plain_words(
    home: Path, page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    page.get_by_role("button", name="nothing").click()
    expect(page.get_by_role("navigation", name="Where you are")).to_contain_text("nothing")
    page.reload()  # stays in the folder
    expect(page.get_by_role("navigation", name="Where you are")).to_contain_text("nothing")
    page.get_by_role("button", name="Look through all its folders").click()
    expect(page.get_by_role("alert").last).to_contain_text("There are no photos")
    expect(page.locator("#setup")).to_contain_text("video")
    page.get_by_role("button", name="Another folder").click()
    page.get_by_role("button", name="home").click()

    other = cv2.imencode(".jpg", np.zeros((300, 400, 3), np.uint8))[1].tobytes()
    (home / "flight" / "photos" / "small.jpg").write_bytes(other)
    page.get_by_role("button", name="Use flight").click()
    expect(page.locator("#setup")).to_contain_text("several sizes")
    page.get_by_role("radio", name="Another angle").check()
    page.get_by_role("button", name="Begin").click()
    at_field = page.locator(".at-field")
    expect(at_field).to_contain_text("Enter how many degrees below the horizon")
    page.get_by_role("textbox", name="Degrees below the horizon").fill("120")
    page.get_by_role("button", name="Begin").click()
    expect(at_field).to_contain_text("120 degrees below the horizon is not possible")
    page.get_by_role("radio", name="As recorded").check()

    real = Path.open

    def full(path: Path, mode: str = "r", **more: Any) -> IO[Any]:  # noqa: ANN401
        if mode == "x":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(path, mode, **more)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", full)
        page.get_by_role("button", name="Begin").click()
        expect(page.locator("#trouble")).to_contain_text("free some space")
    assert not (home / "flight" / "project.yaml").exists()

    page.get_by_role("button", name="Begin").click()
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    assert load_project(home / "flight", unfinished=True).images[0].endswith("/P*.jpg")

    page.get_by_role("button", name="Open another folder").click()
    expect(page.get_by_role("list", name="Opened before")).to_be_visible()
    shutil.rmtree(home / "nothing")
    page.get_by_role("button", name="nothing").click()
    expect(page.locator("#trouble")).to_contain_text("not there any more")


def test_what_was_set_outlives_a_reload_and_another_tab_closes_nothing_unasked(
    home: Path, data_dir: Path, server: Served, page: Page
) -> None:
    log = "flight.tlog"  # it has no gimbal, nor do the photos say where they looked
    shutil.copy(data_dir / "street_oblique" / log, home / "flight" / log)
    small_project(home / "other")
    expect(page.get_by_role("button", name="Use flight")).to_be_visible()

    # Only a person knows how the camera hung: nothing is chosen before.
    page.get_by_role("button", name="Use flight").click()
    expect(page.get_by_role("heading", name="flight")).to_be_focused()
    expect(page.locator(".mount input:checked")).to_have_count(0)
    page.get_by_role("button", name="Begin").click()
    expect(page.locator("#trouble")).to_contain_text("How did the camera hang?")
    page.get_by_role("radio", name="Straight down").check()
    page.get_by_label("flight log").select_option("none of these: work without a log")
    page.get_by_label("Lengths are in").select_option("imperial")
    page.get_by_label("A reading of the tape").fill("0,75")
    page.get_by_text("Case, for the head").click()
    page.get_by_label("Case number").fill("7/26")
    page.reload()
    expect(page.get_by_role("radio", name="Straight down")).to_be_checked()
    expect(page.get_by_label("flight log")).to_have_value("none")
    expect(page.get_by_label("A reading of the tape")).to_have_value("0,75")
    expect(page.get_by_label("Case number")).to_have_value("7/26")

    other = page.context.new_page()  # a second tab, at the door too
    other.goto(server.guard.address())
    expect(other.get_by_role("button", name="Open other")).to_be_visible()
    page.get_by_role("button", name="Begin").click()
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    assert load_project(home / "flight", unfinished=True).log is None
    other.get_by_role("button", name="Open other").click()
    expect(other.locator("#trouble")).to_contain_text("flight is open already")
    expect(page.locator("#project")).to_contain_text("flight")
    other.get_by_role("button", name="Close flight and open other").click()
    expect(other.locator("#project")).to_have_text("small")  # its name
    expect(page.locator("#notice")).to_contain_text("flight was saved and closed, as small was")
    other.close()

    # The log is taken after all, on the page.
    page.get_by_role("button", name="Open another folder").click()
    page.get_by_role("button", name="Open flight").first.click()
    page.get_by_role("tab", name="Camera").click()
    page.get_by_role("button", name="Change camera, mount").click()
    page.get_by_label("flight log").select_option(log)
    page.get_by_role("button", name="Open the project").click()

    def named() -> str:
        return Path(load_project(home / "flight", unfinished=True).log or "").name

    eventually(page, lambda: named() == log)


def test_damaged_files_are_named_and_the_rest_can_be_used(home: Path, page: Page) -> None:
    photos = home / "flight" / "photos"
    whole = (photos / "P1.jpg").read_bytes()
    (photos / "P3.jpg").write_bytes(whole[:-200])
    (photos / "P4.jpg").write_bytes(whole)
    (home / "flight" / "00000012.BIN").touch()
    (home / "only damaged").mkdir()
    (home / "only damaged" / "a.jpg").write_text("no photo", encoding="utf-8")
    page.reload()

    expect(page.locator(".folders .into", has_text="only damaged")).to_contain_text("1 photo file")
    page.get_by_role("button", name="Use only damaged").click()
    expect(page.get_by_role("alert").last).to_contain_text("There are no photos")
    expect(page.get_by_role("alert").last).to_contain_text(
        "a.jpg cannot be used, as it is no photo"
    )
    page.get_by_role("button", name="Another folder").click()

    page.get_by_role("button", name="Use flight").click()
    named = page.get_by_role("group", name="Cannot be used")
    expect(named).to_contain_text("The flight log 00000012.BIN is not used, as it is empty")
    expect(named).to_contain_text("Without a flight log, the photos are placed by")
    expect(named).to_contain_text("P3.jpg cannot be used, as it is cut off")
    expect(named).not_to_contain_text("P4.jpg")

    (photos / "P4.jpg").write_bytes(b"")  # after it was listed
    page.get_by_role("radio", name="Straight down").check()
    page.get_by_role("button", name="No lengths").click()
    trouble = page.locator("#trouble")
    expect(trouble).to_contain_text("It has 2 photos that can be used, not 3.")
    expect(trouble).to_contain_text("P4.jpg (is empty, and no photo that can be read)")
    expect(named).to_contain_text("P4.jpg")
    expect(page.get_by_role("radio", name="Straight down")).to_be_checked()
    assert not (home / "flight" / "project.yaml").exists()
    page.get_by_role("button", name="No lengths").click()
    expect(page.locator("#strip button")).to_have_count(2)
    page.get_by_role("tab", name="Photos").click()
    rows = page.get_by_role("table", name="Photos left out").get_by_role("row")
    expect(rows).to_contain_text(["", "P3.jpg", "P4.jpg"])


def test_back_and_forward_of_the_browser_go_through_the_folders(page: Page) -> None:
    title = page.locator("#setup-title")
    page.get_by_role("button", name="nothing", exact=True).click()
    expect(page.get_by_text("No folders in it.")).to_be_visible()
    page.go_back()
    page.get_by_role("button", name="Use flight").click()
    expect(title).to_have_text("flight")
    page.go_back()
    expect(page.get_by_role("button", name="Use flight")).to_be_visible()
    expect(title).to_be_hidden()
    page.go_forward()
    expect(title).to_be_visible()


def test_a_page_that_closes_its_project_requests_no_more_photos(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    real_tile, real_end = TiledPhotos.tile, PickServer.end

    def slow_tile(photos: TiledPhotos, *place: Any) -> bytes | None:  # noqa: ANN401
        time.sleep(0.3)
        return real_tile(photos, *place)

    async def slow_end(server: PickServer, *, waits: bool) -> None:
        await asyncio.sleep(2.0)  # the photo is complete before the page is told to go
        await real_end(server, waits=waits)

    monkeypatch.setattr(TiledPhotos, "tile", slow_tile)
    monkeypatch.setattr(PickServer, "end", slow_end)
    page.get_by_role("button", name="Use flight").click()
    page.get_by_role("radio", name="Straight down").check()
    page.get_by_role("button", name="No lengths").click()
    expect(page.locator("#strip button")).to_have_count(2)
    page.get_by_role("button", name="Open another folder").click()
    expect(page.get_by_role("list", name="Opened before")).to_be_visible()


@pytest.mark.parametrize(
    "loss", ["cut off", "not among the project's photos", "turned by 90 degrees (480 x 640 px"]
)
def test_a_photo_that_cannot_be_used_is_left_out_of_a_project_and_taken_back(
    home: Path, page: Page, loss: str
) -> None:
    page.get_by_role("button", name="Use flight").click()
    page.get_by_role("radio", name="Straight down").check()
    page.get_by_role("button", name="No lengths").click()
    expect(page.locator("#strip button")).to_have_count(2)
    page.get_by_role("button", name="Open another folder").click()

    photo = home / "flight" / "photos" / "P2.jpg"
    whole = photo.read_bytes()
    if loss == "cut off":
        photo.write_bytes(whole[:-200])
    elif "turned" in loss:
        picture = cv2.imdecode(np.frombuffer(whole, np.uint8), cv2.IMREAD_COLOR)
        assert picture is not None
        photo.write_bytes(cv2.imencode(".jpg", np.rot90(picture))[1].tobytes())
    else:
        photo.unlink()
    (home / "flight" / "picks.csv").write_text(
        "image,label,u_px,v_px\nP1.jpg,A,100,100\nP2.jpg,A,110,100\n", encoding="utf-8"
    )
    page.get_by_role("button", name="Open flight").first.click()
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    expect(page.locator("#strip button")).to_have_count(1)
    expect(page.locator("#light")).to_have_text("Not checked yet")
    expect(page.locator("#first")).to_contain_text(f"P2.jpg cannot be used, as it is {loss}")
    page.get_by_role("tab", name="Measure").click()
    expect(page.locator("p.why")).to_contain_text(f"P2.jpg: is {loss}")  # as `run` refuses it
    page.get_by_role("tab", name="Photos").click()
    shown = page.get_by_role("tabpanel", name="Photos")
    expect(shown).to_contain_text(f"The photo P2.jpg cannot be used, as it is {loss}")

    page.locator("#first").get_by_role("button", name="Leave P2.jpg out").click()
    expect(page.locator("#notice")).to_contain_text("The project leaves out P2.jpg")
    expect(shown).to_contain_text(
        "leaves out P2.jpg (`leave_out`), with its picks of A, which stay"
    )
    project = home / "flight" / "project.yaml"
    assert load_project(project).leave_out == ("P2.jpg",)
    assert "P2.jpg,A,110,100" in (home / "flight" / "picks.csv").read_text(encoding="utf-8")
    expect(page.get_by_role("button", name="Leave P2.jpg out")).to_have_count(0)

    photo.write_bytes(whole)
    page.get_by_role("button", name="Use P2.jpg again").click()
    expect(page.locator("#strip button")).to_have_count(2)
    assert load_project(project).leave_out == ()

    # A sound photo, too, by one control; the page that is loaded again with the others undoes it.
    page.get_by_role("tab", name="Photos").click()
    expect(shown).not_to_contain_text("no clock")
    page.get_by_role("button", name="Leave P1.jpg out").click()
    expect(page.locator("#strip button")).to_have_count(1)
    expect(page.locator("#notice")).to_contain_text("The project leaves out P1.jpg")
    expect(page.get_by_role("button", name="Leave P2.jpg out")).to_have_count(0)  # the last one
    page.locator("#notice").get_by_role("button", name="Undo").click()
    expect(page.locator("#strip button")).to_have_count(2)
    assert load_project(project).leave_out == ()


def test_a_wrong_date_is_refused_at_its_field_and_a_turned_camera_is_set(
    home: Path, data_dir: Path, page: Page
) -> None:
    shutil.copy(data_dir / "street_oblique" / "flight.tlog", home / "flight")
    page.get_by_role("button", name="Use flight").click()
    expect(page.get_by_label("Turned from the nose")).to_be_hidden()  # nobody else is burdened
    page.get_by_text("It was turned or tilted").click()
    page.get_by_label("Turned from the nose").fill("27o")
    page.get_by_role("radio", name="45° down").check()
    page.get_by_text("Case, for the head").click()
    page.get_by_label("Date").fill("31.02.2026")
    page.get_by_role("button", name="Begin").click()
    expect(page.locator(".at-field")).to_have_text("Enter degrees, such as 90 (read: 27o).")
    expect(page.get_by_label("Turned from the nose")).to_be_focused()
    page.get_by_label("Turned from the nose").fill("270")
    page.get_by_role("button", name="Begin").click()
    expect(page.locator(".at-field")).to_have_text(
        "Date: there is no such date as 31.02.2026: check day and month."
    )
    expect(page.get_by_label("Date")).to_be_focused()
    page.get_by_label("Date").fill("gestern")
    page.get_by_label("A reading of the tape").fill("500")
    page.get_by_role("button", name="Begin").click()
    expect(page.locator(".at-field")).to_have_text(
        "Date: gestern is no date: write day, month and year, such as 2026-05-09."
    )
    page.get_by_label("Date").fill("28.02.2026")
    page.get_by_role("button", name="Begin").click()
    expect(page.locator(".at-field")).to_contain_text("5 m is not possible")
    expect(page.get_by_label("A reading of the tape")).to_be_focused()
    page.get_by_label("A reading of the tape").fill("1")
    assert not (home / "flight" / "project.yaml").exists()
    page.get_by_role("button", name="Begin").click()
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    project = load_project(home / "flight", unfinished=True)
    assert (project.mount.yaw_deg, project.mount.pitch_deg) == (270.0, -45.0)
    assert project.case.date == "28.02.2026"


@pytest.mark.parametrize("has_log", [False, True])
def test_the_set_up_reads_the_same_before_and_after_the_project_is_made(
    home: Path, data_dir: Path, page: Page, *, has_log: bool
) -> None:
    if has_log:
        shutil.copy(data_dir / "street_oblique" / "flight.tlog", home / "flight")
    page.get_by_role("button", name="Use flight").click()
    title = "I do not know" if has_log else "As recorded"  # that log has no angles of a gimbal
    page.get_by_role("radio", name=title).check()
    boxes = page.locator("#setup fieldset:not(:has-text('Also found'))")
    expect(page.get_by_role("group", name="Tape")).to_be_visible()
    before = boxes.all_inner_texts()
    page.get_by_role("button", name="Begin").click()
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    page.get_by_role("tab", name="Camera").click()
    page.get_by_role("button", name="Change camera, mount").click()
    expect(page.get_by_role("group", name="Tape")).to_be_visible()
    assert boxes.all_inner_texts() == before


def test_photos_of_another_size_among_the_others_are_left_out_by_choice(
    home: Path, open_page: PageOpener
) -> None:
    photos = home / "flight" / "photos"
    for path, k in zip(sorted(photos.iterdir()), (1, 3, 4), strict=False):
        path.rename(photos / f"IMG_{k}.jpg")
    turned = cv2.imencode(".jpg", np.zeros((300, 400, 3), np.uint8))[1].tobytes()
    (photos / "IMG_2.jpg").write_bytes(turned)
    kept = sorted(path.name for path in photos.iterdir() if path.name != "IMG_2.jpg")
    with served(None, FolderChooser(roots=(home,))) as server:
        page = open_page(server)
        page.get_by_role("button", name="Use flight").click()
        page.get_by_role("radio", name=f"{len(kept)} photos of").check()
        page.get_by_role("button", name="Begin").click()
        expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
        assert [photo.name for photo in server.picking.photos] == kept
        assert not open_page.errors
