"""The door of the page: by keyboard, for who sees little, and when something is in the way."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
import pytest
from axe_checks import keeps_out, with_axe
from opened_pages import PageOpener
from pick_pages import small_project
from picking_server import Served, served
from playwright.sync_api import Page, expect

from uavgram.config.project import load_project
from uavgram.picking.session.door import Door


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
    with served(None, Door(roots=(home,))) as server:
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
    assert keeps_out(page) == []
    page.get_by_role("tab", name="Camera").click()
    page.get_by_role("button", name="Change camera, mount").click()
    expect(page.get_by_role("radio", name="45° down")).to_be_checked()
    expect(page.get_by_label("Case number")).to_have_value("7/26 <b>")
    page.get_by_label("Degrees below the horizon").fill("60")
    page.get_by_role("button", name="Open the project").click()
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    assert load_project(home / "flight", unfinished=True).mount.pitch_deg == -60.0


def test_what_is_in_the_way_is_said_in_plain_words(
    home: Path, page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    page.get_by_role("button", name="nothing").click()
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
    expect(page.locator("#trouble")).to_contain_text("how many degrees below the horizon")
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
