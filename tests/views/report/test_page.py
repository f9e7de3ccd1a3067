"""report.html and report-annex.html."""

from __future__ import annotations

import getpass
from collections import Counter
from dataclasses import replace
from functools import cache
from html import unescape
from pathlib import Path

import numpy as np
import pytest
import synthetic_survey as survey
from found_survey import found, tie_cloud
from full_report import full
from html_page import Page
from uneven_ground import NOISE, uneven

from uavgram.estimation.measuring.error_budget import SOURCES
from uavgram.estimation.survey.observations.observation import ErrorSource
from uavgram.io.results.results_json import dump_results
from uavgram.model.message import Message
from uavgram.model.result.reliability import ErrorBudget, Noise, RemovalRecord, Verdict
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.views.report import annex_of, render_annex, render_report, write_report
from uavgram.views.report.measurements import (
    COLOURS,
    OTHER_COLOUR,
    budget_table,
    describe_learnt_noise,
)
from uavgram.views.survey.key_facts import ONLY_PROGRAM, ties_text
from uavgram.views.tables import draw_gauge

VARIANTS = [
    {},
    {"clean": True},
    {"telemetry": False},
    {"frame_count": 1},
    {"lines": (), "measures": ()},
    {"lines": (), "measures": (), "point_count": 0},
]


RENDERED = {"report": render_report, "annex": render_annex}


def links(page: Page) -> set[str]:
    return {str(attrs["href"]) for _, attrs in page.tags if "href" in attrs}


@pytest.mark.parametrize("variant", VARIANTS, ids=str)
def test_both_pages_are_well_formed_and_load_nothing(variant: survey.Variant) -> None:
    for result in (survey.build(**variant), full(survey.build(**variant))):
        pages = {name: Page(html(result)) for name, html in RENDERED.items()}

        for page in pages.values():
            assert not [tag for tag, _ in page.tags if tag in ("script", "link", "img", "iframe")]
            attributes = {name for _, attrs in page.tags for name in attrs}
            assert not [n for n in attributes if n == "src" or n.startswith("on")]
        assert links(pages["report"]) == {"report-annex.html"}
        sections = {f"#{a.get('id')}" for tag, a in pages["annex"].tags if tag == "section"}
        # the contents: all of them, and the way back
        assert links(pages["annex"]) == sections | {"report.html"}


def test_texts_in_drawings_say_themselves_what_they_look_like() -> None:
    """What makes the PDF knows no style sheet inside of drawings."""
    page = Page(render_report(full(survey.build())))
    texts = [attrs for tag, attrs in page.tags if tag == "text"]
    drawings = [attrs for tag, attrs in page.tags if tag == "svg" and "role" in attrs]

    assert len(texts) > 20
    for attrs in texts:
        assert {"font-size", "fill", "textLength".lower()} <= {name.lower() for name in attrs}
    for attrs in drawings:
        assert {"font-family", "text-anchor"} <= attrs.keys()


def test_the_page_forbids_itself_scripts_and_loading() -> None:
    """So it looks the same where JavaScript is off: there is none."""
    (policy,) = [
        attrs["content"]
        for tag, attrs in Page(render_report(survey.build())).tags
        if tag == "meta" and attrs.get("http-equiv") == "Content-Security-Policy"
    ]

    assert policy == "default-src 'none'; style-src 'unsafe-inline'"


def test_measurements_come_first_with_their_intervals() -> None:
    html = render_annex(survey.build())
    rows = Page(html).rows
    by_name = {row[0]: row for row in rows}

    assert html.index("<h2>Measurements") < html.index("<h2>Top view") < html.index("<h2>Known")
    assert by_name["skid left"][3:6] == ["39.612 ± 0.021 m", "39.571 to 39.653 m", "0.05 %"]
    assert by_name["to the tree"][3] == by_name["to the tree"][6] == "not computed"


def test_names_that_people_wrote_are_harmless() -> None:
    nasty = "<script>alert({})</script>"
    html = render_report(survey.build(label=nasty, lines=(), measures=()))

    assert "<script" not in html
    assert "&lt;script&gt;alert(7)" in html


