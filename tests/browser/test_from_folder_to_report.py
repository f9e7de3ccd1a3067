"""From a folder to the report in the browser alone: no file is edited, clicks and keys counted."""

from __future__ import annotations

import json
import math
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from opened_pages import PageOpener
from picking_pages import Counted, eventually, to_page
from picking_server import Served, served
from playwright.sync_api import Page, expect
from tagged_jpeg import dji

from uavgram.config.project import load_project
from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.imaging.photos.decoding import Segment
from uavgram.io.photos.metadata import APP1, XMP_HEAD, build_jpeg, parse_jpeg
from uavgram.io.results.results_json import load_results
from uavgram.model.result.result import Result
from uavgram.picking.session.folder_chooser import FolderChooser
from uavgram.pipeline.measure.run import run

MOST = 40
"""Clicks and keys for 4 lengths and 3 distances in 2 photos: mount, report, all digits of readings
of five characters and two answers included."""

RUN_MS = 240_000
"""Longest time of a run on a busy machine."""

STREET, BEACH = "Unfall Köln", "Strand"
CASES = ("Dokumente", "Fälle", "2026")
"""Folders around those of the flights: a person would go through them one after another."""

SHORTEST_M, LONGEST_M = 5.0, 15.0
APART_PX = 80.0
"""Between points that are picked: nothing is clicked twice."""

BESIDE_PX = 10.0
"""From the mark of a point that is meant to the click, on the screen: the page asks."""

Pixel = tuple[float, float]

ON_BEACH: tuple[tuple[Pixel, Pixel, tuple[float, float, float]], ...] = (
    ((1824, 1740), (1771, 903), (-2.803, -9.859, 0.294)),
    ((2138, 1429), (2079, 590), (2.415, -4.722, 0.063)),
    ((1986, 1097), (1920, 253), (-0.121, 0.821, 0.216)),
    ((2684, 1127), (2623, 286), (11.678, 0.326, -0.238)),
    ((2971, 1637), (2919, 800), (16.661, -8.348, -0.311)),
    ((2686, 1285), (2627, 445), (11.705, -2.343, -0.203)),
    ((3121, 1023), (3060, 181), (19.258, 2.095, -0.409)),
    ((2709, 1026), (2646, 184), (12.105, 2.028, -0.238)),
)
"""Distinct things on the beach in two photos, as a person chooses them, and where they are [m].

From a bundle adjustment by other means: 772 corners matched in two or three photos by OpenCV, with
poses, lens and points by scipy (residuals 0.13 px). Their scale is that of the heights over
take-off, 40 m, and does not matter here. Other assumptions on the lens change the ratios of these
distances by 0.2 %. The ground has a slope of 2 degrees; these points are within 5 cm of a plane.
"""

ASKED = 2
"""Clicks beside the mark that is meant."""

GIMBALS, AXES = ("Gimbal", "Flight"), ("Yaw", "Pitch", "Roll")

WANTED = ((0, 2), (1, 5), (5, 7))
"""Three distances between ends of different lengths."""

Truth = dict[str, Any]


@dataclass(frozen=True)
class Scene:
    """Eight points in two photos, and the taped lengths from one to the next."""

    photos: tuple[str, str]
    here: list[tuple[float, float]]
    there: list[tuple[float, float]]
    taped_m: list[float]


@pytest.fixture
def home(data_dir: Path, tmp_path: Path) -> Path:
    """Photos with a log of a fixed camera, and a DJI's photos, as they come from memory cards."""
    home = tmp_path / "home"
    cases = home.joinpath(*CASES)
    only = shutil.ignore_patterns("*.csv", "*.yaml", "*.tlog", "out")
    shutil.copytree(data_dir / "street_oblique", cases / STREET, ignore=only)
    shutil.copy(data_dir / "street_oblique" / "camera.yaml", cases / STREET)
    shutil.copytree(data_dir / "brighton_beach", cases / BEACH)
    return home


@pytest.fixture
def truth(data_dir: Path) -> Truth:
    known: Truth = json.loads((data_dir / "truth" / "street_oblique.json").read_text())
    return known


