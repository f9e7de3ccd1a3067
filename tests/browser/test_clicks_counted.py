"""How many clicks and keys a survey takes: from photos, log and camera to distances."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, islice, repeat

import cv2
import numpy as np
import pytest
from opened_pages import PageOpener
from picking_pages import Counted, eventually, measured, to_page, wait_until_adjusted
from picking_server import Served, served
from playwright.sync_api import expect

from uavgram.model.arrays import Floats
from uavgram.synthetic.files import write_demo
from uavgram.synthetic.picture.render import render_photos
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import SimulatedSurvey, simulate

MOST = 26
"""Clicks and keys, besides the digits of the lengths."""

FIRST, SECOND = 4, 5
"""The photos that are picked in: neighbours in the list, and both show all eight points."""

TAPED = (("R3", "R7"), ("P5", "P13"), ("P11", "P12"), ("P9", "P14"))
WANTED = (("R3", "P14"), ("P5", "P11"), ("P12", "P13"))


@pytest.fixture(scope="module")
def survey() -> SimulatedSurvey:
    return simulate(Scenario())


@pytest.fixture(scope="module")
def server(survey: SimulatedSurvey, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """The demo with empty tables."""
    folder = tmp_path_factory.mktemp("counted")
    # Photos after those that are picked in cost time, and nothing is looked at there.
    rest = len(survey.frame_id) - SECOND - 1
    blank = np.full((survey.calibration.height_px, survey.calibration.width_px, 3), 90, np.uint8)
    photos = chain(islice(render_photos(survey), SECOND + 1), repeat(blank, rest))
    project = write_demo(folder, survey, photos)
    for name in ("picks.csv", "lines.csv", "measure.csv"):
        header = (folder / name).read_text(encoding="utf-8").splitlines()[0]
        (folder / name).write_text(header + "\n", encoding="utf-8")
    with served(project) as running:
        yield running


def true_pixels(survey: SimulatedSurvey, photo: int) -> dict[str, Floats]:
    """Where a photo really shows each point, by OpenCV."""
    truth, (fx, fy, cx, cy, *lens) = survey.truth, survey.truth.intrinsics.tolist()
    turn = truth.world_from_camera[photo].T
    pixel, _ = cv2.projectPoints(
        truth.point_world_m,
        cv2.Rodrigues(turn)[0],
        -turn @ truth.center_world_m[photo],
        np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        np.array(lens),
    )
    return dict(zip(truth.label, pixel[:, 0], strict=True))


def test_four_lengths_and_three_distances_in_two_photos_take_26_clicks_and_keys(
    server: Served, survey: SimulatedSurvey, open_page: PageOpener
) -> None:
    truth = survey.truth
    place_m = dict(zip(truth.label, truth.point_world_m, strict=True))
    here, there = true_pixels(survey, FIRST), true_pixels(survey, SECOND)
    names: dict[str, str] = {}  # as the page calls them

    def length(ends: tuple[str, str]) -> float:
        return float(np.linalg.norm(place_m[ends[0]] - place_m[ends[1]]))

    page = open_page(server)
    does = Counted(page)
    chosen = page.locator(f'#strip [data-image="{FIRST}"]').bounding_box()
    assert chosen is not None
    does.click(chosen["x"] + 20, chosen["y"] + 20)
    expect(page.locator(".pane").first).to_have_attribute("data-image", survey.frame_id[FIRST])
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    does.key("l")
    for ends in TAPED:
        for label in ends:
            does.click(*to_page(page, *here[label]))
            names[label] = f"P{len(names) + 1}"
            expect(page.locator(f'.mark[data-label="{names[label]}"]')).to_have_count(1)
        does.digits(f"{length(ends):.3f}")
        if ends == TAPED[0]:
            does.key("Enter")  # the others are taken by the next click, or by this:
    does.key("Enter")
    does.key("d")
    for ends in WANTED:
        for label in ends:
            does.click(*to_page(page, *here[label]))
    does.key("PageDown")
    expect(page.locator(".pane").first).to_have_attribute("data-image", survey.frame_id[SECOND])
    expect(page.locator("[data-proposal]")).to_have_count(len(names))
    does.key("Control+Enter")
    eventually(page, lambda: len(server.picking.state.picks) == 2 * len(names))
    wait_until_adjusted(page)
    shown = measured(page)

    assert does.count <= MOST
    photo = survey.frame_id[SECOND]
    for label, name in names.items():
        pick = server.picking.state.pick(photo, name)
        assert pick is not None
        assert pick.source in ("match", "target")  # a chequer is found as one
        assert np.hypot(*(np.array([pick.u_px, pick.v_px]) - there[label])) < 3.0
    for ends, text in zip(WANTED, shown.values(), strict=True):
        value, sigma = (float(text.split(" ")[k]) for k in (0, 2))
        assert abs(value - length(ends)) < 3.0 * sigma
    assert not open_page.errors
