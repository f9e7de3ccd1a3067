"""While results are written, the stage is shown, and a person can stop it."""

from __future__ import annotations

import time
from pathlib import Path

from opened_pages import PageOpener
from pick_pages import small_project
from picking_server import served
from playwright.sync_api import expect

from uavgram.errors import UavgramError
from uavgram.model.work import report_work


def test_the_stage_is_shown_and_stop_ends_the_run(tmp_path: Path, open_page: PageOpener) -> None:
    done = []

    def run(_project: Path) -> None:
        report_work("adjust and measure")
        for _ in range(6000):  # a minute, if nobody stops it
            time.sleep(0.01)
            try:
                report_work()
            except UavgramError:  # as a stage that goes on without a part that fails
                continue
        done.append(True)

    with served(small_project(tmp_path), run=run) as server:
        page = open_page(server)
        foot = page.locator("#outputs")
        foot.locator('[name="export"]').click()
        expect(foot.get_by_role("status").first).to_contain_text("Adjust and measure\u2026 1 s")
        foot.get_by_role("button", name="Stop").click()
        expect(page.locator("#notice")).to_contain_text("Stopped: nothing was written.")
        expect(foot.locator('[name="export"]')).to_be_enabled()
        expect(foot.get_by_role("button", name="Stop")).to_have_count(0)
        assert not done
        assert not server.desk.is_busy
