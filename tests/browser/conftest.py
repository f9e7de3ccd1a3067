"""A real browser over the picking page; skipped with a reason where there is none."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from picking_projects import PickingProject, write_project
from picking_server import Served

CHROMIUM = Path("/usr/bin/chromium")
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
playwright.expect.set_options(timeout=60_000)  # as long as it takes on a busy machine


@pytest.fixture(scope="session")
def chromium():
    """Debian's chromium without a GPU."""
    if not CHROMIUM.is_file():
        pytest.skip(f"no browser at {CHROMIUM}: apt install chromium")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"]
        )
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def planted_once(tmp_path_factory: pytest.TempPathFactory) -> PickingProject:
    return write_project(tmp_path_factory.mktemp("planted"))


@pytest.fixture
def planted(planted_once: PickingProject, tmp_path: Path) -> PickingProject:
    """A project of one photo with marks at known places, and nothing picked."""
    folder = tmp_path / "planted"
    shutil.copytree(planted_once.path.parent, folder)
    return PickingProject(folder / planted_once.path.name, planted_once.marks_px)


@pytest.fixture
def open_page(chromium):
    """Open a server's page: ``open_page(server, width, height, ratio)``."""
    opened = []

    def opening(server: Served, width: int = 1280, height: int = 720, ratio: float = 1.0):
        context = chromium.new_context(
            viewport={"width": width, "height": height}, device_scale_factor=ratio
        )
        context.set_default_timeout(60_000)
        opened.append(context)
        page = context.new_page()
        page.errors = []
        page.on("pageerror", lambda fault: page.errors.append(str(fault)))
        page.on("console", lambda said: said.type == "error" and page.errors.append(said.text))
        page.strangers = []
        home = re.compile(rf"(http|ws)://127\.0\.0\.1:{server.port}/|blob:|data:")
        page.on("request", lambda r: home.match(r.url) or page.strangers.append(r.url))
        page.goto(server.guard.address())
        page.wait_for_selector('.pane[data-sharp="true"]')
        return page

    yield opening
    for context in opened:
        context.close()