def apart(truth: Truth, photos: tuple[str, str]) -> list[str]:
    """Ends of four lengths of 5 to 15 m between marks on the ground that both photos show."""
    here, there = (truth["pixels"][photo] for photo in photos)
    marks = [
        label
        for label in sorted(here, key=lambda one: (one[0] != "R", one))
        if label[0] in "RP"
        and all(photo.get(label, (0, 0, False))[2] for photo in (here, there))
        and abs(truth["height_above_ground_m"][label]) < 0.02
    ]
    chosen: list[str] = []
    for ends in combinations(marks, 2):
        among = [here[label][:2] for label in (*chosen, *ends)]
        is_free = all(math.dist(a, b) > APART_PX for a, b in combinations(among, 2))
        if is_free and SHORTEST_M < length(truth, ends) < LONGEST_M:
            chosen.extend(ends)
    return chosen[:8]


def street(truth: Truth) -> tuple[Scene, list[str]]:
    photos = ("IMG_0027.jpg", "IMG_0028.jpg")
    labels = apart(truth, photos)
    here, there = ([tuple(truth["pixels"][one][k][:2]) for k in labels] for one in photos)
    return Scene(
        photos, here, there, [length(truth, labels[k : k + 2]) for k in (0, 2, 4, 6)]
    ), labels


def beach() -> Scene:
    here, there = [one for one, _, _ in ON_BEACH], [one for _, one, _ in ON_BEACH]
    taped = [length_on_beach(k, k + 1) for k in (0, 2, 4, 6)]
    return Scene(("DJI_0025.JPG", "DJI_0026.JPG"), here, there, taped)


def length_on_beach(start: int, end: int) -> float:
    return math.dist(ON_BEACH[start][2], ON_BEACH[end][2])


def length(truth: Truth, ends: Sequence[str]) -> float:
    start, end = (truth["points"][label] for label in ends)
    return math.dist(start, end)


def results(page: Page) -> dict[str, str]:
    """Values of the results tab by the names of the measurements."""
    rows = page.get_by_role("table", name="Results").locator("tbody tr")
    cells = rows.evaluate_all("all => all.map(row => [...row.cells].map(one => one.innerText))")
    return {name.partition(" ")[0]: value for name, value, *_ in cells}  # behind it are its points


def check_report(page: Page, folder: Path) -> Result:
    """The results tab shows what was written, and its report opens."""
    panel = page.get_by_role("tabpanel", name="Results")
    expect(panel).to_contain_text("measurements computed", timeout=RUN_MS)
    expect(panel.locator(".plan img")).to_be_visible()
    eventually(page, lambda: panel.locator(".plan img").evaluate("img => img.naturalWidth > 0"))
    with page.context.expect_page() as opened:
        panel.get_by_role("link", name="Report", exact=True).click()
    expect(opened.value.locator("h1").first).to_contain_text(folder.name)
    opened.value.close()
    result = load_results(folder / "out" / "results.json")
    assert results(page).keys() == set(result.measurements.name)
    return result


def lacking(scene: Scene, server: Served) -> list[str]:
    """Points that the first photo alone shows so far."""
    elsewhere = {pick.label for pick in server.picking.state.picks if pick.image != scene.photos[0]}
    return [f"P{k}" for k in range(1, 9) if f"P{k}" not in elsewhere]


def take_over(page: Page, does: Counted, scene: Scene, server: Served) -> int:
    """Look at the pictures of what was found in other photos, accept all, and write.

    What was found in none is clicked in the second one, until the program finds the rest: the
    number of these points is returned.
    """
    missed = 0
    eventually(page, lambda: len(server.picking.state.requests) >= len(WANTED) - 1)
    while (name := find_missed(page, scene, server)) is not None:
        click_there(page, does, scene, name)
        missed += 1
    check_pictures(page, scene)
    does.press(page.locator("button[name=accept-export]"))
    eventually(page, lambda: not lacking(scene, server))
    eventually(page, lambda: len(server.picking.state.requests) == len(WANTED))
    assert [one.kind for one in server.picking.state.requests] == ["distance"] * len(WANTED)
    return missed


