"""The page says what the next click does, and the click does it."""

from __future__ import annotations

from opened_pages import PageOpener
from picking_pages import click_mark, eventually, place, to_page
from picking_projects import PickingProject
from picking_server import Served, served
from playwright.sync_api import Locator, Page, expect

NEAR_PX = 10
"""On the screen: a click so near to a mark leads to a question."""


def cue(page: Page) -> Locator:
    """What is written beside the pointer."""
    return page.locator(".pane .cue")


def hint(page: Page) -> Locator:
    """What the page says in one line."""
    return page.locator("#tab-measure .hint")


def click(page: Page, x: float, y: float, does: str) -> None:
    """Look at what a click will do, then click."""
    page.mouse.move(x, y)
    expect(cue(page)).to_have_text(does)
    page.mouse.click(x, y)


def labels(server: Served) -> set[str]:
    return {pick.label for pick in server.picking.state.picks}


def test_what_a_click_does_is_said_before_it_is_made(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server, 1024, 700)
        places = [to_page(page, *at) for at in planted.marks_px]
        expect(hint(page)).to_have_text("Next click: marks a new point, P1.")
        page.keyboard.press("l")
        expect(hint(page)).to_contain_text("Next click: marks a new point, P1 (Taped length,")
        click(page, *places[0], "marks a new point, P1 (Taped length, point 1 of 2)")
        eventually(page, lambda: labels(server) == {"P1"})
        expect(cue(page)).to_have_text("takes nothing: choose another point")
        x, y = places[0]
        page.mouse.move(x + NEAR_PX, y)
        expect(cue(page)).to_have_text("asks which point this is")
        click(page, *places[1], "marks a new point, P2 (Taped length, point 2 of 2)")
        untaped = "computes P1 \u2013 P2, as no reading is typed; then "
        expect(hint(page)).to_have_text(
            f"Next click: {untaped}marks a new point, P3 (Taped length, point 1 of 2)."
        )
        page.keyboard.type("7,5x")
        expect(hint(page)).to_contain_text("marks nothing before the form at the side is corrected")
        page.keyboard.press("Backspace")
        click(
            page,
            *places[2],
            "takes 7.5 m for L1; then marks a new point, P3 (Taped length, point 1 of 2)",
        )
        eventually(page, lambda: [one.length_m for one in server.picking.state.lines] == [7.5])
        click(page, *places[0], "takes P1 (Taped length, point 2 of 2)")
        page.mouse.move(*places[1])
        expect(cue(page)).to_have_text(
            "computes P3 \u2013 P1, as no reading is typed; then takes P2 (Taped length, "
            "point 1 of 2)"
        )
        page.keyboard.press("Escape")
        page.keyboard.press("p")
        expect(cue(page)).to_have_text("selects P2")
        page.locator("#tab-measure").hover()
        expect(cue(page)).to_be_hidden()
        assert not open_page.errors


def test_a_drawing_ends_without_enter(planted: PickingProject, open_page: PageOpener) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        for label, at in zip("ABCD", planted.marks_px, strict=False):
            place(page, label, *at)
        requests = server.picking.state.requests
        page.keyboard.press("y")
        for label in "ABC":
            click_mark(page, label)
        expect(cue(page)).to_have_text("ends the drawing")
        click_mark(page, "C")
        page.keyboard.press("a")
        for label in "ABC":
            click_mark(page, label)
        expect(hint(page)).to_contain_text("Enter, or another tool ends it")
        page.keyboard.press("d")
        eventually(page, lambda: len(server.picking.state.requests) == 2)
        requests = server.picking.state.requests
        assert [(one.kind, one.points) for one in requests] == [
            ("polyline", ("A", "B", "C")),
            ("area", ("A", "B", "C")),
        ]
        assert not open_page.errors


def test_letters_beside_an_open_form_belong_to_its_number(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.keyboard.press("l")
        for at in planted.marks_px[:2]:
            page.mouse.click(*to_page(page, *at))
        field = page.get_by_role("form", name="New length P1 to P2").get_by_label("Length")
        photo = page.locator(".pane svg.marks")
        photo.focus()
        for letter in "kf":
            page.keyboard.press(letter)
            expect(page.locator("#notice")).to_contain_text(f"{letter.upper()} was not used")
        expect(page.locator("#linked")).to_have_attribute("aria-pressed", "false")
        page.keyboard.type("750")
        photo.focus()
        page.keyboard.type("cm")
        expect(field).to_have_value("750cm")
        page.keyboard.press("Enter")
        eventually(page, lambda: [one.length_m for one in server.picking.state.lines] == [7.5])
        assert not open_page.errors
