"""Choose the parts of photos in a report: few photos, so that few have to be decoded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground.row_projection import project_rows, row_poses
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.result import Region, Result, Subject

MOST_PHOTOS = 8
MOST_POINTS, MOST_MEASUREMENTS = 120, 100
POINT_SHARE, LEAST_POINT_PX, MOST_POINT_PX = 0.1, 150, 360
"""Side of the part around a point: a share of the photo's width, within these bounds [px]."""
ROOM = 0.25
"""Margin around the points of a measurement, as a share of their extent."""
FLATTEST = 0.7
"""Least ratio of height to width of the part around a measurement; the largest is 1."""


class PicturePlan(NamedTuple):
    """Parts to be shown, and the names of points and measurements without one."""

    regions: tuple[Region, ...]
    left_out: tuple[str, ...]


class _Seen(NamedTuple):
    """Pixels in a photo by label: of picked points, and of these and measured ones."""

    picked: dict[str, Floats]
    lies: dict[str, Floats]


class _Group(NamedTuple):
    """Labels to be shown together, and whether they must have been picked in that photo."""

    labels: frozenset[str]
    picked: bool

    def is_in(self, seen: _Seen) -> bool:
        return self.labels <= (seen.picked if self.picked else seen.lies).keys()


def picture_plan(result: Result) -> PicturePlan:
    """Choose an overview, and a part for each point and each measurement that can be seen.

    A point is shown in a photo in which it was picked, by a person if possible; for a measurement,
    ends may also be at their adjusted places.
    """
    seen = _group_pixels_by_frame(result)
    points = [_Group(frozenset([label]), picked=True) for label in result.points.label]
    measured = [_Group(frozenset(labels), picked=False) for labels in _ends(result)]
    frames = _choose_frames(seen, [*points, *(group for group in measured if group.labels)])
    if not frames:
        return PicturePlan((), ())
    size = {"width_px": result.camera.width_px, "height_px": result.camera.height_px}
    overview = Region(subject="overview", row=0, frame=frames[0], left_px=0, top_px=0, **size)
    regions = (
        overview,
        *islice(_parts(result, "point", points, frames, seen), MOST_POINTS),
        *_first(result, list(_parts(result, "measurement", measured, frames, seen))),
    )
    return PicturePlan(regions, _left_out(result, regions))


def _first(result: Result, regions: list[Region]) -> list[Region]:
    """Return the parts to be shown: those with a problem, then the least certain ones."""
    rows = result.measurements
    with np.errstate(divide="ignore", invalid="ignore"):
        doubt = np.nan_to_num(rows.sigma / np.abs(rows.value))
    fine = np.array([status == "ok" for status in rows.status], dtype=np.bool_)
    regions = sorted(regions, key=lambda one: (bool(fine[one.row]), -float(doubt[one.row])))
    return regions[:MOST_MEASUREMENTS]


def _parts(
    result: Result,
    subject: Subject,
    groups: Sequence[_Group],
    frames: Sequence[int],
    seen: dict[int, _Seen],
) -> Iterator[Region]:
    """Yield the part for each group, in the photo in which most of it was picked."""
    by_hand = {
        (image, label)
        for image, label, hand in zip(
            result.picks.image, result.picks.label, result.picks.by_hand, strict=True
        )
        if hand
    }
    for row, group in enumerate(groups):
        showing = [frame for frame in frames if group.labels and group.is_in(seen[frame])]
        if showing:
            names = result.frames.frame_id
            best = max(
                showing,
                key=lambda f: (
                    len(group.labels & seen[f].picked.keys()),
                    sum((names[f], label) in by_hand for label in group.labels),
                    -frames.index(f),
                ),
            )
            at = np.stack([seen[best].lies[label] for label in sorted(group.labels)])
            yield _enclose_pixels(result, subject, row, best, at)


def _group_pixels_by_frame(result: Result) -> dict[int, _Seen]:
    """Return pixels of points by frame, for adjusted frames with picks."""
    frame_of = {name: k for k, name in enumerate(result.frames.frame_id)}
    seen: dict[int, _Seen] = {}
    picks = result.picks
    for i in np.argsort(picks.by_hand, kind="stable").tolist():  # picks by people replace others
        frame = frame_of[picks.image[i]]
        if picks.status[i] in ("used", "suspect") and result.has_refined[frame]:
            one = seen.setdefault(frame, _Seen({}, {}))
            one.picked[picks.label[i]] = picks.pixel_px[i]
    named = {label for labels in _ends(result) for label in labels}
    rows = np.array([k for k, label in enumerate(result.points.label) if label in named], np.int64)
    for frame, one in seen.items():
        one.lies.update(_project_adjusted_points(result, frame, rows) | one.picked)
    return seen


