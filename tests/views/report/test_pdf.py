"""report.pdf and its annex: an archive's files (PDF/A-3b) of the same pages."""

from __future__ import annotations

import base64
import hashlib
import io
import re
import shutil
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import synthetic_survey
import synthetic_survey as survey
from PIL import Image

from uavgram.errors import UavgramError
from uavgram.model.arrays import Floats
from uavgram.model.maps import Paper
from uavgram.model.message import Message
from uavgram.model.provenance import InputDigest
from uavgram.model.result.reliability import Reason, Verdict
from uavgram.model.result.result import GroundPicture, Picture, Pictures, Result
from uavgram.stages.products.picture_plan import picture_plan
from uavgram.views.report import check_pdf, ground_extent, render_annex, render_report, report_pdf

pikepdf = pytest.importorskip("pikepdf", reason="pikepdf is not installed")
NUMBERS = '{"schema": 1, "value": 12.5}\n'
MADE = "2026-01-05T11:00:00Z"
MARGIN_PT = 14 / 25.4 * 72
SHORT = "<style>@page { size: A4 }</style><h1>crossing</h1>"


@pytest.fixture(scope="module", params=[render_report, render_annex])
def page(request: pytest.FixtureRequest) -> str:
    try:
        check_pdf()
    except UavgramError as fault:
        pytest.skip(str(fault))
    html: str = request.param(synthetic_survey.build())
    return html


def opened(content: bytes) -> Any:  # noqa: ANN401
    return pikepdf.open(io.BytesIO(content))


@pytest.fixture(scope="module")
def content(page: str) -> bytes:
    return report_pdf(page, NUMBERS, "a4", 'cross"ing', MADE)


def test_it_says_that_it_is_for_archives(content: bytes) -> None:
    pdf = opened(content)
    with pdf.open_metadata() as metadata:
        assert (metadata["pdfaid:part"], metadata["pdfaid:conformance"]) == ("3", "B")
        assert metadata["xmp:CreateDate"].startswith("2026-01-05T11:00:00")

    (intent,) = pdf.Root.OutputIntents
    assert str(intent.S) == "/GTS_PDFA1"
    assert bytes(intent.DestOutputProfile.read_bytes())[36:40] == b"acsp"  # an ICC profile


def test_the_numbers_are_attached(content: bytes) -> None:
    pdf = opened(content)
    (name,) = pdf.attachments
    attached = pdf.attachments[name]

    assert name == "results.json"
    assert attached.get_file().read_bytes().decode() == NUMBERS
    assert str(attached.obj.AFRelationship) == "/Data"
    assert [str(one.UF) for one in pdf.Root.AF] == ["results.json"]


def test_report_and_annex_link_to_the_pdf_of_each_other(page: str, content: bytes) -> None:
    other = "report.pdf" if "annex for the specialist" in page else "report-annex.pdf"
    links = [
        str(one.A.URI)
        for sheet in opened(content).pages
        for one in sheet.get("/Annots", [])
        if "/A" in one
    ]

    assert [link for link in links if "report" in link] == [other]
    assert not any(link.endswith(".html") for link in links)


@pytest.mark.usefixtures("page")
def test_the_annex_has_no_second_copy_of_the_numbers() -> None:
    pdf = opened(report_pdf(SHORT, NUMBERS, "a4", "crossing", MADE, attach=False))

    assert not pdf.attachments


