"""Fingers: a tap places, one pans, two zoom, and one that rests gets the magnifier."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from opened_pages import PageOpener
from picking_pages import drawn, eventually, to_page
from picking_projects import PickingProject
from picking_server import served
from playwright.sync_api import Page, expect

# A finger rests when the test says so, however long the machine takes between two touches.
RESTS_WHEN_TOLD = """() => {
    const later = window.setTimeout;
    window.setTimeout = (act, ms, ...more) => {
        if (ms !== 500) return later(act, ms, ...more);
        window.rest = act;
        return 0;
    };
}"""
Point = tuple[float, float]
Touch = Callable[..., None]


@pytest.fixture
def touching() -> Callable[[Page], Touch]:
    """Touches of a page, as its browser gets them: ``touch("touchStart", (x, y), ...)``."""

    def of(page: Page) -> Touch:
        session = page.context.new_cdp_session(page)

        def touch(kind: str, *places: Point) -> None:
            points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(places)]
            session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
            drawn(page)

        return touch

    return of


def scale(page: Page) -> float:
    return float(page.locator(".pane").get_attribute("data-scale") or "nan")


def test_the_page_works_with_fingers(
    planted: PickingProject, open_page: PageOpener, touching: Callable[[Page], Touch]
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        page.evaluate(RESTS_WHEN_TOLD)
        touch = touching(page)
        loupe = page.locator(".loupe")
        mark, other, middle, _ = planted.marks_px

        touch("touchStart", to_page(page, *mark))
        touch("touchEnd")
        expect(page.locator(".mark")).to_have_count(1)
        pick = server.picking.state.pick("photo.jpg", "P1")
        assert pick is not None
        assert (pick.u_px, pick.v_px) == pytest.approx(tuple(mark), abs=1.0 / scale(page))

        # One finger on the photo: it goes along, and nothing is placed.
        x, y = to_page(page, *middle)
        touch("touchStart", (x, y))
        for k in range(1, 4):
            touch("touchMove", (x + 20 * k, y + 10 * k))
        touch("touchEnd")
        assert to_page(page, *middle) == pytest.approx((x + 60, y + 30), abs=1.5)

        # Two: what lies under them stays under them.
        x, y = to_page(page, *middle)
        before = scale(page)
        touch("touchStart", (x, y))
        touch("touchStart", (x, y), (x + 100, y))
        for k in range(1, 6):
            touch("touchMove", (x, y), (x + 100 + 20 * k, y))
        touch("touchEnd")
        assert scale(page) == pytest.approx(2 * before, rel=0.02)
        assert to_page(page, *middle) == pytest.approx((x, y), abs=1.5)
        expect(page.locator(".mark")).to_have_count(1)

        # On a mark: it is moved.
        x, y = to_page(page, *mark)
        touch("touchStart", (x, y))
        for k in range(1, 4):
            touch("touchMove", (x + 10 * k, y))
        expect(loupe).to_be_visible()
        touch("touchEnd")
        expect(loupe).to_be_hidden()

        def moved_px() -> float:
            now = server.picking.state.pick("photo.jpg", "P1")
            assert now is not None
            return now.u_px - pick.u_px

        eventually(page, lambda: abs(moved_px() - 30 / scale(page)) < 1.5)

        # One that rests: the magnifier, and a point where it is lifted.
        x, y = to_page(page, *other)
        touch("touchStart", (x - 30, y))
        page.evaluate("window.rest()")
        expect(loupe).to_be_visible()
        touch("touchMove", (x, y))
        expect(page.locator(".mark")).to_have_count(1)
        touch("touchEnd")
        expect(page.locator(".mark")).to_have_count(2)
        expect(loupe).to_be_hidden()
        placed = server.picking.state.pick("photo.jpg", "P2")
        assert placed is not None
        assert (placed.u_px, placed.v_px) == pytest.approx(tuple(other), abs=1.0 / scale(page))
        assert not open_page.errors
