"""The report on paper: what a browser prints is not cut off at the margin."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import cv2
import numpy as np
import pytest
import synthetic_survey
from playwright.sync_api import Browser

from uavgram.model.provenance import InputDigest
from uavgram.model.result.result import Picture, Pictures
from uavgram.stages.products.picture_plan import picture_plan
from uavgram.views.report import render_report

WIDTHS_PX = {"A4": 688, "Letter": 710}
"""Of the sheet between its margins of 14 mm, at 96 pixels to the inch."""

HEIGHTS_PX = {"A4": 1001, "Letter": 934}
"""Of the sheet between its margins of 16 mm."""

ONE: tuple[synthetic_survey.Measure, ...] = (("skid left", "distance", ("P01", "P10"), "m"),)

CUT_OFF = """() => [...document.querySelectorAll(".note, .note *, .beside > *")]
    .filter((one) => !one.closest("svg"))
    .filter((one) => one.getBoundingClientRect().right > document.body.clientWidth + 1)
    .map((one) => one.textContent.trim().slice(0, 80))"""


DRAWN_SHARE = """() => {
    const plan = document.querySelector("#plan svg");
    return plan.getScreenCTM().a * plan.viewBox.baseVal.width / document.body.clientWidth;
}"""
"""Width of the drawing that a browser scales into its box, as a share of the page."""

LONG = "x" * 200
"""The longest label."""


@pytest.mark.parametrize("paper", WIDTHS_PX)
def test_the_drawing_is_as_wide_as_the_printed_page(paper: str, chromium: Browser) -> None:
    page = chromium.new_page(viewport={"width": WIDTHS_PX[paper], "height": HEIGHTS_PX[paper]})
    page.emulate_media(media="print")
    page.set_content(render_report(synthetic_survey.build(measures=ONE)))
    share, end = page.evaluate(DRAWN_SHARE), page.locator(".brief").bounding_box()
    page.close()

    assert share > 0.95
    assert end is not None
    assert end["y"] + end["height"] <= HEIGHTS_PX[paper] + 1


@pytest.mark.parametrize("media", ["print", "screen"])
def test_a_long_label_moves_no_column_beyond_the_margin(
    media: Literal["print", "screen"], chromium: Browser
) -> None:
    made = synthetic_survey.build()
    rows, lines = made.measurements, made.lines
    result = replace(
        made,
        measurements=replace(rows, points=((LONG, LONG), *rows.points[1:])),
        lines=replace(lines, start=(LONG, *lines.start[1:])),
    )
    page = chromium.new_page(viewport={"width": WIDTHS_PX["A4"], "height": 900})
    page.emulate_media(media=media)
    page.set_content(render_report(result))
    ends = page.locator("td").evaluate_all(
        "all => all.map((one) => [one.getBoundingClientRect().right, one.textContent])"
    )
    page.close()

    assert any(LONG in words for _, words in ends)
    assert [words for right, words in ends if right > WIDTHS_PX["A4"] + 1] == []


@pytest.mark.parametrize("paper", WIDTHS_PX)
def test_no_word_of_the_printed_report_is_beyond_the_margin(paper: str, chromium: Browser) -> None:
    made = synthetic_survey.build()
    photos = tuple(
        InputDigest(path=f"photos/{name}", sha256=f"{k:064x}", size_bytes=k)
        for k, name in enumerate(made.frames.frame_id)
    )
    result = replace(made, provenance=replace(made.provenance, inputs=photos))
    grey = cv2.imencode(".jpg", np.full((8, 8), 128, np.uint8))[1].tobytes()
    regions = picture_plan(result).regions
    shown = tuple(Picture(region=one, jpeg=grey, shown_px=8, stretch=None) for one in regions)
    page = chromium.new_page(viewport={"width": WIDTHS_PX[paper], "height": 900})
    page.emulate_media(media="print")
    page.set_content(render_report(result, Pictures(shown=shown)))
    words, cut_off = page.inner_text("#pictures"), page.evaluate(CUT_OFF)
    page.close()

    assert "a known length that was withheld" in words
    assert cut_off == []