@pytest.fixture(scope="module")
def written(content: bytes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file, which pdftotext can read."""
    if shutil.which("pdftotext") is None:
        pytest.skip("pdftotext (poppler-utils) is not installed")
    path = tmp_path_factory.mktemp("pdf") / "report.pdf"
    path.write_bytes(content)
    return path


def told_by_pdftotext(path: Path, how: str) -> str:
    command = ["pdftotext", how, str(path), "-"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.fixture(scope="module")
def words(written: Path) -> list[tuple[str, ...]]:
    """Left and right end, and text, of all words of the file."""
    return re.findall(
        r'<word xMin="([-\d.]+)" yMin="[-\d.]+" xMax="([-\d.]+)".*?>(.*)</word>',
        told_by_pdftotext(written, "-bbox"),
    )


def test_no_word_stands_beyond_the_margins(words: list[tuple[str, ...]]) -> None:
    width = 210 / 25.4 * 72
    beyond = [
        word
        for left, right, word in words
        if float(left) < MARGIN_PT - 1 or float(right) > width - MARGIN_PT + 1
    ]

    assert len(words) > 500
    assert beyond == []


def test_every_number_of_the_page_is_in_the_file(
    page: str, written: Path, words: list[tuple[str, ...]]
) -> None:
    number = re.compile(r"(?<![\w.])[+-]?\d+\.\d+(?![\w.])")
    shown = unescape(re.sub(r"<style>.*?</style>|<[^>]*>", " ", page, flags=re.DOTALL))
    wanted = Counter(number.findall(shown))
    # each order of reading tears other turned words
    found = Counter(number.findall(told_by_pdftotext(written, "-raw")))
    found |= Counter(number.findall(" ".join(unescape(word) for *_, word in words)))

    assert wanted.total() > 90
    assert {
        text: count - found[text] for text, count in wanted.items() if found[text] < count
    } == {}


@pytest.mark.usefixtures("page")  # or there is no WeasyPrint
def test_photos_in_the_page_are_kept_as_they_are_and_nothing_is_loaded(tmp_path: Path) -> None:
    jpeg = cv2.imencode(".jpg", np.full((16, 24), 90, np.uint8))[1].tobytes()
    (tmp_path / "a.jpg").write_bytes(jpeg)
    inside = f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"

    for address, wanted in ((inside, [jpeg]), ((tmp_path / "a.jpg").as_uri(), [])):
        drawn = (
            f'<svg viewBox="0 0 9 6" width="9"><image width="9" height="6" href="{address}"/></svg>'
        )
        pdf = opened(report_pdf(drawn, NUMBERS, "a4", "crossing", MADE))
        streams = [one for one in pdf.objects if isinstance(one, pikepdf.Stream)]
        images = [one for one in streams if one.get("/Subtype") == "/Image"]
        assert [one.read_raw_bytes() for one in images] == wanted
        assert not any(one.get("/Interpolate") for one in images)  # ISO 19005-3, 6.2.8


def test_every_font_is_embedded(content: bytes) -> None:
    pdf = opened(content)
    fonts = [font for page in pdf.pages for font in page.Resources.get("/Font", {}).values()]

    assert fonts
    for font in fonts:
        assert "/FontFile2" in font.DescendantFonts[0].FontDescriptor


@pytest.mark.usefixtures("page")  # or there is no WeasyPrint
@pytest.mark.parametrize(("paper", "size"), [("a4", (595.28, 841.89)), ("letter", (612.0, 792.0))])
def test_it_has_the_size_of_the_paper_and_is_the_same_each_time(
    paper: Paper, size: tuple[float, float]
) -> None:
    made = [report_pdf(SHORT, NUMBERS, paper, "crossing", MADE) for _ in range(2)]
    pdf = opened(made[0])

    assert made[0] == made[1]
    for one in pdf.pages:
        assert [float(edge) for edge in one.mediabox] == pytest.approx([0, 0, *size], abs=0.01)


@pytest.mark.usefixtures("page")
def test_numbers_of_other_results_make_another_file() -> None:
    texts = (NUMBERS, NUMBERS.replace("5", "6"))
    files = [opened(report_pdf(SHORT, text, "a4", "crossing", MADE)) for text in texts]
    ids = [bytes(one.trailer.ID[0]) for one in files]

    assert ids[0] == bytes.fromhex(hashlib.sha256(NUMBERS.encode()).hexdigest())[:16] != ids[1]


def test_without_weasyprint_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "weasyprint", None)

    with pytest.raises(UavgramError, match=r"pip install weasyprint"):
        check_pdf()


# The printed report is short: pages are counted, and none is half empty.


ONE: tuple[survey.Measure, ...] = (("skid left", "distance", ("P01", "P10"), "m"),)
MOST_PAGES = {"one": 4, "several": 8}
FOOT, FIRST_FULL, LEAST_FULL = 0.92, 0.88, 0.6
"""Of the height of a page: where its foot begins, and how far down its text must reach.

The plan of the first page fills it; the last page ends where its text ends.
"""


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


def test_no_page_is_half_empty(printed: tuple[str, bytes], tmp_path: Path) -> None:
    full = reach(printed[1], tmp_path)

    assert full[0] > FIRST_FULL, full
    assert full[:-1].min() > LEAST_FULL, full


VARIANTS: dict[str, survey.Variant] = {
    "one photo": {"measures": ONE, "frame_count": 1},
    "no log": {"telemetry": False},
    "no messages": {"clean": True},
    "no lengths": {"lines": ()},
    "many": {
        "measures": tuple(
            (f"D{i}", "distance", (f"P{i % 9:02d}", f"P{9 + i % 11:02d}"), "m") for i in range(40)
        )
    },
}


@pytest.mark.parametrize(("kind", "paper"), [("short", "a4"), ("red", "letter")])
@pytest.mark.parametrize("variant", VARIANTS.values(), ids=VARIANTS)
def test_no_page_of_other_surveys_is_half_empty(
    variant: survey.Variant, kind: str, paper: Paper, tmp_path: Path
) -> None:
    try:
        check_pdf()
    except UavgramError as fault:
        pytest.skip(str(fault))
    result = survey.build(**variant)
    result = with_much_to_say(result) if kind == "red" else result
    page = render_report(result, pictures(result))
    full = reach(report_pdf(page, "{}", paper, "crossing", "2026-01-05T11:00:00Z"), tmp_path)

    assert full[:-1].min() > LEAST_FULL, full


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


@pytest.mark.parametrize("above_mm", range(90, 180, 10))
def test_a_table_is_not_torn_near_its_ends(above_mm: int, tmp_path: Path) -> None:
    pages = pages_of("checks", above_mm, tmp_path)
    rows = [len(re.findall(r"^ *R\d \w+: ", page, re.MULTILINE)) for page in pages]

    assert sum(rows) == 5
    assert max(rows) == 5, rows


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
