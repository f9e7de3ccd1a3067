"""Photos in the report, with what is drawn over them."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from functools import cache
from html import unescape
from pathlib import Path

import cv2
import numpy as np
import pytest
import synthetic_survey as survey
from html_page import Page
from numbers_told import agree

from uavgram.io.results.results_json import write_results
from uavgram.model.arrays import rows_of
from uavgram.model.observations import Source
from uavgram.model.provenance import InputDigest
from uavgram.model.result.result import Picture, Pictures, Result
from uavgram.model.result.tables import LineStatus
from uavgram.stages.products.picture_plan import picture_plan
from uavgram.views.formatting import measurement_text
from uavgram.views.report import render_annex, render_report
from uavgram.views.report.pictures import DASHES, ON_MEASURED, Bar, Gallery, gallery, place_bar
from uavgram.views.style import LINE_COLOURS, hex_colour
from uavgram.views.survey.drawing import Drawing, Look

STRETCH = (12.0, 96.0, 1.5)


@cache
def result() -> Result:
    made = survey.build()
    photos = tuple(
        InputDigest(path=f"photos/{name}", sha256=f"{k:064x}", size_bytes=k)
        for k, name in enumerate(made.frames.frame_id)
    )
    return replace(made, provenance=replace(made.provenance, inputs=photos))


@cache
def pictures() -> Pictures:
    """Grey ones, each of another grey: what they show is not the subject here."""
    shown = [
        Picture(region=one, jpeg=_grey(row), shown_px=8, stretch=STRETCH)
        for row, one in enumerate(picture_plan(result()).regions)
    ]
    return Pictures(shown=tuple(shown), left_out=("P77",))


def _grey(value: int) -> bytes:
    return cv2.imencode(".jpg", np.full((8, 8), value, np.uint8))[1].tobytes()


@cache
def shown() -> Gallery:
    made = gallery(result(), pictures())
    assert made is not None
    return made


@cache
def html() -> str:
    return unescape(render_report(result(), pictures()) + render_annex(result(), pictures()))


def test_without_photos_there_is_no_gallery_and_nothing_may_be_shown() -> None:
    assert gallery(result(), Pictures()) is None
    assert "img-src" not in render_report(result())


def test_pictures_are_in_the_page_itself_which_allows_itself_no_others() -> None:
    page = Page(html())
    images = [str(attrs["href"]) for tag, attrs in page.tags if tag == "image"]
    policy = [attrs["content"] for tag, attrs in page.tags if "http-equiv" in attrs]

    assert all(image.startswith("data:image/jpeg;base64,") for image in images)
    held = [base64.b64decode(image.partition(",")[2]) for image in images]
    of_region = {one.region: one.jpeg for one in pictures().shown}
    cards = (*shown().overview, *shown().measurements, *shown().points)
    assert held == [of_region[one.region] for one in cards]
    assert policy == ["default-src 'none'; style-src 'unsafe-inline'; img-src data:"] * 2


def test_a_name_that_looks_like_a_picture_stays_a_name() -> None:
    named = replace(result(), name="<!-- picture 0 -->")

    assert "&lt;!-- picture 0 --&gt;" in render_report(named, pictures())


def test_the_mark_of_a_point_is_where_it_was_picked() -> None:
    made, picks = result(), result().picks
    for one in shown().points:
        image = made.frames.frame_id[one.region.frame]
        (row,) = [
            i
            for i, pair in enumerate(zip(picks.image, picks.label, strict=True))
            if pair == (image, one.name)
        ]

        assert any(
            np.array_equal(at, picks.pixel_px[[row]]) for at in one.drawing.find_shapes("picks")
        )
        assert any(tag.text == one.name for tag in one.drawing.texts)


def test_a_scale_bar_is_as_long_as_that_length_looks() -> None:
    made = result()
    one = shown().points[0]
    poses, frame = made.frames.refined, one.region.frame
    length_m = float(one.drawing.bar_text.removesuffix(" m"))
    middle = made.points.position_world_m[one.region.row]
    right = poses.world_from_camera[frame][:, 0]
    ends = np.stack([middle - right * length_m / 2, middle + right * length_m / 2])
    back = poses.world_from_camera[frame].T
    turn = cv2.Rodrigues(back)[0]
    lens = survey.LENS
    matrix = np.array([[lens[0], 0, lens[2]], [0, lens[1], lens[3]], [0, 0, 1]])
    pixel = cv2.projectPoints(
        ends, turn, -back @ poses.center_world_m[frame], matrix, lens[[4, 5, 6, 7, 8]]
    )[0][:, 0]

    assert one.drawing.bar == pytest.approx(np.linalg.norm(pixel[1] - pixel[0]), rel=1e-6)


def test_a_scale_bar_stands_where_it_hides_less() -> None:
    one = shown().points[0]
    part, unit = one.region, one.drawing.unit
    y = part.top_px + part.height_px - 20 * unit
    places = {}
    for side, x in (("left", part.left_px + 30 * unit), ("none", part.left_px - 99.0)):
        drawing = Drawing("", part.width_px, part.height_px, unit=unit)
        place_bar(drawing, Bar(40 * unit, "1 m"), part, np.array([[x, y]]))
        places[side] = drawing.written[0].x - part.left_px

    assert places["none"] == pytest.approx(34 * unit)
    assert places["left"] == pytest.approx(part.width_px - 34 * unit)


def test_each_picture_says_of_which_file_and_part_it_is_and_that_it_was_brightened() -> None:
    one = shown().points[0]
    part, frame = one.region, one.region.frame
    name = result().frames.frame_id[frame]
    columns = f"columns {part.left_px} to {part.left_px + part.width_px - 1}"

    assert one.origin.startswith(f"{name}, {columns}")
    assert one.origin.endswith("brightened")
    assert one.origin in html()
    assert f"{frame:064x}" in html()
    assert "values 12 to 96 of 0 to 255 are shown as black to white, gamma 1.50" in html()


def test_the_report_names_the_photos_that_were_brightened() -> None:
    first = pictures().shown[0].region.frame
    some = tuple(
        one if one.region.frame == first else replace(one, stretch=None) for one in pictures().shown
    )
    none = tuple(replace(one, stretch=None) for one in some)
    name = result().frames.frame_id[first]

    assert "All photos were brightened to be seen" in render_report(result(), pictures())
    assert f"; but {name} was brightened" in render_report(result(), Pictures(shown=some))
    assert "brightened" not in render_report(result(), Pictures(shown=none))


def test_a_withheld_length_is_drawn_as_on_the_plan() -> None:
    lines = result().lines
    status: tuple[LineStatus, ...] = tuple("checked" for _ in lines.status)
    made = replace(result(), lines=replace(lines, status=status))
    both = gallery(made, pictures())
    assert both is not None
    looks = [
        {shapes.look for shapes in one.overview[0].drawing.shapes if shapes.name == "lines"}
        for one in (shown(), both)
    ]

    used = ON_MEASURED._replace(stroke=hex_colour(LINE_COLOURS["used"]))
    checked = Look(hex_colour(LINE_COLOURS["checked"]), ON_MEASURED.width, dashes=DASHES)
    assert looks == [{ON_MEASURED, used}, {ON_MEASURED, checked}]
    dashed = f'stroke="{hex_colour(LINE_COLOURS["checked"])}" stroke-width="[0-9.]+" stroke-dash'
    assert re.search(dashed, render_report(made, pictures()))


def test_the_overview_is_not_said_to_show_what_was_not_measured() -> None:
    bare = survey.build(measures=())
    shown_bare = [
        Picture(region=one, jpeg=_grey(1), shown_px=8, stretch=None)
        for one in picture_plan(bare).regions
    ]
    made = gallery(bare, Pictures(shown=tuple(shown_bare)))

    assert made is not None
    assert made.overview[0].told == "The photo that has most of the points."
    assert shown().overview[0].told == "The photo that shows most of the measurements."


def test_who_picked_a_point_is_told_and_what_is_not_shown_is_named() -> None:
    made = result()
    label = shown().points[0].name
    source: tuple[Source, ...] = tuple(
        "target" if one == label else "hand" for one in made.picks.label
    )
    changed = replace(made, picks=replace(made.picks, source=source))
    told = gallery(changed, pictures())

    assert told is not None
    assert told.points[0].told.startswith("found by the program (target)")
    assert all(one.told.startswith("picked by a person") for one in told.points[1:])
    assert "Not shown, as no photo shows them whole, or there are too many: P77." in html()


def test_the_value_of_a_measurement_stands_under_its_picture() -> None:
    for one in shown().measurements:
        row = measurement_text(result().measurements, result().measurements.name.index(one.name))

        assert one.told.startswith(f"{row.value}, ")
        assert one.drawing.find_shapes("lines")


def test_every_number_of_a_caption_is_that_of_the_results(tmp_path: Path) -> None:
    write_results(result(), tmp_path / "results.json")
    file = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    measured = {one["name"]: one for one in file["measurements"]}
    points = {one["label"]: one for one in file["points"]}
    for one in shown().measurements:
        row = measured[one.name]
        pace = 3.6 if row["unit"] == "m/s" else 1.0
        agree([one.told], pace * row["value"], pace * row["sigma"])
    for one in shown().points:
        near = points[one.name]["neighbour_sigma_m"]
        scale = 100 if one.told.endswith("cm to its neighbours") else 1
        agree([one.told], len(points[one.name]["frames"]), near and scale * near)


def test_every_mark_of_a_picture_is_named_once_and_no_name_covers_another() -> None:
    made, several = result(), 0
    for one in (*shown().overview, *shown().points):
        region, unit = one.region, one.drawing.unit
        low = np.array([region.left_px, region.top_px]) - 0.5
        here = [
            label
            for label, image, status, spot in zip(
                made.picks.label,
                made.picks.image,
                made.picks.status,
                made.picks.pixel_px - low,
                strict=True,
            )
            if image == made.frames.frame_id[region.frame] and status != "unused"
            if (spot >= 0).all() and (spot <= [region.width_px, region.height_px]).all()
        ]
        assert sorted(tag.text for tag in one.drawing.texts) == sorted(here)
        several += len(here) > 1
        for k, tag in enumerate(one.drawing.texts):
            half = 3.0 * unit * tag.size * len(tag.text)
            assert low[0] <= tag.x - half
            assert tag.x + half <= low[0] + region.width_px
            for other in one.drawing.texts[:k]:
                aside = half + 3.0 * unit * other.size * len(other.text)
                up = 10.0 * unit * tag.size
                assert abs(tag.x - other.x) >= aside or abs(tag.y - other.y) >= up
    assert several


def test_a_point_that_was_clicked_again_has_one_name() -> None:
    made = result()
    every = np.append(np.arange(len(made.picks.label)), np.arange(len(made.picks.label)))
    picks = made.picks
    twice = rows_of(picks, every) | {"label": picks.label * 2, "status": picks.status * 2}
    again = replace(made, picks=replace(picks, **twice))
    repeated = gallery(again, pictures())
    assert repeated is not None
    for one, once in zip(repeated.overview, shown().overview, strict=True):
        names = sorted(tag.text for tag in one.drawing.texts)
        assert names == sorted(tag.text for tag in once.drawing.texts)


def test_a_picture_of_a_measurement_names_its_own_points_and_wrong_ones_alone() -> None:
    made = result()
    status = tuple(
        "suspect" if label == "P09" and old == "used" else old
        for label, old in zip(made.picks.label, made.picks.status, strict=True)
    )
    told = gallery(replace(made, picks=replace(made.picks, status=status)), pictures())
    assert told is not None
    others = set()
    for one in told.measurements:
        own = set(made.measurements.points[made.measurements.name.index(one.name)])
        named = {tag.text for tag in one.drawing.texts}
        others |= named - own
        assert len(one.drawing.find_shapes("picks")) >= len(named) > 0

    assert others == {"P09"}


def test_an_end_without_a_used_pick_in_the_photo_is_named_where_its_line_ends() -> None:
    made = result()
    first = shown().measurements[0]
    label = made.measurements.points[made.measurements.name.index(first.name)][0]
    image = made.frames.frame_id[first.region.frame]
    for status in ("unused", "removed"):
        changed = tuple(
            status if (photo, name) == (image, label) else old
            for photo, name, old in zip(
                made.picks.image, made.picks.label, made.picks.status, strict=True
            )
        )
        told = gallery(replace(made, picks=replace(made.picks, status=changed)), pictures())
        assert told is not None
        (one,) = [one for one in told.measurements if one.name == first.name]
        end = one.drawing.find_shapes("lines")[0][0]
        named = [text for text in one.drawing.texts if text.text == label]
        away = [np.hypot(text.x - end[0], text.y - end[1]) for text in named]

        assert min(away) < 40 * one.drawing.unit
