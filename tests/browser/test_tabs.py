"""Tabs of the page: camera and calibration, frames, outputs; and files that others change."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from open_projects import change, opened
from opened_pages import PageOpener
from pick_pages import small_project
from picking_pages import drawn, eventually, place, show_photo, to_page
from picking_server import served
from playwright.sync_api import expect


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return small_project(tmp_path)


def test_a_camera_is_calibrated_on_a_folder_from_the_page_and_used(
    project: Path, open_page: PageOpener, data_dir: Path
) -> None:
    board = project.parent / "board"
    board.mkdir()
    for k in range(1, 7):
        shutil.copy(data_dir / "opencv_chess" / f"left{k:02}.jpg", board)
    camera = project.parent / "camera.yaml"
    loose = camera.read_text(encoding="utf-8").replace("3.0, 3.0, 3.0, 3.0", "30, 30, 30, 30")
    camera.write_text(loose, encoding="utf-8")
    with served(project) as server:
        page = open_page(server)
        page.get_by_role("tab", name="Camera").click()
        panel = page.get_by_role("tabpanel", name="Camera")
        expect(panel).to_contain_text("The focal length is known to 5 % only")
        expect(panel).to_contain_text("The principal point is known to 30 px only")
        expect(panel.get_by_role("table", name="What the lens does")).to_contain_text("600.000")
        form = panel.get_by_role("form", name="Calibration")
        form.get_by_label("Folder").select_option("board: 6 photo files, 640 × 480 px")
        form.get_by_role("button", name="Start").click()
        report = panel.get_by_role("link", name="Open its report")
        expect(report).to_be_visible()
        expect(panel).to_contain_text("calibration/camera.yaml")
        with page.context.expect_page() as opened:
            report.click()
        expect(opened.value.locator("body")).to_contain_text("6 of 6 photos")
        panel.get_by_role("button", name="Use it").click()
        expect(panel.get_by_role("table", name="What the lens does")).not_to_contain_text("600.0")
        expect(panel).to_contain_text("calibrated from 6 photos of a board")
        assert not open_page.errors
        assert not open_page.strangers
    assert "camera: calibration/camera.yaml" in project.read_text(encoding="utf-8")


def test_a_table_that_another_program_changed_is_reloaded_at_a_click(
    project: Path, open_page: PageOpener
) -> None:
    with served(project) as server:
        page = open_page(server)
        place(page, "ours", 100, 100)
        bar = page.get_by_role("alert").filter(has_text="changed or removed by another program")
        expect(page.locator("#saved")).to_have_text("saved")
        picks = project.parent / "picks.csv"
        picks.write_text(picks.read_text(encoding="utf-8") + "P1.jpg,theirs,300,200,,\n")
        expect(bar).to_contain_text("picks.csv")
        bar.get_by_role("button", name="Reload").click()
        expect(page.locator('.mark[data-label="theirs"]')).to_be_visible()
        expect(page.locator('.mark[data-label="ours"]')).to_be_visible()
        expect(bar).to_be_hidden()
        expect(page.locator("#undo")).to_be_disabled()
        place(page, "later", 200, 300)
        expect(page.locator("#undo")).to_be_enabled()
        assert not open_page.errors
    assert "theirs" in picks.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("button", "marks", "end"), [("Take", 1, "taken"), ("Discard", 0, "discarded")]
)
def test_what_an_earlier_session_could_not_save_is_offered_at_a_click(
    project: Path, open_page: PageOpener, button: str, marks: int, end: str
) -> None:
    with opened(project, killed=True) as (earlier, _):
        change(earlier, "place", image=0, label="lost", u_px=100, v_px=100)
    (project.parent / "picks.csv").write_text("image,label,u_px,v_px\nP2.jpg,theirs,7,8\n")
    with served(project) as server:
        page = open_page(server)
        bar = page.get_by_role("alert").filter(has_text="before it could save a change")
        bar.get_by_role("button", name=button).click()
        expect(bar).to_be_hidden()
        show_photo(page, 0)
        expect(page.locator('.mark[data-label="lost"]')).to_have_count(marks)
        if marks:
            expect(page.locator("#undo")).to_be_enabled()
        assert not open_page.errors
    assert [path.suffix for path in (project.parent / "out").glob("pick-journal-*")] == [f".{end}"]
    assert ("lost" in (project.parent / "picks.csv").read_text()) == bool(marks)


HEADER_SEEN = """() => {
    const words = (id) => document.getElementById(id).textContent;
    window.seen = [];
    const look = () => window.seen.push(`${words("mode")} ${words("saved")}`);
    const watched = {childList: true, characterData: true, subtree: true};
    new MutationObserver(look).observe(document.querySelector("header"), watched);
}"""


def test_the_page_never_says_saved_while_it_has_no_connection(
    project: Path, open_page: PageOpener
) -> None:
    with served(project) as server:
        page = open_page(server)
        place(page, "A", 100, 100)
        expect(page.locator("#saved")).to_have_text("saved")
        page.evaluate(HEADER_SEEN)
    expect(page.locator("#mode")).to_have_text("no connection")
    expect(page.locator("#saved")).to_have_text("")
    page.keyboard.press("x")  # draws other parts of the page: nothing may call it saved
    expect(page.get_by_role("tabpanel", name="Photos")).to_be_visible()
    seen = page.evaluate("window.seen")
    assert any("no connection" in words for words in seen)
    assert not [words for words in seen if "no connection" in words and "saved" in words]


def test_outputs_are_one_click_away_and_say_when_they_are_old(
    project: Path, open_page: PageOpener
) -> None:
    out = project.parent / "out"

    def run(_: Path) -> None:
        (out / "report.html").write_text("<h1>What was measured</h1>", encoding="utf-8")
        (out / "measurements.csv").write_text("name,value\n", encoding="utf-8")
        (out / "recording.rrd").write_bytes(b"RRF2")

    with served(project, run=run) as server:
        page = open_page(server)
        foot = page.locator("#outputs")
        expect(foot).to_contain_text("none yet")
        page.keyboard.press("w")
        expect(foot).to_contain_text("up to date")
        results = page.get_by_role("tabpanel", name="Results")
        with page.context.expect_page() as opened:
            results.get_by_role("link", name="Report").first.click()
        expect(opened.value.get_by_role("heading")).to_have_text("What was measured")
        with page.expect_download() as saved:
            results.get_by_role("link", name="Measurements (CSV)").click()
        assert saved.value.suggested_filename == "measurements.csv"
        recording = results.get_by_role("link", name="Recording in the Rerun viewer")
        assert (recording.get_attribute("href") or "").partition("?")[0] == "/recording"
        page.get_by_role("tab", name="Measure").click()
        place(page, "A", 100, 100)
        expect(foot).to_contain_text("older than what you see")
        assert not open_page.strangers


def test_results_are_not_called_old_because_the_program_has_ended(
    project: Path, open_page: PageOpener
) -> None:
    def run(_: Path) -> None:
        (project.parent / "out" / "report.html").write_text("<h1>Report</h1>", encoding="utf-8")

    with served(project, run=run) as server:
        page = open_page(server)
        page.keyboard.press("w")
        expect(page.locator("#outputs")).to_contain_text("up to date")
        results = page.get_by_role("tabpanel", name="Results")
        expect(results.locator(".older")).to_have_count(0)
    expect(page.locator("#mode")).to_have_text("no connection")
    expect(results.locator(".older")).to_contain_text("No connection to the program")
    expect(results).not_to_contain_text("older than your marks")


def test_the_tab_of_frames_tells_matching_clock_and_seeds(
    data_dir: Path, tmp_path: Path, open_page: PageOpener
) -> None:
    survey = tmp_path / "survey"
    shutil.copytree(data_dir / "wind_oblique", survey, ignore=shutil.ignore_patterns("out"))
    (survey / "measure.csv").write_text("name,kind,points\n")
    with served(survey / "project.yaml") as server:
        page = open_page(server)
        page.get_by_role("tab", name="Photos").click()
        panel = page.get_by_role("tabpanel", name="Photos")
        expect(panel).to_contain_text("Camera clock minus UTC: 4.3")  # the twin's clock: 4.37 s
        rows = panel.get_by_role("table", name="Photos").locator("tbody tr")
        expect(rows).to_have_count(11)
        expect(rows.nth(3)).to_contain_text("fitted")
        panel.get_by_role("button", name="Show IMG_0028.jpg").click()
        expect(page.locator(".pane")).to_have_attribute("data-image", "IMG_0028.jpg")
        assert not open_page.errors


def test_a_reload_keeps_tool_photos_and_view_of_this_tab(
    project: Path, open_page: PageOpener
) -> None:
    with served(project) as server:
        page = open_page(server)
        page.keyboard.press("Control+2")
        panes = page.locator(".pane")
        panes.nth(1).get_by_label("Photo", exact=True).select_option("P1.jpg")
        panes.nth(0).get_by_label("Photo", exact=True).select_option("P2.jpg")
        page.mouse.move(*to_page(page, 300, 200))
        page.mouse.wheel(0, -600)
        page.keyboard.press("d")
        eventually(page, lambda: float(panes.nth(0).get_attribute("data-scale") or 0) > 1)
        drawn(page)
        names = ("image", "scale", "left", "top")
        before = [[panes.nth(k).get_attribute(f"data-{name}") for name in names] for k in (0, 1)]
        page.reload()
        expect(page.get_by_role("radio", name="Distance")).to_be_checked()
        expect(panes).to_have_count(2)
        for pane, values in enumerate(before):
            for name, value in zip(names, values, strict=True):
                expect(panes.nth(pane)).to_have_attribute(f"data-{name}", value or "")
        page.keyboard.press("Escape")
        expect(page.get_by_role("radio", name="Distance")).not_to_be_checked()
        page.get_by_role("tab", name="Camera").click()
        page.reload()
        expect(page.get_by_role("tab", name="Camera")).to_have_attribute("aria-selected", "true")
        expect(page.locator('[data-tool="pick"]')).to_be_checked()
        assert not open_page.errors

        other = page.context.new_page()  # a tab of its own begins as always
        other.goto(server.guard.address())
        expect(other.locator(".pane")).to_have_count(1)
        expect(other.locator('[data-tool="pick"]')).to_be_checked()


def test_a_reload_keeps_a_distance_of_which_one_point_is_clicked(
    project: Path, open_page: PageOpener
) -> None:
    with served(project) as server:
        page = open_page(server)
        page.keyboard.press("d")
        page.mouse.click(*to_page(page, 300, 200))
        expect(page.locator(".mark[data-label]")).to_have_count(1)
        eventually(page, (project.parent / "picks.csv").is_file)
        page.reload()
        expect(page.locator(".mark[data-label]")).to_have_count(1)
        expect(page.get_by_role("radio", name="Distance")).to_be_checked()
        expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
        page.mouse.click(*to_page(page, 400, 220))
        eventually(page, (project.parent / "measure.csv").is_file)
        assert "distance" in (project.parent / "measure.csv").read_text(encoding="utf-8")
        assert not open_page.errors
