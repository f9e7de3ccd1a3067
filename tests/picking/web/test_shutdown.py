"""When the page's server ends by itself: some time after its last tab, never before or at work."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
from pick_pages import LONGEST_WAIT_S, Page, ask, entry_by, small_project
from websockets import Origin
from websockets.sync.client import connect

from uavgram.io.outputs import LOCK, is_locked
from uavgram.picking.session.project import OpenProject
from uavgram.picking.web import serving
from uavgram.picking.web.tabs import Tabs


def test_a_closed_tab_counts_from_its_end_and_no_tab_at_all_from_the_beginning() -> None:
    now = 0.0
    tabs = Tabs(clock=lambda: now)
    now = 1000.0
    assert tabs.gone_s() == 1000  # none has come yet
    tabs.expect()  # another address was given
    assert tabs.gone_s() == 0
    with tabs.one():
        now = 2000.0
        with tabs.one():
            now = 3000.0
        assert tabs.gone_s() == 0
        now = 4000.0
    now = 4010.0
    assert tabs.gone_s() == 10


class Reached:
    """A server in a thread, as `uavgram` starts it."""

    def __init__(self, wanted: Path | None) -> None:
        self.address = ""
        ready = threading.Event()

        def announce(address: str) -> None:
            self.address = address
            ready.set()

        arguments = (wanted, announce, lambda _: None)
        self.thread = threading.Thread(target=serving.serve, args=arguments, daemon=True)
        self.thread.start()
        assert ready.wait(LONGEST_WAIT_S)

    @property
    def origin(self) -> str:
        return self.address.partition("/?")[0]


def test_a_while_after_the_last_tab_the_project_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = small_project(tmp_path)
    reached = Reached(project)
    busy = threading.Event()
    busy.set()
    monkeypatch.setattr(OpenProject, "is_busy", property(lambda _: busy.is_set()))
    with Page(reached) as page:
        page.do("place", image=0, label="A", u_px=1.5, v_px=2.5)
        monkeypatch.setattr(serving, "ENDS_AFTER_S", 0.2)
        reached.thread.join(1.0)
        assert reached.thread.is_alive()  # a tab is open
    reached.thread.join(1.0)
    assert reached.thread.is_alive()  # results are being written
    busy.clear()
    reached.thread.join(LONGEST_WAIT_S)
    assert not reached.thread.is_alive()
    assert not is_locked(tmp_path / "out" / LOCK)
    assert "P1.jpg,A,1.5,2.5," in (tmp_path / "picks.csv").read_text(encoding="utf-8")


def test_a_tab_at_the_choice_of_a_folder_is_a_tab(monkeypatch: pytest.MonkeyPatch) -> None:
    reached = Reached(None)
    entry = entry_by(ask(reached.address, follow_redirects=False))
    address = entry.to(reached.origin.replace("http", "ws") + "/door/tab")
    headers = {"Cookie": entry.cookie}
    with connect(address, origin=Origin(reached.origin), additional_headers=headers, proxy=None):
        monkeypatch.setattr(serving, "ENDS_AFTER_S", 0.2)
        reached.thread.join(1.0)
        assert reached.thread.is_alive()
    reached.thread.join(LONGEST_WAIT_S)
    assert not reached.thread.is_alive()


def test_a_page_that_no_browser_ever_opened_ends_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serving, "ENDS_AFTER_S", 0.2)
    reached = Reached(None)
    reached.thread.join(LONGEST_WAIT_S)

    assert not reached.thread.is_alive()
