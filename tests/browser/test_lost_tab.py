"""The program started twice, as after a lost tab or a double click: one page, nothing lost."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from pick_pages import LONGEST_WAIT_S, small_project
from picking_pages import place
from playwright.sync_api import Browser, BrowserContext, Page, expect

from uavgram.picking.web.serving import open_socket

SHARP = '.pane[data-sharp="true"]'


class Desk:
    """Somebody's computer: starts the program, and opens what it would open in the browser."""

    def __init__(self, context: BrowserContext) -> None:
        self.context = context
        self.started: list[subprocess.Popen[str]] = []

    def start(self, *words: str | Path) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "uavgram", *map(str, words), "--no-browser"]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.started.append(process)
        return process

    def tab_of(self, process: subprocess.Popen[str]) -> Page:
        assert process.stdout is not None
        line = process.stdout.readline()
        found = re.search(r"http://\S+", line)
        assert found is not None, line
        page = self.context.new_page()
        page.goto(found[0])
        return page

    def lead(self, *words: str | Path) -> Page:
        """Start it once more: the second one opens a tab of the first, and ends."""
        second = self.start(*words)
        page = self.tab_of(second)
        assert second.wait(LONGEST_WAIT_S) == 0
        return page

    def end(self) -> None:
        for process in self.started:
            process.kill()
            process.communicate()


@pytest.fixture
def desk(chromium: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    context = chromium.new_context()
    context.set_default_timeout(60_000)
    desk = Desk(context)
    yield desk
    context.close()
    desk.end()


def test_a_second_start_opens_the_running_page_with_what_is_asked_for(
    desk: Desk, tmp_path: Path
) -> None:
    first, other = (tmp_path / name for name in ("first", "other"))
    project = small_project(first)
    text = small_project(other).read_text(encoding="utf-8")
    (other / "project.yaml").write_text(text.replace("name: small", "name: other"))
    program = desk.start(project)
    page = desk.tab_of(program)
    page.wait_for_selector(SHARP)
    place(page, "A", 100, 100)
    page.close()  # the lost tab

    page = desk.lead(first)
    page.wait_for_selector(SHARP)
    expect(page.locator('.mark[data-label="A"]')).to_have_count(1)
    page.keyboard.press("Control+z")  # not even what can be undone
    expect(page.locator('.mark[data-label="A"]')).to_have_count(0)

    # The icon on the desktop names no folder.
    again = desk.lead()
    again.wait_for_selector(SHARP)
    again.close()

    # Another project while the first is shown in a tab: nothing is closed unasked.
    asked = desk.lead(other)
    expect(asked.locator("#trouble")).to_contain_text("first is open already")
    asked.get_by_role("button", name="Go to first").click()
    asked.wait_for_selector(SHARP)
    asked.close()
    page.close()

    # No tab shows it any more: the other one opens at once.
    page = desk.lead("pick", other / "project.yaml")
    page.wait_for_selector(SHARP)
    expect(page.locator("#project")).to_have_text("other")

    # A folder without a project is set up.
    bare = tmp_path / "bare"
    small_project(bare).unlink()
    page.close()
    page = desk.lead(bare)
    expect(page.get_by_role("heading", name="bare")).to_be_visible()
    assert program.poll() is None


def test_two_starts_at_the_same_moment_are_one_page(desk: Desk, tmp_path: Path) -> None:
    folder = tmp_path / "flight"
    small_project(folder)
    both = [desk.start(folder) for _ in range(2)]
    for process in both:
        desk.tab_of(process).wait_for_selector(SHARP)
    ended = [process for process in both if process.poll() is not None or not waits(process)]
    assert len(ended) == 1


def waits(process: subprocess.Popen[str]) -> bool:
    """Whether a program goes on for a while."""
    try:
        process.wait(5)
    except subprocess.TimeoutExpired:
        return True
    return False


def test_a_project_that_another_page_has_open_is_reached_there(desk: Desk, tmp_path: Path) -> None:
    folder = tmp_path / "flight"
    small_project(folder)
    desk.tab_of(desk.start(folder)).wait_for_selector(SHARP)
    with closing(open_socket(0)) as free:
        port = free.getsockname()[1]
    page = desk.tab_of(desk.start("--port", str(port)))  # a page of its own, beside the first
    assert f":{port}/" in page.url
    page.get_by_role("button", name="Open flight").click()
    expect(page.locator("#trouble")).to_contain_text("open in another page")
    page.get_by_role("button", name="Go to it").click()
    page.wait_for_selector(SHARP)
    assert f":{port}/" not in page.url
