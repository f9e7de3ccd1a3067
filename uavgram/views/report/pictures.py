"""Photos in the report: parts of them, with marks and scale bars drawn over them as lines."""

from __future__ import annotations

import math
import re
from base64 import b64encode
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground.row_projection import row_poses
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.naming import format_count
from uavgram.model.observations import Source
from uavgram.model.result.result import Picture, Pictures, Region, Result
from uavgram.stages.products.map_layers import measured_strips, reference_strips
from uavgram.views.formatting import (
    measurement_text,
    number,
    select_least_certain,
    size_text,
)
from uavgram.views.style import BAD, LINE_COLOURS, MEASURED, OBSERVED, hex_colour
from uavgram.views.survey.drawing import Drawing, Look, Sign
from uavgram.views.survey.key_facts import note_automatic_values
from uavgram.views.survey.outlines import (
    project_from,
    project_polylines,
    sample_polyline,
    thin_polyline,
    visible_runs,
)
from uavgram.views.survey.text_placement import TextRequest, box
from uavgram.views.survey.top_view import list_used_labels
from uavgram.views.survey.verdict import status_text
from uavgram.views.tables import Cell, Table, make_table
from uavgram.views.units import round_bar, units_of


class Bar(NamedTuple):
    """Scale bar in pixels of the photo, and its length in words."""

    length: float
    text: str


def scale_bars(result: Result, regions: Sequence[Region]) -> dict[Region, Bar]:
    """Compute scale bars at the depth of each picture's subject; an overview has none."""
    shown = [region for region in regions if region.subject != "overview"]
    if not shown:
        return {}
    row_of = {label: row for row, label in enumerate(result.points.label)}
    place = result.points.position_world_m
    around = [[row_of[label] for label in _around(result, region)] for region in shown]
    middle = np.stack([place[rows].mean(axis=0) for rows in around])
    poses = row_poses(result, np.array([region.frame for region in shown]))
    # ground size of a pixel: depth along the optical axis over the focal length
    depth_m = np.sum((middle - poses.center) * poses.rotation[:, :, 2], axis=1)
    pixel_m = depth_m / float(result.shared.intrinsics.value[0])
    units = units_of(result)
    bars = [
        round_bar(0.35 * region.width_px * size_m, units) if size_m > 0 else (np.nan, "")
        for region, size_m in zip(shown, pixel_m.tolist(), strict=True)
    ]
    # ends of a bar parallel to the rows of the photo
    half = poses.rotation[:, :, 0] * np.array([[bar_m] for bar_m, _ in bars]) / 2
    # project the bars of all pictures at once: there may be hundreds
    ends = project_from(result, poses, np.stack([middle - half, middle + half]))
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    return {
        region: Bar(long, text)
        for region, long, (_, text) in zip(shown, length.tolist(), bars, strict=True)
        if np.isfinite(long)
    }


def place_bar(drawing: Drawing, bar: Bar, region: Region, picked_px: Floats) -> None:
    """Draw the bar at the left end of the lower edge, or at the right one if it hides less there.

    Parameters
    ----------
    drawing
        Drawing in pixels of the photo.
    bar
        Bar to place.
    region
        Part of the photo.
    picked_px
        (n, 2) picks that it should not hide.
    """
    unit = drawing.unit
    width = max(bar.length + 20 * unit, 48 * unit)
    edge, low = 4 * unit, region.top_px + region.height_px - 36 * unit
    sides = region.left_px + np.array([edge, region.width_px - width - edge])
    x, y = picked_px[:, :1], picked_px[:, 1:]
    hidden = (y > low) & (x - 8 * unit < sides + width) & (x + 8 * unit > sides)
    left = sides[np.argmin(hidden.sum(axis=0))] + (width - bar.length) / 2
    base = region.top_px + region.height_px - 22 * unit
    drawing.scale_bar(float(left), base, bar.length, bar.text, patch=0.85)


def _around(result: Result, region: Region) -> tuple[str, ...]:
    """Return the labels at whose centre a scale bar is valid."""
    if region.subject == "point":
        return (result.points.label[region.row],)
    return result.measurements.outlines[region.row]


WIDTHS = {"overview": 640.0, "single": 500.0, "half": 400.0, "third": 270.0, "quarter": 210.0}
"""Width of each kind of picture on the page, in units of its marks."""
UNIT_STEPS = 8
"""Number of units per factor of two: WeasyPrint loads its fonts again for each size of letters."""
SIZES = {0: "half", 1: "single", 2: "half", 3: "third", 4: "half"}
"""Kind of pictures for small numbers of measurements; otherwise four are side by side."""
MAX_SHOWN = 12
"""Number of measurements with a picture in the report, least certain; the annex has the others."""
DRAWN_OFF = 0.3
"""Tolerance for drawing a bent line, in the same unit."""
HALF_MIDDLE = 3.0
"""Half size of the area around the middle of a mark without names, in the same unit."""
PICKED_BY: dict[Source, str] = {
    "hand": "picked by a person",
    "match": "found by the program (matched)",
    "target": "found by the program (target)",
}


