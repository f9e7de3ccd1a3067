"""The report says who made picks and points, what ties the photos, and whom a value rests on."""

from __future__ import annotations

from collections import Counter
from functools import cache
from html import unescape

import synthetic_survey as survey
from found_survey import found, tie_cloud
from html_page import Page

from uavgram.model.result.result import Result
from uavgram.views.report import render_annex
from uavgram.views.survey.sources import ONLY_PROGRAM, ties_text

WORDS = (ONLY_PROGRAM, "matched", "tie point", "targets", "made by hand")


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
    assert not [word for word in WORDS if word in plain]
    assert [word for word in WORDS if word in html()] == list(WORDS)