def find_missed(page: Page, scene: Scene, server: Served) -> str | None:
    """Wait until all was searched; return the first point that was found in no other photo."""
    picking = server.picking
    eventually(page, lambda: picking._search.searched == picking.version)
    expect(page.locator("#panel")).not_to_contain_text("still looking")
    found = {label for (_, label), one in picking._search.outcomes.items() if one.found}
    return next((label for label in lacking(scene, server) if label not in found), None)


def check_pictures(page: Page, scene: Scene) -> None:
    """Each find has a picture, beside that of the pick, with the photo's own pixels."""
    expect(page.locator("button[name=accept-export]")).to_be_enabled()  # all is listed
    row = page.locator('tr[data-row^="found "] + tr.beneath').first
    row.evaluate("row => row.scrollIntoView()")
    names = row.locator(".spot").evaluate_all("all => all.map(one => one.title)")
    assert names[0].endswith(f"as picked in {scene.photos[0]}")
    assert "as found in" in names[1]
    tiles = row.locator(".spot img")
    loaded = "all => all.length > 0 && all.every(img => img.naturalWidth > 0)"
    eventually(page, lambda: tiles.evaluate_all(loaded))


def click_there(page: Page, does: Counted, scene: Scene, name: str) -> None:
    """Go to the photo by the list of what is still to be picked, and click the point there."""
    asked = page.locator(f'[data-row^="asked {name} "]')
    does.press(asked.get_by_role("button", name=scene.photos[1], exact=True))
    expect(page.locator(".pane").first).to_have_attribute("data-image", scene.photos[1])
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    does.click(*to_page(page, *scene.there[int(name[1:]) - 1]))
    expect(page.locator(f'.mark.placed[data-label="{name}"]')).to_have_count(1)
    expect(page.get_by_role("radio", name="Point", exact=True)).to_be_checked()  # no line there


def reading(length_m: float) -> str:
    """Write a length as read from a tape, with five characters, such as 12.34 or 9.218."""
    return f"{length_m:.4f}"[:5]


