"""The printed report is short: pages are counted, and none but the last is half empty."""

from __future__ import annotations

import io
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import synthetic_survey as survey
from PIL import Image

from uavgram.errors import UavgramError
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.provenance import InputDigest
from uavgram.model.result.reliability import Reason, Verdict
from uavgram.model.result.result import GroundPicture, Picture, Pictures, Result
from uavgram.stages.products.picture_plan import picture_plan
from uavgram.views.report import check_pdf, ground_extent, render_report, report_pdf

pikepdf = pytest.importorskip("pikepdf", reason="pikepdf is not installed")
ONE: tuple[survey.Measure, ...] = (("skid left", "distance", ("P01", "P10"), "m"),)
MOST_PAGES = {"one": 4, "several": 8}
FOOT, LEAST_FULL = 0.92, 0.6
"""Of the height of a page: where its foot begins, and how far down its text must reach."""


def jpeg(width: int, height: int) -> bytes:
    return cv2.imencode(".jpg", np.full((height, width), 90, np.uint8))[1].tobytes()


def pictures(result: Result) -> Pictures:
    """Grey parts of photos, and grey ground."""
    corners = ground_extent(result)
    assert corners is not None
    (west, south), (east, north) = corners
    return Pictures(
        shown=tuple(
            Picture(region=one, jpeg=jpeg(16, 16), shown_px=16, stretch=None)
            for one in picture_plan(result).regions
        ),
        ground=GroundPicture(
            jpeg=jpeg(32, 32),
            west_m=west,
            north_m=north,
            width_m=east - west,
            height_m=north - south,
            brightened=False,
        ),
    )


def with_much_to_say(result: Result) -> Result:
    """Return it red, with reasons and warnings of three lines each and a sum for each photo."""
    words = "The length R1 does not fit the photos and was left out of the computation: " * 3
    reasons = tuple(Reason(cause="line-removed", text=f"Reason {k}. {words}") for k in range(4))
    files = tuple(
        InputDigest(path=f"photos/{name}", sha256=f"{k:064x}", size_bytes=k)
        for k, name in enumerate(result.frames.frame_id)
    )
    return replace(
        result,
        verdict=Verdict(level="red", reasons=reasons),
        messages=tuple(Message("warning", "line-removed", one.text) for one in reasons),
        provenance=replace(result.provenance, inputs=files),
    )


@pytest.fixture(scope="module", params=["one", "several", "one red", "several red", "several feet"])
def printed(request: pytest.FixtureRequest) -> tuple[str, bytes]:
    try:
        check_pdf()
    except UavgramError as fault:
        pytest.skip(str(fault))
    many, _, kind = request.param.partition(" ")
    result = survey.build(measures=ONE) if many == "one" else survey.build()
    result = with_much_to_say(result) if kind == "red" else result
    if kind == "feet":
        made = replace(result.provenance, options=(("units.length", "ft"),))
        result = replace(result, provenance=made)
    page = render_report(result, pictures(result))
    return many, report_pdf(page, "{}", "a4", "crossing", "2026-01-05T11:00:00Z")


def test_there_are_few_pages(printed: tuple[str, bytes]) -> None:
    many, content = printed

    assert len(pikepdf.open(io.BytesIO(content)).pages) <= MOST_PAGES[many]


def test_no_page_but_the_last_is_half_empty(printed: tuple[str, bytes], tmp_path: Path) -> None:
    full = reach(printed[1], tmp_path)[:-1]

    assert full.min() > LEAST_FULL, full


def reach(content: bytes, folder: Path) -> Floats:
    """Return how far down each page is printed, as a share of its height, without its foot."""
    program = shutil.which("pdftoppm")
    if program is None:
        pytest.skip("pdftoppm (poppler-utils) is not installed")
    (folder / "report.pdf").write_bytes(content)
    command = [program, "-r", "20", "-gray", str(folder / "report.pdf"), str(folder / "page")]
    subprocess.run(command, check=True)
    pages = [np.asarray(Image.open(path)) for path in sorted(folder.glob("page*.pgm"))]
    rows = [np.flatnonzero((page < 200).any(axis=1)) / len(page) for page in pages]
    return np.array([row[row < FOOT].max(initial=0.0) for row in rows])


def test_a_section_does_not_begin_with_room_for_its_head_alone(tmp_path: Path) -> None:
    first, *others = pages_of("checks", 214, tmp_path)

    assert "Checks of the result" not in first
    assert any("Checks of the result" in other and "R4" in other for other in others)


def test_a_table_of_two_pages_has_its_head_on_both_and_rows_above_the_signature(
    tmp_path: Path,
) -> None:
    pages = [page for page in pages_of("files", 170, tmp_path) if page.strip()]
    digest = re.compile(r"[0-9a-f]{64}")

    assert [len(digest.findall(page)) >= 5 for page in pages] == [True, True]
    assert all("SHA-256" in digest.split(page)[0] for page in pages)
    assert "Signature" in pages[1].rsplit("photos/", 1)[1]


def pages_of(section: str, above_mm: int, tmp_path: Path) -> list[str]:
    """Return the text of each page of a section of the report that begins below other things."""
    try:
        check_pdf()
    except UavgramError as fault:
        pytest.skip(str(fault))
    program = shutil.which("pdftotext")
    if program is None:
        pytest.skip("pdftotext (poppler-utils) is not installed")
    page = render_report(with_much_to_say(survey.build()))
    head, _, body = page.partition("<body>")
    start = body.index(f'<section id="{section}">')
    part = body[start : body.index("</section>", start)]
    html = f'{head}<body><div style="height: {above_mm}mm"></div>{part}</section></body></html>'
    path = tmp_path / "report.pdf"
    path.write_bytes(report_pdf(html, "{}", "a4", "crossing", "2026-01-05T11:00:00Z"))
    command = [program, "-layout", str(path), "-"]
    told = subprocess.run(command, check=True, capture_output=True, text=True)
    return told.stdout.split("\f")