def _project_adjusted_points(result: Result, frame: int, rows: Ints) -> dict[str, Floats]:
    """Project adjusted points to a photo, and return those inside it."""
    pixel = project_rows(
        result.camera,
        result.shared.intrinsics.value,
        row_poses(result, frame),
        result.points.position_world_m[rows],
    )
    inside = result.camera.is_in_photo(pixel)
    return {result.points.label[rows[k]]: pixel[k] for k in np.flatnonzero(inside)}


def _ends(result: Result) -> tuple[tuple[str, ...], ...]:
    """Return labels (M,) of each computed measurement's points; none for one without a shape."""
    known, rows = set(result.points.label), result.measurements
    return tuple(
        labels if kind != "coordinate" and np.isfinite(value) and known.issuperset(labels) else ()
        for kind, labels, value in zip(rows.kind, rows.outlines, rows.value, strict=True)
    )


def _choose_frames(seen: dict[int, _Seen], wanted: Sequence[_Group]) -> list[int]:
    """Choose frames that add most to those before; the first shows most measured points."""
    showing = _showing(seen, wanted)
    gain = dict.fromkeys(sorted(seen), 0)
    shown: dict[int, set[int]] = {frame: set() for frame in seen}
    for number, frames in enumerate(showing):
        for frame in frames:
            gain[frame] += 1
            shown[frame].add(number)
    measured = frozenset[str]().union(*(one.labels for one in wanted if not one.picked))
    chosen: list[int] = []
    while len(chosen) < MOST_PHOTOS:
        sought = measured if not chosen else frozenset[str]()
        best = max(
            gain,
            key=lambda frame: (
                len(sought & seen[frame].lies.keys()),
                len(sought & seen[frame].picked.keys()),
                gain[frame],
            ),
            default=None,
        )
        if best is None or not gain[best]:
            break
        chosen.append(best)
        for number in list(shown[best]):
            for frame in showing[number]:
                gain[frame] -= 1
                shown[frame].discard(number)
    return chosen


def _showing(seen: dict[int, _Seen], wanted: Sequence[_Group]) -> list[set[int]]:
    """Return the frames that show each group."""
    picked: dict[str, set[int]] = {}
    lies: dict[str, set[int]] = {}
    for frame, one in seen.items():
        for where, labels in ((picked, one.picked), (lies, one.lies)):
            for label in labels:
                where.setdefault(label, set()).add(frame)
    nowhere: set[int] = set()
    return [
        set.intersection(
            *((picked if group.picked else lies).get(label, nowhere) for label in group.labels)
        )
        for group in wanted
    ]


def _enclose_pixels(
    result: Result, subject: Subject, row: int, frame: int, pixel_px: Floats
) -> Region:
    """Return the part around pixels (n, 2), inside the photo."""
    photo = np.array([result.camera.width_px, result.camera.height_px])
    least = np.clip(POINT_SHARE * photo[0], LEAST_POINT_PX, MOST_POINT_PX)
    low, high = pixel_px.min(axis=0), pixel_px.max(axis=0)
    extent = high - low
    room = ROOM * extent.max()
    size = np.maximum(extent + 2 * room, least)
    size = np.maximum(size, [size[1], FLATTEST * size[0]])
    # parts between even edges are reduced at a fraction of the cost
    even = 2.0 * np.ceil(size / 2.0)
    size = np.minimum(even, photo).astype(int)
    start = 2 * np.round((low + high - size) / 4).astype(int)
    left, top = np.clip(start, 0, photo - size).tolist()
    width, height = size.tolist()
    return Region(
        subject=subject,
        row=row,
        frame=frame,
        left_px=left,
        top_px=top,
        width_px=width,
        height_px=height,
    )


def _left_out(result: Result, regions: Sequence[Region]) -> tuple[str, ...]:
    shown = {(region.subject, region.row) for region in regions}
    points = [n for k, n in enumerate(result.points.label) if ("point", k) not in shown]
    measured = [
        name
        for k, (name, labels) in enumerate(
            zip(result.measurements.name, _ends(result), strict=True)
        )
        if labels and ("measurement", k) not in shown
    ]
    return (*points, *measured)
