"""Long work: its stage is shown, a person can stop it, and clicks are kept meanwhile."""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest
from csv_rows import read_rows
from opened_pages import PageOpener
from pick_pages import small_project
from picking_pages import eventually, place, wait_until_adjusted
from picking_server import served
from playwright.sync_api import expect
from textured_ground import write_textured

from uavgram.errors import UavgramError
from uavgram.model.work import report_work
from uavgram.pipeline.pick.live_survey import LiveAdjustment, Observations


def work_for_a_minute(stage: str) -> None:
    report_work(stage)
    for _ in range(6000):
        time.sleep(0.01)
        report_work()


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
        expect(foot.get_by_role("status").first).to_contain_text(
            re.compile("Adjust and measure\u2026 [1-9]")
        )
        foot.get_by_role("button", name="Stop").click()
        expect(page.locator("#notice")).to_contain_text("Stopped: nothing was written.")
        expect(foot.locator('[name="export"]')).to_be_enabled()
        expect(foot.get_by_role("button", name="Stop")).to_have_count(0)
        assert not done
        assert not server.desk.is_busy


def test_what_is_clicked_while_results_are_written_is_kept_at_once(
    tmp_path: Path, open_page: PageOpener
) -> None:
    with served(small_project(tmp_path), run=lambda _: work_for_a_minute("adjust")) as server:
        page = open_page(server)
        place(page, "Before", 100, 100)
        foot = page.locator("#outputs")
        foot.locator('[name="export"]').click()
        expect(foot.get_by_role("button", name="Stop")).to_be_visible()
        place(page, "Meanwhile", 300, 200)  # its mark is shown when it is on disk
        assert server.desk.is_busy
        journal = (tmp_path / "out" / "pick-journal.jsonl").read_text(encoding="utf-8")
        assert "Meanwhile" in journal
        time.sleep(1.0)
        labels = {row["label"] for row in read_rows(tmp_path / "picks.csv")}
        assert labels == {"Before"}  # the run reads the tables: none is written under it
        foot.get_by_role("button", name="Stop").click()
        expect(page.locator("#notice")).to_contain_text("Stopped: nothing was written.")
        eventually(page, lambda: len(read_rows(tmp_path / "picks.csv")) == 2)
        assert not open_page.errors


def test_a_long_adjustment_shows_its_stage_and_can_be_stopped(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(small_project(tmp_path)) as server:
        survey = server.picking.survey

        def adjust(_: Observations) -> LiveAdjustment:
            work_for_a_minute("adjust, and look for wrong picks and lengths")
            raise AssertionError("nobody stopped it")

        page = open_page(server)
        expect(page.locator("#mode")).to_have_text("nothing computed yet")
        monkeypatch.setattr(survey, "adjust", adjust)
        place(page, "A", 100, 100)
        foot = page.locator("#outputs")
        stage = foot.get_by_role("status").first
        words = "Adjust, and look for wrong picks and lengths\u2026 [1-9]"
        expect(stage).to_contain_text(re.compile(words))
        other = open_page(server)  # opened meanwhile
        expect(other.locator("#outputs").get_by_role("button", name="Stop")).to_be_visible()
        foot.get_by_role("button", name="Stop").click()
        expect(page.locator("#panel")).to_contain_text("You stopped the computation")
        expect(foot.get_by_role("button", name="Stop")).to_have_count(0)
        expect(page.locator('.mark[data-label="A"]')).to_be_visible()
        place(page, "B", 300, 200)  # adjusts again
        expect(foot.get_by_role("button", name="Stop")).to_be_visible()
        begun = time.monotonic()
    assert time.monotonic() - begun < 20.0  # the end waits for no adjustment
    assert not open_page.errors


def test_values_and_finds_stay_when_a_person_stops_the_adjustment(
    tmp_path: Path, open_page: PageOpener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(write_textured(tmp_path).path) as server:
        page = open_page(server)
        expect(page.locator('[name="accept-export"]')).to_be_enabled()
        finds = page.locator('tr[data-row^="found "]')
        before, values = finds.count(), page.locator("td.value").all_inner_texts()
        assert before
        assert any(values)
        survey = server.picking.survey

        def adjust(_: Observations) -> LiveAdjustment:
            work_for_a_minute("adjust")
            raise AssertionError("nobody stopped it")

        with monkeypatch.context() as slow:
            slow.setattr(survey, "adjust", adjust)
            place(page, "A", 100, 100)
            page.locator("#outputs").get_by_role("button", name="Stop").click()
            expect(page.locator("#light")).to_have_text("Not checked: you stopped the computation")
            expect(page.locator("#panel")).to_contain_text("You stopped the computation, so there")
            expect(page.locator("#mode")).to_have_text("stopped")
            expect(page.locator("body")).to_have_attribute("data-numbers", "stopped")
        shown = page.locator("td.value").all_inner_texts()
        assert set(values) <= set(shown)
        expect(page.locator('[name="accept-export"]')).to_be_enabled()  # the search has ended
        assert finds.count() >= before
        page.keyboard.press("Escape")
        page.keyboard.press("Control+z")
        wait_until_adjusted(page)
        assert not open_page.errors
