"""report.html."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from uavgram.errors import OutputError
from uavgram.io.results import write_results
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


class Numbers:
    """The numbers of a page's rows, each with the decimals that it shows."""

    def __init__(self, html):
        self.rows = [row for row in Page(html).rows if row]

    def of(self, first, *wanted, skip=0):
        """True if one row begins with `first` and its numbers are `wanted`, as rounded there."""
        return any(
            self._equal(" ".join(row[1 + skip :]), wanted) for row in self.rows if row[0] == first
        )

    @staticmethod
    def _equal(text, wanted):
        found = re.findall(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?! %)", text)
        return len(found) >= len(wanted) and all(
            abs(float(shown) - value) <= 0.5001 * 10.0 ** -len(shown.partition(".")[2])
            for shown, value in zip(found, wanted, strict=False)
        )


@pytest.mark.parametrize("variant", [{}, {"telemetry": False}], ids=str)
def test_every_number_is_that_of_the_results_file(survey, tmp_path, variant):
    result = survey.build(**variant)
    write_results(result, tmp_path / "results.json")
    said = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    page = Numbers(render_report(result))

    for row in said["measurements"]:
        if row["value"] is not None:
            # kind and points are words; points may hold digits
            assert page.of(row["name"], row["value"], row["sigma"], *row["interval_95"], skip=2)
            assert [row["name"], " – ".join(row["points"])] in [
                [cells[0], cells[2]] for cells in page.rows if len(cells) == 6
            ]
    for row in said["lines"]:
        if row["adjusted_m"] is not None:
            fit = ("length_m", "sigma_m", "adjusted_m", "adjusted_sigma_m", "residual_m", "w")
            assert page.of(row["name"], *(row[key] for key in fit), skip=1)
    for row in said["points"]:
        within, earth = row["relative"]["ellipse_95"], row["ellipse_95"]
        axes = [100 * within[key] for key in ("semi_major_m", "semi_minor_m")]
        axes += [within["azimuth_deg"]]
        axes += [100 * earth[key] for key in ("semi_major_m", "semi_minor_m")]
        place = [row["latitude_deg"], row["longitude_deg"]] if "telemetry" not in variant else []
        assert page.of(row["label"], *row["position_world_m"], *place, *axes)
    for row in said["checks"]:
        if "name" in row:
            assert page.of(row["name"], row["error_m"], row["sigma_m"], row["z"])
        else:
            numbers = (*row["error_m"], *row["sigma_m"], row["mahalanobis"])
            assert page.of(row["label"], *numbers)


def test_points_have_their_ellipse_within_the_survey_and_on_the_earth(survey):
    html = render_report(survey.build())
    (row,) = [row for row in Page(html).rows if row and row[0] == "P00"]

    # half axes of the synthetic survey: a quarter of those on the earth
    assert [row[3], row[5]] == ["4.7 cm × 2.8 cm", "18.8 cm × 11.3 cm"]
    assert "cancels in lengths" in html


def test_the_facts_stand_on_top(survey):
    html = render_report(survey.build())

    assert html.index("20 frames: 17 refined") < html.index("<h2>Measurements")
    assert html.index("P24: 4.7 cm × 2.8 cm") < html.index("<h2>Measurements")


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