def test_checks_that_fit_alone_and_not_together_are_not_praised() -> None:
    result = survey.build()
    off = Message("warning", "checks-misfit", "They are further off than they may be.")
    html = render_report(replace(result, messages=(*result.messages, off)))

    assert (
        html.count(
            "3 of 3 are within three times their uncertainty, but TOGETHER they are further off"
        )
        == 2
    )
    assert '<p class="overall bad">' in html
    assert '<p class="overall good">' in render_report(result)


def test_where_the_verdict_is_red_checks_that_fit_are_not_green() -> None:
    red = replace(survey.build(), verdict=Verdict(level="red", reasons=()))
    html = render_report(red)

    assert "3 of 3 are within three times their uncertainty." in html
    assert '<p class="overall none">' in html
    assert "But the verdict on the whole is red" in html


def test_lengths_that_were_computed_with_are_no_check_and_their_hidden_errors_are_named() -> None:
    result = survey.build()
    weak = replace(result.lines, mdb_m=np.full(len(result.lines.name), 1.1))
    html = render_report(replace(result, lines=weak))

    assert "that they agree with it is no check of it." in html
    assert html.count("a tape misread by less than 1.10 m at ") == 1


def test_checks_say_inside_or_outside() -> None:
    result = survey.build()
    error = result.point_checks.error_m.copy()
    error[1] = [0.0, 0.1, 0.0]  # of 0.03
    worse = replace(result, point_checks=replace(result.point_checks, error_m=error))
    html = render_report(worse)
    rows = [row for row in Page(html).rows if row and row[-1] in ("inside", "OUTSIDE")]

    assert [[row[0], row[-1]] for row in rows] == [
        ["R4 wallP24 – P28", "inside"],
        ["P21", "inside"],
        ["P29", "OUTSIDE"],
    ]
    assert "2 of 3 are within three times their uncertainty, 1 OUTSIDE." in html
    assert "3 of 3 are within three times their uncertainty." in render_report(result)


def test_the_chain_of_custody_is_complete() -> None:
    result = survey.build()
    html = render_annex(result)

    for digest in result.provenance.inputs:
        assert digest.sha256 in html
        assert digest.path in html
    for key, _ in result.provenance.options:
        assert key in html
    assert result.provenance.version in html
    assert result.provenance.created_utc in html
    assert html.count(" UTC by Ada Lovelace") == html.count("(UTC) by Ada Lovelace") == 1


