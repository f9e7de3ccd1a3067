"""What a new user is told to do next, and what the tools are called."""

from __future__ import annotations

from opened_pages import PageOpener
from picking_pages import place
from picking_projects import PickingProject
from picking_server import served
from playwright.sync_api import expect


def test_the_first_steps_are_ticked_folded_and_brought_back(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        steps = page.locator(".steps")
        # One photo and no log: nothing but taped lengths says how large things are.
        expect(steps.locator("li b")).to_have_text(
            [
                "Mark four points",
                "Enter three lengths that were taped",
                "Measure what you want to know",
            ]
        )
        expect(steps.locator("li .dim")).to_have_count(1)  # how, of the one that is next
        for k, (u, v) in enumerate(planted.marks_px):
            expect(steps.locator("li.done")).to_have_count(0)
            place(page, f"P{k + 1}", u, v)
        expect(steps.locator("li.done b")).to_have_text("Mark four points")
        expect(steps.locator("li:not(.done) .dim")).to_contain_text("Taped length (L)")

        steps.locator("summary").click()
        expect(steps.locator("ol")).to_be_hidden()
        place(page, "P5", 300, 300)
        expect(steps.locator("ol")).to_be_hidden()  # as it was left
        page.keyboard.press("?")
        page.get_by_role("button", name="Show the first steps").click()
        expect(page.get_by_role("dialog")).to_be_hidden()
        expect(steps.locator("ol")).to_be_visible()

        known = page.get_by_role("radio", name="Taped length")
        expect(known).to_have_attribute(
            "title",
            "Taped length (L): a length that somebody measured with a tape on the ground; "
            "type what the tape read, and everything is scaled by it; without a reading it is a "
            "wanted distance",
        )
        wanted = page.get_by_role("radio", name="Distance")
        expect(wanted).to_have_attribute("data-use", "wanted")
        pictures = page.locator("[data-tool] svg").evaluate_all(
            "all => all.map((one) => one.dataset.icon)"
        )
        tools = page.locator("[data-tool]").evaluate_all(
            "all => all.map((one) => one.dataset.tool)"
        )
        assert pictures == tools
        assert not open_page.errors