def survey(page: Page, does: Counted, scene: Scene, server: Served) -> int:
    """Enter four lengths, draw three distances without one, take the second photo over, and write.

    One tool does it all: a line without a reading is a distance.
    """
    expect(page.locator(".pane").first).to_have_attribute("data-image", scene.photos[0])
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    expect(page.get_by_role("radio", name="Taped length")).to_be_checked()
    for k in range(0, 8, 2):
        for place in scene.here[k : k + 2]:
            does.click(*to_page(page, *place))
        expect(page.locator(".mark.placed, .mark.found")).to_have_count(k + 2)
        does.digits(reading(scene.taped_m[k // 2]))  # taken by the next click
    for number, k in enumerate(k for ends in WANTED for k in ends):
        x, y = to_page(page, *scene.here[k])
        if number < ASKED:
            does.click(x + BESIDE_PX, y)
            question = page.get_by_role("alertdialog")
            expect(question).to_contain_text("is very near. Which point is this?")
            does.press(question.get_by_role("button").first)
            expect(question).to_have_count(0)
        else:
            does.click(x, y)
    missed = take_over(page, does, scene, server)
    lengths = {(one.start, one.end): one.length_m for one in server.picking.state.lines}
    assert list(lengths.values()) == [float(reading(one)) for one in scene.taped_m]
    points = [one.points for one in server.picking.state.requests]
    assert points == [(f"P{a + 1}", f"P{b + 1}") for a, b in WANTED]
    return missed


def told(name: str, does: Counted) -> int:
    sys.stdout.write(f"{name}: {does.count} clicks and keys, and {does.typed} of numbers\n")
    assert does.typed == 4 * len("12.34")
    return does.count + does.typed


def test_two_projects_one_after_another_without_a_file_or_a_terminal(
    home: Path, truth: Truth, open_page: PageOpener
) -> None:
    with served(None, FolderChooser(roots=(home,)), run) as server:
        page = open_page(server, 1280, 800)
        does = Counted(page)
        does.press(page.get_by_role("button", name=f"Use {STREET}"))
        does.press(page.get_by_role("radio", name="45° down"))
        does.press(page.get_by_role("button", name="Begin"))
        scene, labels = street(truth)
        missed = survey(page, does, scene, server)
        result = check_report(page, home.joinpath(*CASES, STREET))
        assert told("street", does) <= MOST
        assert not missed

        project = load_project(home.joinpath(*CASES, STREET) / "project.yaml")
        assert (project.mount.gimbal, project.mount.pitch_deg) == ("none", -45.0)
        found = result.measurements
        for k, (a, b) in enumerate(WANTED):
            assert (
                abs(found.value[k] - length(truth, (labels[a], labels[b]))) < 3.5 * found.sigma[k]
            )
        assert (found.sigma < 0.5).all()

        page.get_by_role("button", name="Open another folder").click()
        opened = page.get_by_role("list", name="Opened before")
        expect(opened.get_by_role("button", name=f"Open {STREET}")).to_be_visible()
        expect(opened).to_contain_text(" › ".join(CASES))
        does = Counted(page)
        does.press(page.get_by_role("button", name=f"Use {BEACH}"))
        expect(page.locator(".found")).to_contain_text("3 photos of")
        expect(page.get_by_role("radio", name="As recorded")).to_be_checked()
        expect(page.locator(".way-of").first).to_contain_text("90° below the horizon")
        page.get_by_role("radio", name="45° down").check()  # against what the photos say
        remark = page.locator(".mount").get_by_role("status")
        expect(remark).to_contain_text("the photos say 90° below the horizon")
        page.get_by_role("radio", name="As recorded").check()
        expect(remark).to_be_empty()
        does.press(page.get_by_role("button", name="Begin"))
        steps = page.locator(".steps li b")
        expect(steps.first).to_have_text("Enter a length that was taped")
        expect(steps).to_have_count(4)
        missed = survey(page, does, beach(), server)
        result = check_report(page, home.joinpath(*CASES, BEACH))
        assert told("DJI photos", does) <= MOST
        assert not missed
        wanted = [length_on_beach(*ends) for ends in WANTED]
        found = result.measurements
        assert (abs(found.value - wanted) < 3.5 * found.sigma).all()
        assert not open_page.errors
        assert not open_page.strangers


def tag_as_dji(photos: Path, truth: Truth) -> None:
    """Write tags as some DJI do: the place, heights, and directions that are not filled in."""
    world = truth["world"]
    origin = world["latitude_deg"], world["longitude_deg"], world["height_amsl_m"]
    angles = {f"{which}{axis}Degree": "+0.00" for which in GIMBALS for axis in AXES}
    for path in sorted(photos.glob("*.jpg")):
        center_m = np.array([truth["frames"][path.name]["center_world_m"]])
        latitude, longitude, height = (one.item() for one in geodetic_from_enu(center_m, origin))
        place = {"GpsLatitude": f"{latitude:.8f}", "GpsLongitude": f"{longitude:.8f}"}
        heights = {"AbsoluteAltitude": height, "RelativeAltitude": center_m[0, 2]}
        tags = dji(**place, **angles, **{name: f"{one:+.2f}" for name, one in heights.items()})
        plain = parse_jpeg(path.read_bytes())
        assert plain is not None
        segments = [*plain.segments, Segment(APP1, XMP_HEAD + tags)]
        path.write_bytes(build_jpeg(segments, plain.scan))


@pytest.mark.parametrize("tags", ["no tags", "directions 0/0/0"])
def test_without_a_log_points_are_found_in_other_photos(
    home: Path, truth: Truth, open_page: PageOpener, tags: str
) -> None:
    folder = home.joinpath(*CASES, STREET)
    (folder / "flight.BIN").unlink()
    if tags == "directions 0/0/0":
        tag_as_dji(folder / "photos", truth)
    with served(None, FolderChooser(roots=(home,)), run) as server:
        page = open_page(server, 1280, 800)
        does = Counted(page)
        does.press(page.get_by_role("button", name=f"Use {STREET}"))
        does.press(page.get_by_role("radio", name="45° down"))  # without a place it is no help
        does.press(page.get_by_role("button", name="Begin"))
        scene, labels = street(truth)
        missed = survey(page, does, scene, server)
        found = check_report(page, folder).measurements
        assert told(tags, does) <= MOST
        assert not missed
        for k, (a, b) in enumerate(WANTED):
            assert (
                abs(found.value[k] - length(truth, (labels[a], labels[b]))) < 3.5 * found.sigma[k]
            )
