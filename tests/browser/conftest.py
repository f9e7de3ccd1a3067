"""A real browser over the picking page; skipped with a reason where there is none."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from picking_projects import PickingProject, write_project

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from opened_pages import PageOpener
from playwright.sync_api import Browser, expect, sync_playwright

CHROMIUM = Path("/usr/bin/chromium")
WITHOUT = (
    # Two pages of its own, for suggestions at an address bar that nobody sees: every new window
    # draws both, which is a third of what it costs.
    *("WebUIOmniboxPopup", "WebUIOmniboxFullPopup", "WebUIOmniboxAimPopup"),
    # Of what Playwright leaves out, which an own list replaces: what asks elsewhere or waits.
    *("HttpsUpgrades", "HttpsFirstBalancedModeAutoEnable", "PaintHolding", "OptimizationHints"),
    *("MediaRouter", "NetworkTimeServiceQuerying", "PreconnectToSearch", "AimEnabled"),
    *("LensOverlay", "DestroyProfileOnBrowserClose", "AvoidUnnecessaryBeforeUnloadCheckSync"),
)
expect.set_options(timeout=60_000)  # as long as it takes on a busy machine


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """Debian's chromium without a GPU."""
    if not CHROMIUM.is_file():
        pytest.skip(f"no browser at {CHROMIUM}: apt install chromium")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=str(CHROMIUM),
            args=["--no-sandbox", "--disable-gpu", f"--disable-features={','.join(WITHOUT)}"],
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
def open_page(chromium: Browser) -> Iterator[PageOpener]:
    """Opens a server's page, and says what went wrong in it."""
    opener = PageOpener(chromium)
    yield opener
    opener.close()
