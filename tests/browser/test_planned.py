"""Lines and plates that were planned before the flight, on the page of an empty project."""

from __future__ import annotations

import re
from dataclasses import replace

from opened_pages import PageOpener
from picking_pages import to_page
from picking_projects import PickingProject
from picking_server import served
from planned_sample import sample_plan, sample_plates
from playwright.sync_api import expect

from uavgram.io.results.command_json import write_plan


def test_a_planned_line_is_marked_and_its_reading_entered(
    planted: PickingProject, open_page: PageOpener
) -> None:
    write_plan(replace(sample_plan(), plates=sample_plates()), planted.path.with_name("plan.json"))
    with planted.path.open("a", encoding="utf-8") as file:
        file.write("plan: plan.json\n")
    with served(planted.path) as server:
        page = open_page(server)
        planned = page.get_by_role("group", name="Planned lines")
        expect(planned.locator("summary")).to_have_text("Planned lines: 0 of 5 entered")
        first = planned.locator("li").first
        expect(first.locator("b")).to_have_text("L1: about 14.2 m, from L1a to L1b")
        expect(first).to_contain_text("1.2 m from corner 1 towards corner 2, then 1.2 m inwards")
        for label, (u, v) in zip(("L1a", "L1b"), planted.marks_px[:2], strict=True):
            first.get_by_role("button", name=f"Mark {label}").click()
            page.mouse.click(*to_page(page, u, v))
            expect(page.locator(f'.mark[data-label="{label}"]')).to_have_count(1)
        first.get_by_role("button", name="Enter what the tape said").click()
        form = page.get_by_role("form", name="New length L1a to L1b")
        expect(form.get_by_label("Name")).to_have_value("L1")
        expect(form.get_by_label("Length, metres")).to_have_value("")  # a plan is no reading
        form.get_by_label("Length, metres").fill("14.183")
        page.keyboard.press("Enter")
        expect(planned.locator("summary")).to_have_text("Planned lines: 1 of 5 entered")
        expect(planned.locator("li.done b")).to_have_text("L1: about 14.2 m, from L1a to L1b")
        plates = page.get_by_role("group", name="Planned plates")
        expect(plates.locator("summary")).to_have_text("Planned plates: 0 of 2 found")
        expect(plates).to_contain_text("side_m: 0.7")  # what the project lacks to look for them
        expect(plates.locator("li").first).to_contain_text("5 m from corner 1 towards corner 2")
        page.locator("#label").fill("T1-3")
        page.mouse.click(*to_page(page, *planted.marks_px[2]))
        expect(plates.locator("li.done")).to_have_text(re.compile("T1: side 70 cm *in 1 photo"))
        expect(plates.locator("summary")).to_have_text("Planned plates: 1 of 2 found")
        assert not open_page.errors