ON_MEASURED = Look(hex_colour(MEASURED), 1.6)
DASHES = "7 4"
SHADOW = "#101418"
SIGNS: dict[str, Sign] = {
    "hand": "ring", "match": "square", "target": "diamond", "removed": "cross",
}  # fmt: skip
"""Sign of a pick by its origin as in `Source`, or of a removed one."""


class PhotoPicture(NamedTuple):
    """Picture with its overlay.

    Attributes
    ----------
    region
        Part of the photo.
    drawing
        The overlay, in pixels of the photo: ``lines``, ``picks``, names, and a scale bar along the
        photo's rows, valid in the middle.
    name, told
        Subject of the picture, and remark on it.
    origin
        Name of the photo, and the part of its file that is shown.
    """

    region: Region
    drawing: Drawing
    name: str
    told: str
    origin: str


class Gallery(NamedTuple):
    """All pictures of a report.

    Attributes
    ----------
    files
        The photos that they are parts of.
    brightened
        The names of those photos that are shown brighter than they are stored.
    overview, measurements, size
        Pictures of the report, and the class of its measurements.
    more, points, left_out
        Pictures of the annex: other measurements, points, and names of subjects not shown.
    """

    files: Table
    brightened: tuple[str, ...]
    overview: tuple[PhotoPicture, ...]
    measurements: tuple[PhotoPicture, ...]
    more: tuple[PhotoPicture, ...]
    points: tuple[PhotoPicture, ...]
    left_out: tuple[str, ...]
    size: str


class _SharedContent(NamedTuple):
    """Content shared by all pictures, made once.

    Attributes
    ----------
    lines
        Polylines in pixels of the photo and their style, by region.
    bars
        Scale bars by region; some have none.
    alone
        Notes on the picks of each measurement.
    picks
        Rows of the picks that the adjustment considered, used ones first, by frame.
    places
        (K, 2) adjusted places of all points by frame that is shown; NaN outside the photo.
    """

    lines: dict[Region, list[tuple[Floats, Look]]]
    bars: dict[Region, Bar]
    alone: Sequence[str]
    picks: dict[int, Ints]
    places: dict[int, Floats]


def gallery(result: Result, pictures: Pictures) -> Gallery | None:
    """Lay out the pictures; return None if there are none."""
    if not pictures.shown:
        return None
    drawn = _collect_shared_content(result, [one.region for one in pictures.shown])
    first = _in_report(result, pictures)
    size = SIZES.get(len(first), "quarter")
    made: dict[str, list[PhotoPicture]] = {"overview": [], "first": [], "more": [], "point": []}
    for row, picture in enumerate(pictures.shown):
        subject: str = picture.region.subject
        if subject == "measurement":
            subject = "first" if row in first else "more"
        width = {"overview": "overview", "first": size}.get(subject, "quarter")
        steps = round(UNIT_STEPS * math.log2(picture.region.width_px / WIDTHS[width]))
        unit = 2.0 ** (steps / UNIT_STEPS)
        made[subject].append(_photo_picture(result, drawn, picture, unit, row))
    stretch = {one.region.frame: _stretch_text(one) for one in pictures.shown}
    brightened = {one.region.frame for one in pictures.shown if one.stretch is not None}
    names = result.frames.frame_id
    return Gallery(
        files=make_table(
            "photo | SHA-256 of the file | shown",
            (
                (names[f], Cell(photo_sha256(result, f) or "–", look="mono"), words)
                for f, words in sorted(stretch.items())
            ),
        ),
        brightened=tuple(names[frame] for frame in sorted(brightened)),
        overview=tuple(made["overview"]),
        measurements=tuple(made["first"]),
        more=tuple(made["more"]),
        points=tuple(made["point"]),
        left_out=pictures.left_out,
        size=size,
    )


def _in_report(result: Result, pictures: Pictures) -> set[int]:
    """Return the pictures of the measurements that are not ok, or the least certain."""
    picture = {
        one.region.row: k
        for k, one in enumerate(pictures.shown)
        if one.region.subject == "measurement"
    }
    return {
        picture[row] for row in select_least_certain(result.measurements, tuple(picture), MAX_SHOWN)
    }


def _collect_shared_content(result: Result, regions: Sequence[Region]) -> _SharedContent:
    picks, frames = result.picks, {region.frame for region in regions}
    image, status = np.array(picks.image), np.array(picks.status)
    removed_last = np.argsort(status == "removed", kind="stable")
    seen = removed_last[status[removed_last] != "unused"]
    names = result.frames.frame_id
    return _SharedContent(
        lines=_lines_in(result, regions),
        bars=scale_bars(result, regions),
        alone=note_automatic_values(result),
        picks={frame: seen[image[seen] == names[frame]] for frame in frames},
        places={
            frame: project_from(result, row_poses(result, frame), result.points.position_world_m)
            for frame in frames
        },
    )


