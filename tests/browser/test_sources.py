"""Who made a pick is drawn and told on the page; a person's pick takes its matches along."""

from __future__ import annotations

from pathlib import Path

from opened_pages import PageOpener
from pick_pages import small_project
from picking_pages import click_mark, eventually, show_photo
from picking_server import served
from playwright.sync_api import expect

PICKS = (
    "image,label,u_px,v_px,sigma_px,source,score,from_image,from_u_px,from_v_px\n"
    "P1.jpg,A,200,150,,,,,,\n"
    "P2.jpg,A,260,210,0.06,match,0.934,P1.jpg,200,150\n"
    "P2.jpg,T,400,300,0.05,target,0.99,,,\n"
)


def test_who_made_a_pick_is_seen_and_a_persons_takes_its_matches_along(
    tmp_path: Path, open_page: PageOpener
) -> None:
    project = small_project(tmp_path)
    (tmp_path / "picks.csv").write_text(PICKS, encoding="utf-8")
    with served(project) as server:

        def sources() -> set[tuple[str, str, str]]:
            return {(pick.image, pick.label, pick.source) for pick in server.picking.state.picks}

        page = open_page(server)
        begun = sources()
        show_photo(page, 0)
        own = page.locator('.mark[data-label="A"]')
        expect(own.locator("title")).to_have_text("A: picked by hand, ± 1 px")
        show_photo(page, 1)
        found = page.locator(".mark.found.match")
        told = "match found by the program from the pick in P1.jpg, ± 0.06 px of the matching"
        expect(found.locator("title")).to_have_text(f"A: {told}, score 0.93")
        expect(page.locator(".mark.found.target title")).to_contain_text("T: target found by the")
        shapes = page.locator(".mark.found > path.thin").evaluate_all(
            "all => all.map(one => one.getAttribute('d'))"
        )
        assert len(set(shapes)) == 2
        click_mark(page, "A")
        expect(page.locator("form .made")).to_contain_text("Move it, and it is yours")
        page.keyboard.press("ArrowRight")
        eventually(page, lambda: ("P2.jpg", "A", "hand") in sources())
        expect(found).to_have_count(0)
        page.keyboard.press("Control+z")
        expect(found).to_have_count(1)
        show_photo(page, 0)
        click_mark(page, "A")
        page.keyboard.press("Delete")
        expect(page.locator("#notice")).to_contain_text("match that was found from A went with it")
        eventually(page, lambda: sources() == {("P2.jpg", "T", "target")})
        page.keyboard.press("Control+z")
        eventually(page, lambda: sources() == begun)
        assert not open_page.errors
