"""Automatic labels avoid names that exist; the sample shows its tape; sure finds go at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from large_photos import write_large_project
from opened_pages import PageOpener
from picking_pages import click_mark, eventually, place, to_page, wait_until_adjusted
from picking_projects import PickingProject
from picking_server import Served, served
from playwright.sync_api import expect

from uavgram.synthetic.demo import make_sample
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import simulate

WINDOWS = [(1366, 768), (1920, 1080)]
both_windows = pytest.mark.parametrize(
    "window", WINDOWS, ids=lambda window: f"{window[0]}x{window[1]}"
)
MIDDLE_PHOTO = "IMG_0005.jpg"


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample, with what its middle photo shows picked there."""
    project = make_sample(tmp_path_factory.mktemp("sample") / "sample")
    picks = simulate(Scenario()).picks
    rows = [
        f"{image},{label},{u:.2f},{v:.2f}"
        for image, label, (u, v) in zip(
            picks.image, picks.label, picks.pixel_px.tolist(), strict=True
        )
        if image == MIDDLE_PHOTO and label != "P1"
    ]
    project.with_name("picks.csv").write_text("\n".join(["image,label,u_px,v_px", *rows]) + "\n")
    return project


@pytest.fixture
def sampled(sample: Path) -> Iterator[Served]:
    table = sample.with_name("picks.csv")
    before = table.read_text()
    with served(sample) as server:
        yield server
    table.write_text(before)


@both_windows
def test_labels_of_all_tables_are_avoided(
    planted: PickingProject, open_page: PageOpener, window: tuple[int, int]
) -> None:
    folder = planted.path.parent
    (folder / "lines.csv").write_text("name,from,to,length_m,sigma_m\nL,P1,P2,5,0.01\n")
    (folder / "measure.csv").write_text("name,kind,points\np9,distance,P3;P4\n")
    known = "label,east_m,north_m,up_m,sigma_m\n"
    (folder / "control.csv").write_text(f"{known}P5,0,0,0,0.02\n")
    (folder / "check.csv").write_text(f"{known}P6,5,0,0,0.02\n")
    (folder / "known.csv").write_text("name,kind,points,value,sigma\nK,distance,P7;P8,3,0.1\n")
    with planted.path.open("a") as project:
        project.write("control: control.csv\ncheck: check.csv\nknown: known.csv\n")
    with served(planted.path) as server:
        page = open_page(server, *window)
        expect(page.locator("#label")).to_have_value("P10")  # P9 would look like p9
        offered = page.locator("#known-labels option").evaluate_all("all => all.map(o => o.value)")
        assert {f"P{k}" for k in range(1, 9)} <= set(offered)
        page.mouse.click(*to_page(page, *planted.marks_px[0]))
        eventually(page, lambda: server.picking.state.labels == ("P10",))
        page.mouse.click(*to_page(page, *planted.marks_px[1]))
        eventually(page, lambda: server.picking.state.labels == ("P10", "P11"))


@both_windows
def test_the_sample_avoids_what_is_painted_and_shows_what_was_taped(
    sampled: Served, sample: Path, open_page: PageOpener, window: tuple[int, int]
) -> None:
    page = open_page(sampled, *window)
    painted = {point.label for point in Scenario().points}
    label = page.locator("#label").input_value()
    assert label.startswith("P")
    assert label not in painted
    readings = page.locator(".readings")
    readings.get_by_text("What was taped").click()
    expect(readings).to_contain_text(str(sample.with_name("taped.txt")))
    expect(readings).to_contain_text("R3 to R4   13.00 m")
    expect(readings.locator("pre")).to_be_in_viewport()


@both_windows
def test_a_button_accepts_all_that_was_found_surely_and_nothing_else(
    sampled: Served, open_page: PageOpener, window: tuple[int, int]
) -> None:
    page = open_page(sampled, *window)
    wait_until_adjusted(page)
    page.get_by_role("table", name="Found by the program").wait_for()
    expect(page.get_by_role("button", name="Accept all found surely")).to_be_enabled()  # all found
    told = sampled.picking.initial_state()["proposals"]["found"]
    sure = {(one["image"], one["label"]) for one in told if one["is_sure"]}
    rest = {(one["image"], one["label"]) for one in told} - sure
    assert sure
    assert rest
    button = page.get_by_role("button", name="Accept all found surely")
    expect(button).to_have_text(f"Accept all found surely ({len(sure)})")
    before = len(sampled.picking.state.picks)
    button.click()
    eventually(page, lambda: len(sampled.picking.state.picks) > before)
    index = sampled.picking.index
    now = {
        (index[one.image], one.label) for one in sampled.picking.state.picks if one.source != "hand"
    }
    assert now == sure
    expect(page.locator('[data-row^="found "]').first).to_contain_text("unsure")  # as all are now
    number = min(image for image, _ in rest)
    page.locator(f'#strip [data-image="{number}"]').click()
    expect(page.locator("[data-proposal]").first).to_contain_text("unsure")
    page.keyboard.press("Control+z")  # one step
    eventually(page, lambda: len(sampled.picking.state.picks) == before)
    assert not open_page.errors


def test_a_refused_name_stays_to_be_corrected(
    planted: PickingProject, open_page: PageOpener
) -> None:
    with served(planted.path) as server:
        page = open_page(server)
        place(page, "A", *planted.marks_px[0])
        click_mark(page, "A")
        field = page.get_by_role("form", name="Point A").get_by_label("Label")
        field.fill("left; front")
        field.press("Enter")
        expect(page.locator("#notice")).to_contain_text("cannot hold a semicolon")
        expect(field).to_have_value("left; front")
        expect(field).to_have_attribute("aria-invalid", "true")
        field.fill("left front")
        field.press("Enter")
        renamed = page.get_by_role("form", name="Point left front").get_by_label("Label")
        expect(renamed).to_have_value("left front")
        assert renamed.get_attribute("aria-invalid") is None
        assert not [one for one in open_page.errors if "409" not in one]


def test_a_reading_that_another_tab_changes_is_shown_in_the_focused_field(
    tmp_path: Path, open_page: PageOpener
) -> None:
    with served(write_large_project(tmp_path, 1600, 1200, labels=25)) as server:
        one, other = open_page(server), open_page(server)
        field = '[data-row="line L2"] input[name="length"]'
        name = server.picking.state.lines[1].name
        assert name == "L2"
        other.locator(field).click()
        one.locator(field).fill("20.73")
        one.locator(field).press("Enter")
        eventually(one, lambda: server.picking.state.lines[1].length_m == 20.73)
        for page in (one, other):
            expect(page.locator(field)).to_have_value("20.73")
        other.locator(field).press("ControlOrMeta+a")
        other.keyboard.type("22.5")  # what is being typed stays
        one.locator(field).fill("21.00")
        one.locator(field).press("Enter")
        expect(one.locator(field)).to_have_value("21")
        other.wait_for_function("() => performance.now() > 0", timeout=5000)
        expect(other.locator(field)).to_have_value("22.5")
        assert server.picking.state.lines[1].length_m == 21.0
        other.keyboard.press("Enter")
        eventually(one, lambda: server.picking.state.lines[1].length_m == 22.5)
        for page in (one, other):
            expect(page.locator(field)).to_have_value("22.5")
        assert not open_page.errors