def photo_sha256(result: Result, frame: int) -> str:
    """Return the checksum of the photo's file from the chain of custody; empty if not listed."""
    digests = {one.path: one.sha256 for one in result.provenance.inputs}
    return digests.get(result.frames.path[frame], "")


def _stretch_text(picture: Picture) -> str:
    if picture.stretch is None:
        return "as stored"
    black, white, gamma = picture.stretch
    return (
        f"brightened to be seen: values {number(black, 0)} to {number(white, 0)} of 0 to 255 are "
        f"shown as black to white, gamma {number(gamma, 2)}"
    )


def _photo_picture(
    result: Result, drawn: _SharedContent, picture: Picture, unit: float, row: int
) -> PhotoPicture:
    region = picture.region
    picks = _picks_in(result, drawn, region)
    name, told = _words(result, drawn, region, picks)
    corner = np.array([region.left_px, region.top_px]) - 0.5
    size = np.array([region.width_px, region.height_px])
    label = f"{name} in a photo"
    drawing = Drawing(label, *size.tolist(), corner=corner, unit=unit, kind="photo")
    drawing.image(corner, size, picture_mark(row))
    lines = [(thin_polyline(run, DRAWN_OFF * unit), look) for run, look in drawn.lines[region]]
    drawing.lines("shadows", [line for line, _ in lines], Look(SHADOW, 3.4, opacity=0.6))
    drawing.lines_by_look("lines", lines)
    _draw_picks(drawing, result, region, picks)
    if region in drawn.bars:
        place_bar(drawing, drawn.bars[region], region, result.picks.pixel_px[picks])
    _name_points(drawing, result, drawn, region, picks)
    return PhotoPicture(
        region=region,
        drawing=drawing,
        name=name,
        told=told,
        origin=_origin(result, picture),
    )


def _origin(result: Result, picture: Picture) -> str:
    region = picture.region
    right, bottom = region.left_px + region.width_px - 1, region.top_px + region.height_px - 1
    reduced = picture.shown_px < region.width_px
    return (
        f"{result.frames.frame_id[region.frame]}, columns {region.left_px} to {right}, rows "
        f"{region.top_px} to {bottom}"
        + (f", reduced to {picture.shown_px} columns" if reduced else "")
        + (", brightened" if picture.stretch else "")
    )


def _words(
    result: Result, drawn: _SharedContent, region: Region, picks: Sequence[int]
) -> tuple[str, str]:
    if region.subject == "overview":
        is_measured = any(look == ON_MEASURED for _, look in drawn.lines[region])
        most = "shows most of the measurements" if is_measured else "has most of the points"
        return "Overview", f"The photo that {most}."
    if region.subject == "point":
        label = result.points.label[region.row]
        made = [
            i
            for i in picks
            if result.picks.label[i] == label and result.picks.status[i] != "removed"
        ]
        sources = [result.picks.source[i] for i in made]
        who = PICKED_BY["hand" if "hand" in sources else sources[0]] if sources else ""
        used = format_count(len(result.points.frames[region.row]), "photo")
        sigma = float(result.points.neighbour_sigma_m[region.row])
        near = (
            f"; ± {size_text(sigma, units_of(result))} to its neighbours"
            if np.isfinite(sigma)
            else ""
        )
        return label, f"{who}; used in {used}{near}"
    row = measurement_text(result.measurements, region.row, units_of(result))
    alone = drawn.alone[region.row]
    status = status_text(result.measurements, region.row)
    return row.name, f"{row.value}, {status}{f' ({alone})' if alone else ''}"


def _picks_in(result: Result, drawn: _SharedContent, region: Region) -> list[int]:
    """Return the rows of the picks in a region that the adjustment considered, used ones first."""
    rows = drawn.picks[region.frame]
    return [int(row) for row in rows[_is_in_region(result.picks.pixel_px[rows], region)]]


def _is_in_region(pixel_px: Floats, region: Region) -> Bools:
    """Mark (n,) the (n, 2) pixels within a region; NaN is outside."""
    away = pixel_px - np.array([region.left_px, region.top_px]) + 0.5
    inside = (away >= 0.0) & (away <= [region.width_px, region.height_px])
    return np.asarray(inside.all(axis=1), np.bool_)


