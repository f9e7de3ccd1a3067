"""A click is of the point that is expected there, else of a new one; what is not clear is asked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import pytest
from labels_to_place import ALONE, LABELS, MOVING, TWIN, TWIN_ASIDE_PX, write_survey
from opened_pages import PageOpener
from picking_pages import click_mark, drawn, eventually, show_photo, to_page
from picking_server import Served, served
from playwright.sync_api import Browser, Locator, Page, expect

from uavgram.picking.document.state import State

EMPTY = (1500.0, 60.0)
"""A place in the second photo at which nothing is expected."""


@dataclass
class Opened:
    """A page with the second photo, and where each label is in it: also those to be picked."""

    page: Page
    server: Served
    places: dict[str, tuple[float, float]]
    errors: list[str]

    @property
    def state(self) -> State:
        return self.server.picking.state

    @property
    def question(self) -> Locator:
        return self.page.get_by_role("alertdialog")

    def is_picked(self, label: str) -> bool:
        return self.state.pick("photo1.jpg", label) is not None

    def click(self, u: float, v: float) -> None:
        self.page.mouse.click(*to_page(self.page, u, v))

    def choose(self, label: str) -> None:
        """Select a point in the table."""
        row = self.page.locator(f'[data-row="point {label}"]')
        row.locator('[name="select"]').evaluate("button => button.click()")  # wherever it scrolls
        expect(self.page.locator("#label")).to_have_value(label)

    def settle(self) -> None:
        """Wait until the page has the adjustment of what is picked."""

        def is_settled() -> bool:
            shown = self.page.locator("body").evaluate("body => ({...body.dataset})")
            return {shown["version"], shown["liveFor"]} == {str(self.server.picking.version)}

        eventually(self.page, is_settled)
        expect(self.page.locator("#mode")).to_have_attribute("data-mode", "adjusted")

    def undo(self, state: State) -> None:
        """Go back to a state, and wait for its adjustment."""
        past = self.server.picking.session.past
        for left in reversed(range(past.index(state) if state in past else len(past), len(past))):
            self.page.locator("#undo").click()
            eventually(self.page, partial(self._has_steps, left))
        assert self.state == state
        self.settle()

    def _has_steps(self, count: int) -> bool:
        return len(self.server.picking.session.past) == count


@pytest.fixture(scope="module")
def opened_once(
    chromium: Browser, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Opened, State]]:
    project, places = write_survey(tmp_path_factory.mktemp("by_place"))
    opener = PageOpener(chromium)
    with served(project) as server:
        page = opener(server)
        show_photo(page, 1)
        opened = Opened(page, server, places, opener.errors)
        opened.settle()
        yield opened, server.picking.state
        opener.close()


@pytest.fixture
def opened(opened_once: tuple[Opened, State]) -> Iterator[Opened]:
    """The page as it began: what a test changes is taken back."""
    one, begun = opened_once
    one.choose("P1")
    yield one
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("p")
    one.undo(begun)
    assert not one.errors


def test_a_click_where_a_point_is_expected_is_of_that_point_whatever_is_selected(
    opened: Opened,
) -> None:
    first, second = ALONE[2], ALONE[3]
    opened.choose("P1")
    opened.click(*opened.places[first])
    expect(opened.page.locator(f'.mark.selected[data-label="{first}"]')).to_have_count(1)
    expect(opened.page.locator("#notice")).to_contain_text(f"This is {first}: it was expected")
    opened.page.keyboard.press("l")  # a length that is drawn between points takes them, too
    click_mark(opened.page, first)
    opened.click(*opened.places[second])
    form = opened.page.get_by_role("form", name="New length")
    expect(form).to_contain_text(f"{first} – {second}")
    opened.page.get_by_role("button", name="No, a new point").click()
    expect(form).to_contain_text(f"{first} – P{LABELS + 1}")
    eventually(opened.page, lambda: opened.is_picked(f"P{LABELS + 1}"))
    assert opened.is_picked(first)
    assert not opened.is_picked(second)


def test_a_click_elsewhere_is_a_new_point_though_an_old_one_is_selected(opened: Opened) -> None:
    opened.click(*opened.places[ALONE[2]])
    offer = opened.page.locator("#notice [name=offer]")  # is of the last change alone:
    expect(offer).to_have_text(f"No, a new point: P{LABELS + 1}")
    expect(opened.page.locator(f'.mark.selected[data-label="{ALONE[2]}"]')).to_have_count(1)
    opened.page.keyboard.press("ArrowRight")
    expect(offer).to_have_count(0)
    opened.choose(ALONE[4])
    opened.click(*EMPTY)
    expect(opened.page.locator("#notice")).to_contain_text(f"{ALONE[4]} was expected")
    eventually(opened.page, lambda: opened.is_picked(f"P{LABELS + 1}"))
    assert not opened.is_picked(ALONE[4])


def test_a_typed_name_far_from_its_place_is_asked_about_before_anything_is_sent(
    opened: Opened,
) -> None:
    page, label, before = opened.page, ALONE[4], opened.state
    for answer in ("Escape", "2"):
        page.locator("#label").fill(label)
        opened.click(*EMPTY)
        expect(opened.question).to_contain_text(f"{label} was expected")
        first = opened.question.get_by_role("button").first
        expect(first).to_contain_text(f"It is {label} all the same")
        expect(page.locator("g.questioned")).to_have_count(1)
        assert opened.state == before
        page.keyboard.press(answer)
        expect(opened.question).to_have_count(0)
    eventually(page, lambda: opened.is_picked(f"P{LABELS + 1}"))
    opened.undo(before)
    page.locator("#label").fill(label)
    opened.click(*EMPTY)
    expect(opened.question).to_be_visible()
    opened.click(EMPTY[0], EMPTY[1] + 400)  # a click elsewhere is no answer, and no point
    expect(page.locator("#notice")).to_contain_text("This click marked nothing")
    expect(opened.question).to_be_visible()
    click_mark(page, "P16")
    expect(opened.question).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator("#notice")).to_contain_text("nothing was marked at the ring")
    expect(page.locator("g.questioned")).to_have_count(0)
    assert opened.state == before
    page.locator("#label").fill("kerb")  # a name of one's own stands, wherever the click is
    opened.click(*opened.places[label])
    eventually(page, lambda: opened.is_picked("kerb"))
    assert not opened.is_picked(label)


def test_a_click_that_may_mean_two_points_is_asked_about(opened: Opened) -> None:
    u, v = opened.places[ALONE[0]]
    opened.click(u + TWIN_ASIDE_PX / 2, v)
    expect(opened.question.get_by_role("button")).to_have_count(4)
    opened.question.get_by_role("button", name=TWIN).click()
    eventually(opened.page, lambda: opened.is_picked(TWIN))
    assert not opened.is_picked(ALONE[0])


def test_where_nothing_tells_where_the_last_point_is_it_is_not_taken_without_a_question(
    opened: Opened,
) -> None:
    page, label = opened.page, f"P{LABELS + 1}"
    show_photo(page, 0)
    opened.click(*EMPTY)
    expect(page.locator(f'.mark.selected[data-label="{label}"]')).to_have_count(1)
    page.keyboard.press("q")  # one photo does not tell a height, so nor where it is in another
    eventually(page, lambda: any(pick.is_free for pick in opened.state.picks))
    opened.settle()
    show_photo(page, 1)
    opened.click(*EMPTY)
    expect(opened.question).to_contain_text(f"Is this {label} again?")
    for key in ("ArrowDown", "ArrowDown", "Enter"):
        page.keyboard.press(key)
    eventually(page, lambda: opened.is_picked(f"P{LABELS + 2}"))
    assert not opened.is_picked(label)


def test_what_moves_is_not_expected_where_it_was(opened: Opened) -> None:
    opened.click(*opened.places[MOVING[0]])
    eventually(opened.page, lambda: opened.is_picked(f"P{LABELS + 1}"))
    assert not opened.is_picked(MOVING[0])


def test_labels_are_merged_swapped_and_split_in_the_panel(opened: Opened) -> None:
    page, before = opened.page, opened.state
    opened.choose("P23")
    page.get_by_text("Merge, swap, split").click()
    form = page.get_by_role("form", name="Point P23")
    form.get_by_role("combobox").select_option("P24")
    form.get_by_role("button", name="merge").click()
    page.keyboard.press("1")  # the picks of P24 stay
    expect(page.locator("#notice")).to_contain_text("as two points in S1")
    expect(page.locator("#label")).to_have_value("P23")
    drawn(page)  # the form, anew: what was refused is not shown as if it held
    form.get_by_role("combobox").select_option("P22")
    form.get_by_role("button", name="merge").click()
    expect(opened.question).to_contain_text("both picked in photo0.jpg. Which pick stays there?")
    page.keyboard.press("2")
    eventually(page, lambda: "P23" not in opened.state.labels)
    stays, gone = opened.state.pick("photo0.jpg", "P22"), before.pick("photo0.jpg", "P23")
    assert stays is not None
    assert gone is not None
    assert (stays.u_px, stays.v_px) == (gone.u_px, gone.v_px)
    opened.undo(before)

    opened.choose("P22")
    form = page.get_by_role("form", name="Point P22")
    form.get_by_role("combobox").select_option("P23")
    form.get_by_role("button", name="in this photo").click()
    expect(page.locator("#notice")).to_contain_text("Neither P22 nor P23 is picked in photo1")
    form.get_by_role("button", name="everywhere").click()
    eventually(page, lambda: opened.state != before)
    swapped = opened.state.pick("photo0.jpg", "P22")
    assert swapped is not None
    assert (swapped.u_px, swapped.v_px) == (gone.u_px, gone.v_px)
    opened.undo(before)

    opened.choose("P1")
    form = page.get_by_role("form", name="Point P1")
    form.get_by_label("its name").fill("kerb")
    form.get_by_role("button", name="Split").click()
    eventually(page, lambda: opened.is_picked("kerb"))
    assert opened.state.pick("photo0.jpg", "P1") is not None


REGIONS = """async () => {
    const { aside, isTelling, meant, nearness } = await import("/page/photos/regions.js");
    const at = (label, major_px, minor_px, turn_deg = 0, pixel_px = [100, 100]) =>
        ({ image: 0, label, pixel_px, spread: { major_px, minor_px, turn_deg } });
    const far = at("far", 20, 2, 90);
    const inside = (one, u, v, scale) => nearness(one, u, v, scale).inside;
    const photo = { width_px: 2000, height_px: 1500 };
    const tells = (...region) => isTelling(nearness(at("A", ...region), 100, 100, 1), photo);
    const means = (all, u, v) => meant(all.map((one) => nearness(one, u, v, 1)));
    return {
        along: [inside(far, 100, 170, 1), inside(far, 100, 180, 1)],
        across: [inside(far, 109, 100, 1), inside(far, 112, 100, 1)],
        least: [inside(at("sharp", 0, 0), 107.9, 100, 1), inside(at("sharp", 0, 0), 108.1, 100, 1),
            inside(at("sharp", 0, 0), 179, 100, 0.1), inside(at("sharp", 0, 0), 101, 100, 16)],
        unknown: inside(at("unknown", null, null), 100, 100, 1),
        sharp: means([at("wide", 200, 200, 0, [102, 100]), at("sharp", 1, 1)], 102, 100),
        unclear: means([at("A", 5, 5), at("B", 5, 5, 0, [110, 100])], 104, 100),
        none: means([at("A", 5, 5)], 200, 100),
        telling: [tells(0, 0), tells(400, 5), tells(90, 90), tells(60, 60, 0, [200, 100])],
        words: [aside([30, 40]), aside([-30, 0]), aside([0, -5])],
    };
}"""


def test_a_region_is_999_of_1000_and_no_smaller_than_a_click_needs(opened: Opened) -> None:
    found = opened.page.evaluate(REGIONS)
    assert found == {
        "along": [True, False],
        "across": [True, False],
        "least": [True, False, True, False],
        "unknown": False,
        "sharp": ["sharp"],
        "unclear": ["A", "B"],
        "none": [],
        "telling": [True, True, False, False],
        "words": [
            "50 px to the lower right of here",
            "30 px to the left of here",
            "5 px above here",
        ],
    }


def test_a_point_that_was_asked_for_by_name_is_placed_without_a_question(opened: Opened) -> None:
    asked = opened.page.locator(f'[data-row^="asked {TWIN} "]')
    go = asked.locator('[name="go"]').first
    u, v = opened.places[ALONE[0]]
    go.evaluate("button => button.click()")  # wherever it is in a folded list
    opened.page.keyboard.press("f")
    opened.click(u + TWIN_ASIDE_PX / 2, v)  # where the other one is expected, too
    eventually(opened.page, lambda: opened.is_picked(TWIN))
    expect(opened.question).to_have_count(0)
    opened.page.locator("#undo").click()
    eventually(opened.page, lambda: not opened.is_picked(TWIN))
    opened.settle()
    go.evaluate("button => button.click()")
    opened.page.keyboard.press("f")
    opened.click(*opened.places[ALONE[1]])  # and elsewhere it is asked about
    expect(opened.question).to_contain_text(f"{TWIN} was expected")
