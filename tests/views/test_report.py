"""report.html."""

from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser

import pytest

from uavgram.errors import OutputError
from uavgram.views.report import render_report, write_report


class Page(HTMLParser):
    """Tags, texts and rows of cells; fails where tags do not nest."""

    VOID = ("meta", "br", "polyline", "circle", "path", "line")

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict]] = []
        self.rows: list[list[str]] = []
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if any(tag in self.open for tag in ("td", "th")):
            self.rows[-1][-1] += data


VARIANTS = [
    {},
    {"clean": True},
    {"telemetry": False},
    {"frame_count": 1},
    {"lines": (), "measures": ()},
    {"lines": (), "measures": (), "point_count": 0},
]


@pytest.mark.parametrize("variant", VARIANTS, ids=str)
def test_the_page_is_well_formed_and_loads_nothing(survey, variant):
    page = Page(render_report(survey.build(**variant)))

    assert not [tag for tag, _ in page.tags if tag in ("script", "link", "img", "iframe")]
    assert not [attrs for _, attrs in page.tags if {"src", "href", "onload"} & attrs.keys()]


def test_measurements_come_first_with_their_intervals(survey):
    html = render_report(survey.build())
    rows = Page(html).rows
    by_name = {row[0]: row for row in rows}

    assert html.index("<h2>Measurements") < html.index("<h2>Top view") < html.index("<h2>Known")
    assert by_name["skid left"][3:] == ["39.612 ± 0.021 m", "39.571 to 39.653 m", "0.05 %"]
    assert by_name["to the tree"][3] == "not computed"


def test_names_that_people_wrote_are_harmless(survey):
    nasty = "<script>alert({})</script>"
    html = render_report(survey.build(label=nasty, lines=(), measures=()))

    assert "<script" not in html
    assert "&lt;script&gt;alert(7)" in html


def test_checks_say_inside_or_outside(survey):
    result = survey.build()
    error = result.point_checks.error_m.copy()
    error[1] = [0.0, 0.1, 0.0]  # of 0.03
    worse = replace(result, point_checks=replace(result.point_checks, error_m=error))
    verdicts = [row[::4] for row in Page(render_report(worse)).rows if row[-1].endswith("side")]
    verdicts += [row[::4] for row in Page(render_report(worse)).rows if row[-1].endswith("SIDE")]

    assert verdicts == [["R4 wall", "inside"], ["P21", "inside"], ["P29", "OUTSIDE"]]


def test_the_chain_of_custody_is_complete(survey):
    result = survey.build()
    html = render_report(result)

    for digest in result.provenance.inputs:
        assert digest.sha256 in html
        assert digest.path in html
    for key, _ in result.provenance.options:
        assert key in html
    assert result.provenance.version in html
    assert result.provenance.created_utc in html


def test_every_message_frame_line_and_point_is_on_the_page(survey):
    result = survey.build()
    cells = {cell for row in Page(render_report(result)).rows for cell in row}

    for text in (
        *(message.text for message in result.messages),
        *result.frames.frame_id,
        *result.lines.name,
        *result.points.label,
        *result.measurements.name,
    ):
        assert text in cells


def test_without_telemetry_the_page_says_what_that_means(survey):
    html = render_report(survey.build(telemetry=False))

    assert "there is no map" in html
    assert "up in photo 1" in html


def test_the_same_result_gives_the_same_page(survey, tmp_path):
    write_report(survey.build(), tmp_path / "a.html")
    write_report(survey.build(), tmp_path / "b.html")

    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_a_page_that_cannot_be_written_is_an_output_error(survey, tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        write_report(survey.build(frame_count=1), tmp_path / "nowhere" / "report.html")