def _draw_picks(drawing: Drawing, result: Result, region: Region, rows: Sequence[int]) -> None:
    """Draw the signs of all picks, and where they leave room a cross in the middle of each."""
    picks, outline = result.picks, _outline(region)
    alike: dict[tuple[str, str], list[int]] = {}
    for i in rows:
        kind: str = "removed" if picks.status[i] == "removed" else picks.source[i]
        colour = hex_colour(BAD if _is_wrong(result, i) else OBSERVED)
        alike.setdefault((kind, colour), []).append(i)
    for (kind, colour), own in alike.items():
        looks = Look(SHADOW, 3.0), Look(colour, 1.4)
        drawing.signs("picks", picks.pixel_px[own], outline, *looks, sign=SIGNS[kind])
        if region.subject != "point":
            middle = Look(colour, 0.8)
            drawing.signs("middles", picks.pixel_px[own], 1.6, middle, sign="cross")


def _outline(region: Region) -> float:
    """Return half the width of a mark."""
    return 15.0 if region.subject == "point" else 7.0


def _is_wrong(result: Result, pick: int) -> bool:
    return result.picks.status[pick] in ("suspect", "removed")


def _name_points(
    drawing: Drawing,
    result: Result,
    drawn: _SharedContent,
    region: Region,
    rows: Sequence[int],
) -> None:
    """Place the names of the points of the picture's subject, and of wrong picks.

    A point without a used pick in the photo is named at its adjusted place, where its lines end.
    """
    picks, own = result.picks, _subject_labels(result, region)
    half = HALF_MIDDLE * drawing.unit
    drawing.reserve([box(picks.pixel_px[i], half, half) for i in rows])
    # A point that was clicked again has one name, and a wrong click its own.
    first: dict[tuple[str, bool], int] = {}
    for i in rows:
        if picks.label[i] in own or _is_wrong(result, i):
            first.setdefault((picks.label[i], _is_wrong(result, i)), i)
    named = [
        TextRequest(picks.label[i], "name", picks.pixel_px[i : i + 1], gap=_outline(region))
        for i in first.values()
    ]
    used = {picks.label[i] for i in rows if picks.status[i] != "removed"}
    spots, labels = drawn.places[region.frame], result.points.label
    named += [
        TextRequest(labels[k], "name", spots[k : k + 1])
        for k in np.flatnonzero(_is_in_region(spots, region))
        if labels[k] in own - used
    ]
    drawing.place(named)


def _subject_labels(result: Result, region: Region) -> frozenset[str]:
    """Return the labels of a picture's subject; an overview has all that the result depends on."""
    if region.subject == "overview":
        return list_used_labels(result)
    if region.subject == "point":
        return frozenset((result.points.label[region.row],))
    return frozenset(result.measurements.points[region.row])


def _lines_in(result: Result, regions: Sequence[Region]) -> dict[Region, list[tuple[Floats, Look]]]:
    """Project measurements, and in the overview known lengths, at their adjusted positions."""
    measured = measured_strips(result)
    drawn: dict[Region, list[tuple[Floats, Look]]] = {region: [] for region in regions}
    for frame in sorted({region.frame for region in regions}):
        strips: list[tuple[Region, Floats, Look]] = []
        for region in (one for one in regions if one.frame == frame):
            strips += [(region, *one) for one in _strips(result, measured, region)]
        if not strips:
            continue
        lines = [sample_polyline(strip) for _, strip, _ in strips]
        pixels = project_polylines(result, frame, lines)
        for (region, _, look), line in zip(strips, pixels, strict=True):
            drawn[region] += [(run, look) for run in visible_runs(line)]
    return drawn


def _strips(
    result: Result, measured: dict[int, Floats], region: Region
) -> list[tuple[Floats, Look]]:
    """Return the (n, 3) lines of a region and their styles: known lengths as on the plan."""
    if region.subject == "point":
        return []
    if region.subject == "measurement":
        return [(measured[region.row], ON_MEASURED)] if region.row in measured else []
    status = result.lines.status
    known = []
    for i, strip in reference_strips(result).items():
        dashes = "" if status[i] == "used" else DASHES
        known.append((strip, Look(hex_colour(LINE_COLOURS[status[i]]), 1.6, dashes=dashes)))
    return known + [(strip, ON_MEASURED) for strip in measured.values()]


GROUND = "ground"


_MARK = re.compile(r"<!-- picture (\w+) -->")  # escaped text cannot contain this


def picture_mark(which: int | str) -> str:
    """Return the mark for the address of a picture: a photo by its row, or `GROUND`."""
    return f"<!-- picture {which} -->"


def embed_pictures(html: str, pictures: Pictures) -> Iterator[bytes]:
    """Yield the page as pieces of UTF-8, with each mark replaced by a data URL of its picture."""
    parts = _MARK.split(html)
    for text, which in zip_longest(parts[::2], parts[1::2]):
        yield text.encode()
        if which is not None:
            shown = pictures.ground if which == GROUND else pictures.shown[int(which)]
            yield b"data:image/jpeg;base64," + b64encode(b"" if shown is None else shown.jpeg)
