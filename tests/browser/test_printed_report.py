"""The report on paper: what a browser prints is not cut off at the margin."""

from __future__ import annotations

from dataclasses import replace

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

CUT_OFF = """() => [...document.querySelectorAll(".note, .note *, .beside > *")]
    .filter((one) => !one.closest("svg"))
    .filter((one) => one.getBoundingClientRect().right > document.body.clientWidth + 1)
    .map((one) => one.textContent.trim().slice(0, 80))"""


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
