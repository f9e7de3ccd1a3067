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
from html import unescape
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import synthetic_survey

from uavgram.errors import UavgramError
from uavgram.model.maps import Paper
from uavgram.views.report import check_pdf, render_annex, render_report, report_pdf

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
