"""The page taken apart for paper."""

from __future__ import annotations

import base64
import xml.etree.ElementTree as ET

import synthetic_survey as survey

from uavgram.views.pages_pdf import DRAWING, PHOTO, split_page
from uavgram.views.report import render_report

JPEG = b"\xff\xd8 not quite \xff\xd9"
INSIDE = f"data:image/jpeg;base64,{base64.b64encode(JPEG).decode()}"


def test_a_photo_in_a_drawing_is_a_file_that_the_drawing_names() -> None:
    html = (
        "<style>p svg.photo { width: 9px }</style><p>svg"
        f'<svg class="photo" viewBox="0 0 9 6" aria-label="R&amp;1"><image href="{INSIDE}"/></svg>'
    )
    apart = split_page(html)

    assert apart.html == (
        "<style>p img.photo { width: 9px }</style><p>svg"
        '<img class="photo" alt="R&amp;1" src="part:1">'
    )
    assert apart.parts["part:0"] == (PHOTO, JPEG)
    kind, drawing = apart.parts["part:1"]
    assert kind == DRAWING
    assert ET.fromstring(drawing)[0].attrib["href"] == "part:0"  # noqa: S314 (our own)


def test_every_drawing_of_a_report_is_a_drawing_by_itself() -> None:
    html = render_report(survey.build(label="\"<&>'"))
    apart = split_page(html)
    drawings = [part.content for part in apart.parts.values() if part.kind == DRAWING]

    assert len(drawings) == html.count("<svg")
    assert "<svg" not in apart.html
    assert all(ET.fromstring(one).tag.endswith("}svg") for one in drawings)  # noqa: S314
