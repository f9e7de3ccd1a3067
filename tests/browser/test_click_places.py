"""A click on a mark gives the mark's place: at every zoom, pixel ratio and window size.

Where a mark is on the screen is found in screenshots, as the centre of gravity of a round mark:
magnifying does not move that, whether pixels are smoothed or not.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from opened_pages import PageOpener
from picking_pages import drawn, eventually, to_page
from picking_projects import BLOB_SIGMA_PX, GROUND, PickingProject, write_project
from picking_server import Served, served
from PIL import Image
from playwright.sync_api import Page, Route

from uavgram.model.arrays import Floats

ZOOMS = (1.0, 4.0, 12.0)
WINDOWS = ((1280, 720), (1917, 1043))
MOST_MEAN_PX, MOST_PX = 0.05, 0.2
SHARP = '.pane[data-sharp="true"]'  # waited for in each frame; `expect` looks ever more seldom


def zoom_to(page: Page, place: Floats, zoom: float) -> None:
    """Zoom by the wheel, and bring a place of the photo where nothing else is drawn."""
    page.keyboard.press("f")
    pane = page.locator(".pane")
    for _ in range(8):
        page.mouse.move(*to_page(page, *place))
        wanted = math.log(zoom / float(pane.get_attribute("data-scale") or ""))
        if abs(wanted) < 0.02:
            break
        before = pane.get_attribute("data-scale")
        page.mouse.wheel(0, -wanted * page.evaluate("devicePixelRatio") / 0.0015)
        page.wait_for_selector(f'.pane:not([data-scale="{before}"])')
    else:
        pytest.fail(f"the wheel does not come to x{zoom}")
    page.mouse.move(*to_page(page, *place))
    page.mouse.down(button="right")
    box = pane.bounding_box()
    assert box is not None
    x, y = box["x"] + 0.28 * box["width"], box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.up(button="right")
    eventually(page, lambda: math.dist((x, y), to_page(page, *place)) < 2)
    page.wait_for_selector(SHARP)


def centroid(page: Page, near: tuple[float, float], zoom: float) -> tuple[float, float]:
    """Where the mark near a place of the page is, in CSS pixels."""
    page.mouse.move(600, 3)  # no magnifier over the photo
    drawn(page)
    reach = 4.0 * BLOB_SIGMA_PX * zoom
    # Whole device pixels at every ratio, or the screenshot is shifted by itself.
    left, top = (4 * round((value - reach) / 4) for value in near)
    side = 4 * round(2 * reach / 4)
    shot = page.screenshot(clip={"x": left, "y": top, "width": side, "height": side})
    grey = np.asarray(Image.open(io.BytesIO(shot)).convert("L"), dtype=float)
    weight = np.clip(grey - GROUND - 6.0, 0.0, None)  # JPEG ripples
    v, u = np.mgrid[: grey.shape[0], : grey.shape[1]] + 0.5
    ratio = grey.shape[1] / side
    total = weight.sum()
    return left + (weight * u).sum() / total / ratio, top + (weight * v).sum() / total / ratio


def clicked_errors(
    page: Page, server: Served, project: PickingProject, zoom: float, marks: tuple[int, ...]
) -> Floats:
    """(n, 2) errors of picks that clicks on the seen marks made [photo pixels]."""
    errors = []
    for k in marks:
        place = project.marks_px[k]
        zoom_to(page, place, zoom)
        page.mouse.click(*centroid(page, to_page(page, *place), zoom))
        page.wait_for_selector(".mark", state="attached")
        (pick,) = server.picking.state.picks
        errors.append([pick.u_px - place[0], pick.v_px - place[1]])
        page.keyboard.press("Control+z")
        page.wait_for_selector(".mark", state="detached")
    return np.array(errors)


def held(errors: Floats) -> bool:
    """Whether clicks were as exact as they are to be."""
    away = np.linalg.norm(errors, axis=1)
    return bool(away.mean() <= MOST_MEAN_PX and away.max() <= MOST_PX)


@pytest.fixture(scope="module")
def planted_server(planted_once: PickingProject) -> Iterator[Served]:
    """One server for all: each click is taken back."""
    with served(planted_once.path) as server:
        yield server


@pytest.mark.parametrize("window", WINDOWS, ids=lambda window: f"{window[0]}x{window[1]}")
@pytest.mark.parametrize("ratio", [1.0, 1.25, 1.5, 2.0])
def test_a_click_on_a_mark_gives_its_place(
    planted_once: PickingProject,
    planted_server: Served,
    open_page: PageOpener,
    window: tuple[int, int],
    ratio: float,
) -> None:
    page = open_page(planted_server, *window, ratio)
    errors = np.concatenate(
        [
            clicked_errors(page, planted_server, planted_once, zoom, (k,))
            for k, zoom in enumerate(ZOOMS)
        ]
    )
    assert held(errors), errors
    assert not open_page.errors
    assert not open_page.strangers


def plant(page: Page, header: str, *, aligned: bool = True) -> None:
    """Give the page a header of another height, and take its cure for that away."""

    def changed(file: str, old: str, new: str) -> None:
        def serve(route: Route) -> None:
            answer = route.fetch()
            text = answer.text()
            assert old in text, file
            route.fulfill(response=answer, body=text.replace(old, new))

        page.route(f"**/page/{file}", serve)

    changed("style.css", "grid-template: 40px ", f"grid-template: {header} ")
    if not aligned:
        changed("photos/pane.js", "Math.ceil(top - 1e-6)", "top")
    page.reload()
    page.wait_for_selector(SHARP)


@pytest.mark.parametrize(
    ("header", "aligned", "exact"),
    [
        ("40.5px", False, False),  # the fault, planted: the check above sees it
        ("40.5px", True, True),  # the same header, and the page as it is
        ("40px", False, True),  # nor is it what takes the cure away that makes the fault
    ],
)
def test_a_header_of_half_a_pixel_fails_the_check_unless_the_page_lies_on_whole_ones(
    planted_once: PickingProject,
    planted_server: Served,
    open_page: PageOpener,
    *,
    header: str,
    aligned: bool,
    exact: bool,
) -> None:
    page = open_page(planted_server)
    plant(page, header, aligned=aligned)
    box = page.locator(".pane").bounding_box()
    assert box is not None
    assert box["y"] == float(header.removesuffix("px"))
    errors = clicked_errors(page, planted_server, planted_once, 1.0, (0, 1, 2))
    assert held(errors) == exact, errors


def test_a_photo_that_exif_turns_gives_the_same_numbers(
    tmp_path: Path, open_page: PageOpener
) -> None:
    project = write_project(tmp_path, turned=True)
    with served(project.path) as server:
        page = open_page(server)
        errors = clicked_errors(page, server, project, 4.0, (0, 1, 2))
        assert held(errors), errors