def test_nothing_names_the_account_that_ran_the_program(
    data_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LOGNAME", "zaphod")
    result = compute(read_inputs(data_dir / "cuav" / "project.yaml")).result
    html = render_report(result) + render_annex(result)

    for text in (html, dump_results(result)):
        assert "zaphod" not in text
        assert getpass.getuser() == "zaphod"
        assert "the account" not in text
    assert '<tr><td class="quiet">Name</td><td></td></tr>' in html


def test_who_answers_for_the_survey_is_named_above_the_signature() -> None:
    html = render_report(survey.build())

    assert '<tr><td class="quiet">Name</td><td>Ada Lovelace</td></tr>' in html


def test_every_message_frame_line_and_point_is_on_one_of_the_pages() -> None:
    result = survey.build()
    html = render_report(result) + render_annex(result)
    cells = {cell for row in Page(html).rows for cell in row}
    ends = zip(result.lines.start, result.lines.end, strict=True)

    for text in (
        *(message.text for message in result.messages),
        *(message.code for message in result.messages),
        *result.frames.frame_id,
        *(f"{n}{a} – {b}" for n, (a, b) in zip(result.lines.name, ends, strict=True)),
        *result.points.label,
        *result.measurements.name,
    ):
        assert text in cells


def test_points_have_their_ellipse_within_the_survey_and_on_the_earth() -> None:
    html = render_annex(survey.build())
    (row,) = [row for row in Page(html).rows if row and row[0] == "P00"]

    # half axes of the synthetic survey: a quarter of those on the earth
    assert [row[4], row[6]] == ["4.7 cm × 2.8 cm", "18.8 cm × 11.3 cm"]
    assert "cancels in lengths" in html


def test_the_facts_stand_on_top() -> None:
    html = render_annex(survey.build())

    assert html.index("20 photos: 17 refined") < html.index("<h2>Measurements")
    assert html.index("P24: 4.7 cm × 2.8 cm") < html.index("<h2>Measurements")


def test_without_telemetry_the_page_says_what_that_means() -> None:
    html = render_annex(survey.build(telemetry=False))

    assert "there is no map" in html
    assert "up in photo 1" in html


def test_the_same_result_gives_the_same_page(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_report(survey.build(), tmp_path / name / "report.html")

    for file in ("report.html", annex_of(tmp_path / "report.html").name):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_a_bar_for_each_measurement_is_as_long_as_its_shares() -> None:
    result = full(survey.build())
    budget = result.error_budget
    assert budget is not None
    page = Page(render_annex(result))
    share = {
        name: dict(zip(budget.source, row, strict=True))
        for name, row in zip(result.measurements.name, budget.share, strict=True)
    }
    bars = {row[0]: drawn for row, drawn in zip(page.rows, page.drawn, strict=True) if drawn}
    bars = {name: [d for d in drawn if d["height"] == "14"] for name, drawn in bars.items()}
    bars = {name: drawn for name, drawn in bars.items() if drawn}

    assert set(bars) == set(result.measurements.name) - {"to the tree"}
    for name, drawn in bars.items():
        order = ["picks", "lens", "known lengths", "flight log", "friction and times"]
        expected = [100 * share[name][source] for source in order]
        widths = [float(part["width"] or "") for part in drawn]
        np.testing.assert_allclose(widths, [e for e in expected if e >= 0.05], atol=0.006)
        assert sum(expected) == pytest.approx(100)
        starts = [float(part["x"] or "") for part in drawn]
        np.testing.assert_allclose(starts[1:], np.cumsum(widths)[:-1], atol=0.06)


def test_the_largest_source_of_each_measurement_is_said() -> None:
    result = full(survey.build())
    html, budget = render_annex(result), result.error_budget
    assert budget is not None
    largest = [budget.source[k] for k in np.argmax(budget.share[:-1], axis=1)]
    rows = [row for row in Page(html).rows if len(row) == 4 and row[1] == ""]
    by_name = {row[0]: row[2] for row in rows}

    assert [by_name[name] for name in result.measurements.name[:-1]] == largest
    for source in set(largest):
        assert f"Largest in {largest.count(source)} of 9: {source} (" in html


def test_every_source_of_the_program_has_a_colour() -> None:
    assert set(COLOURS) == set(SOURCES)
    assert len(set(COLOURS.values())) == len(COLOURS)


def test_the_source_of_a_new_kind_is_shown_in_another_colour(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    new = ErrorSource("compass", "how well a compass was read", "Reading it twice would help.")
    monkeypatch.setitem(SOURCES, new.name, new)
    result = full(survey.build())
    budget = result.error_budget
    assert budget is not None
    share = np.zeros_like(budget.share)
    share[:, 0] = 1.0
    source = (new.name, *budget.source[1:])
    table = budget_table(replace(result, error_budget=ErrorBudget(source=source, share=share)))
    assert table is not None

    assert table.sources[-1] == (new.name, OTHER_COLOUR)
    assert new.advice in table.summary[0]


def test_withheld_lengths_stand_among_the_checks_only() -> None:
    html = render_report(survey.build()) + render_annex(survey.build())
    rows = [row for row in Page(html).rows if row]

    assert len([row for row in rows if row[0].startswith("R4 wall")]) == 1


def test_planes_of_several_areas_replace_that_of_one() -> None:
    one, several = render_annex(survey.build()), render_annex(full(survey.build()))

    assert "height of the ground plane" in one
    assert "height of the ground plane" not in several
    assert "bank &lt;of the river&gt;" in several


def test_where_first_order_is_not_enough_the_way_out_is_said() -> None:
    result = full(survey.build())
    off = np.arange(len(result.measurements.name)) == 2
    assert result.second_order is not None
    doubtful = replace(result, second_order=replace(result.second_order, off=off))

    assert "changes a ± by 2.1 % at most, and a value by 0.03 of its ±" in render_annex(result)
    assert "use the sampled intervals" in render_annex(doubtful)
    alone = render_annex(replace(doubtful, monte_carlo=None))
    assert "run again with --monte-carlo and use its intervals" in alone
    flagged = [row for row in Page(alone).rows if len(row) == 9 and "approximate" in row[1]]
    assert [row[0] for row in flagged] == [result.measurements.name[2]]


def test_another_solution_shows_what_it_changes_most() -> None:
    result = full(survey.build())
    (other,) = result.solution.alternatives
    sigmas = np.abs(np.array(other.values) - result.measurements.value) / result.measurements.sigma
    order = [result.measurements.name[i] for i in np.argsort(-sigmas[:-1])]
    rows = [row for row in Page(render_annex(result)).rows if len(row) == 5 and row[0] in order]

    assert [row[0] for row in rows] == order
    assert [float(row[4]) for row in rows] == pytest.approx(np.sort(sigmas[:-1])[::-1], abs=0.0501)


def test_a_removal_names_the_measurements_that_it_moved_most() -> None:
    result = survey.build()
    change = np.where(np.arange(10) == 4, 5.0, 1e-3)  # in sigmas
    record = RemovalRecord(
        what="length 'north'",
        w=-25.94,
        group=(),
        rivals=(),
        variance_factor_before=9.12,
        variance_factor_after=1.03,
        change=tuple(change * result.measurements.sigma),
    )
    html = render_annex(replace(result, removals=(record,))).replace("&#39;", "'")

    assert "That moved 'patch' by +4.500 m², " in html
    assert " and 4 more by fewer of their sigmas." in html


@pytest.mark.parametrize(("name", "sigmas", "at"), [("end", 9.0, 100.0), ("middle", 0.0, 50.0)])
def test_a_gauge_shows_sigmas_within_its_ends(name: str, sigmas: float, at: float) -> None:
    mark = draw_gauge(sigmas, 3.0)

    assert mark is not None
    assert (mark.at, mark.low, mark.high) == (at, 25.0, 75.0), name
    assert mark.outside == (sigmas > 3)
    assert draw_gauge(np.nan, 3.0) is None


def test_the_method_names_what_its_formulas_take() -> None:
    html = render_annex(survey.build())

    assert "2.4477 = √(−2 ln 0.05)" in html
    assert "(|w| beyond 3.29; more than ten tests of one kind share that of ten" in html
    assert "∇ = 4.13 σ" in html
    for name in ("Baarda", "GUM", "Zhang", "S-transformation", "JCGM 101", "√(2 μ g s)"):
        assert name in html


# The report says who made picks and points, what ties the photos, and whom a value rests on.


ORIGIN_WORDS = (ONLY_PROGRAM, "matched", "tie point", "targets", "made by hand")


@cache
def result() -> Result:
    made = survey.build()
    return found(made, tie_cloud(made))


@cache
def html() -> str:
    return unescape(render_annex(result()))


@cache
def rows() -> dict[str, list[str]]:
    """By the first cells; of several tables with such a row, the last before the annex."""
    every = Page(html()).rows
    annex = next(i for i, row in enumerate(every) if "omega [°]" in row)
    return {row[0]: row for row in every[:annex] if row}


def test_a_value_of_targets_alone_says_that_no_person_picked_it() -> None:
    told = [row[0] for row in Page(html()).rows if any(ONLY_PROGRAM in cell for cell in row)]
    # P01 and P10 are targets, and the ends of both of these
    assert sorted(set(told)) == ["skid left", "skid speed"]


def test_points_and_photos_say_who_made_their_picks() -> None:
    made = result()
    for label in ("P01", "P13", "P02"):
        picked = [
            source
            for one, source, status in zip(
                made.picks.label, made.picks.source, made.picks.status, strict=True
            )
            if one == label and status != "unused"
        ]
        said = {
            "P01": f"{len(picked)} targets",
            "P13": f"1 by hand, {len(picked) - 1} matched",
            "P02": "",
        }[label]
        frames = made.points.frames[made.points.label.index(label)]
        assert rows()[label][-1] == f"{len(frames)}{said}"
    photo = made.frames.frame_id[12]
    counts = [
        sum(
            i == photo and s == source
            for i, s in zip(made.picks.image, made.picks.source, strict=True)
        )
        for source in ("hand", "match", "target")
    ]
    assert rows()[photo][3] == "{}{} by hand, {} matched, {} targets".format(sum(counts), *counts)


def test_all_picks_together_are_counted_by_who_made_them() -> None:
    made = Counter(result().picks.source)
    told = f"Picks: {made['hand']} by hand, {made['match']} matched, {made['target']} targets."
    assert told in html()


def test_ties_of_each_photo_stand_in_the_table_of_photos() -> None:
    made = result()
    for i, photo in enumerate(made.frames.frame_id):
        count, rms = made.frames.ties[i], made.frames.ties_rms_px[i]
        assert rows()[photo][4] == (f"{count} ({rms:.2f} px)" if count else "0")
    assert "400 tie points found by the program" in html()
    assert ties_text(made) in html()


def test_the_sigma_of_each_source_stands_under_its_name() -> None:
    assert rows()["picks made by hand, one coordinate"][1:3] == ["0.80 px", "0.99 ± 0.04 px"]
    assert rows()["targets, one coordinate"][1:3] == ["0.050 px", "0.062 ± 0.003 px"]
    assert rows()["matches, one coordinate"][1:3] == ["0.100 px", "0.124 ± 0.005 px"]
    assert rows()["tie points, one coordinate"][1:3] == ["0.200 px", "0.248 ± 0.010 px"]


def test_where_people_picked_everything_nothing_of_it_is_said() -> None:
    plain = unescape(render_annex(survey.build()))
    assert not [word for word in ORIGIN_WORDS if word in plain]
    assert [word for word in ORIGIN_WORDS if word in html()] == list(ORIGIN_WORDS)


# What the report says of errors that the survey showed to be of another size than stated.


def grown(result: Result, ratio: float, *, noise: Noise | None = NOISE) -> Result:
    """Sigmas that grew by `ratio`, the last one by a tenth more."""
    rows = result.measurements
    times = np.full(len(rows.sigma), ratio)
    times[np.flatnonzero(np.isfinite(rows.sigma))[-1]] *= 1.1
    return replace(result, measurements=replace(rows, sigma_stated=rows.sigma / times), noise=noise)


def test_growth_is_told_with_its_causes() -> None:
    result = grown(survey.build(), 1.9)
    sentence = (
        "The uncertainties are 1.9 to 2.1 times as large as with errors as stated, because "
        "the ground is not a plane and the picks are less exact than stated (1 px stated, 1.6 px "
        "found)."
    )
    assert describe_learnt_noise(result) == sentence
    assert sentence in render_annex(result)


def test_smaller_uncertainties_are_told_too() -> None:
    (picks,), flat = NOISE.picks, replace(NOISE.roughness[0], estimated_m=0.0, relief_m=0.0)
    noise = Noise(picks=(replace(picks, factor=0.5),), roughness=(flat,))
    assert describe_learnt_noise(grown(survey.build(), 0.5, noise=noise)) == (
        "The uncertainties are 0.5 to 0.6 times as large as with errors as stated, because "
        "the picks are more exact than stated (1 px stated, 0.5 px found)."
    )


@pytest.mark.parametrize(("ratio", "noise"), [(0.952, NOISE), (2.0, None)])
def test_nothing_is_told_of_little_changes_or_where_nothing_was_learnt(
    ratio: float, noise: Noise | None
) -> None:
    assert not describe_learnt_noise(grown(survey.build(), ratio, noise=noise))
    assert not describe_learnt_noise(survey.build(measures=()))


def test_the_drawing_says_in_words_what_colours_and_numbers_are() -> None:
    html, flat = render_annex(uneven(survey.build())), render_annex(survey.build())

    for words in ("ground above its plane", "below it", "centimetres above (+) or below (-)"):
        assert words in html
        assert words not in flat
    assert "ground off its plane [m]" in html
    assert "-0.200 ± 0.020" in html
    assert "off its plane [m]" not in flat
