"""Which parts of which photos a report shows."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import synthetic_survey as survey

from uavgram.model.observations import Source
from uavgram.model.result.result import Region, Result
from uavgram.stages.products import picture_plan as module
from uavgram.stages.products.picture_plan import picture_plan


@cache
def result() -> Result:
    return survey.build()


def contains(region: Region, pixel: np.ndarray) -> bool:
    low = np.array([region.left_px, region.top_px]) - 0.5
    size = np.array([region.width_px, region.height_px])
    return bool((pixel >= low).all() and (pixel <= low + size).all())


def picked_at(made: Result, frame: int, label: str) -> np.ndarray:
    name = made.frames.frame_id[frame]
    (pixel,) = [
        made.picks.pixel_px[i]
        for i, pair in enumerate(zip(made.picks.image, made.picks.label, strict=True))
        if pair == (name, label)
    ]
    return np.asarray(pixel)


def test_every_part_lies_in_its_photo_and_few_photos_are_decoded() -> None:
    plan = picture_plan(result())
    for one in plan.regions:
        assert one.left_px >= 0 <= one.top_px
        assert one.left_px + one.width_px <= survey.WIDTH_PX
        assert one.top_px + one.height_px <= survey.HEIGHT_PX

    assert plan.regions[0].subject == "overview"
    assert len({one.frame for one in plan.regions}) <= module.MOST_PHOTOS


def test_a_point_is_shown_around_a_pick_and_a_measurement_with_all_its_ends() -> None:
    made = result()
    for one in picture_plan(made).regions[1:]:
        if one.subject == "point":
            labels = {made.points.label[one.row]}
        else:
            name = made.frames.frame_id[one.frame]
            here = {
                label
                for image, label, status in zip(
                    made.picks.image, made.picks.label, made.picks.status, strict=True
                )
                if image == name and status in ("used", "suspect")
            }
            labels = set(made.measurements.outlines[one.row]) & here
        for label in labels:
            assert contains(one, picked_at(made, one.frame, label))


def test_what_is_not_shown_is_named() -> None:
    made = result()
    plan = picture_plan(made)
    shown = {(one.subject, one.row) for one in plan.regions}
    points = [n for k, n in enumerate(made.points.label) if ("point", k) not in shown]
    rows = made.measurements
    lines = [
        name
        for k, (name, kind) in enumerate(zip(rows.name, rows.kind, strict=True))
        if np.isfinite(rows.value[k]) and kind != "coordinate" and ("measurement", k) not in shown
    ]

    assert set(plan.left_out) == {*points, *lines}


def test_where_a_person_picked_it_a_point_is_shown_there() -> None:
    made = result()
    plan = picture_plan(made)
    frames = sorted({one.frame for one in plan.regions})
    label = next(
        name
        for name in made.points.label
        if sum(
            made.frames.frame_id[f] in made.points.frames[made.points.label.index(name)]
            for f in frames
        )
        > 1
    )
    row = made.points.label.index(label)
    images = [
        made.frames.frame_id[f]
        for f in frames
        if made.frames.frame_id[f] in made.points.frames[row]
    ]
    for by_hand in images:
        source: tuple[Source, ...] = tuple(
            "match" if name == label and image != by_hand else "hand"
            for image, name in zip(made.picks.image, made.picks.label, strict=True)
        )
        changed = picture_plan(replace(made, picks=replace(made.picks, source=source)))
        (shown,) = [one for one in changed.regions if (one.subject, one.row) == ("point", row)]

        assert made.frames.frame_id[shown.frame] == by_hand


def test_without_picks_there_is_nothing_to_show() -> None:
    plan = picture_plan(survey.build(lines=(), measures=(), point_count=0))

    assert plan == ((), ())


def test_the_overview_has_most_of_the_measured_points() -> None:
    made = result()
    regions = picture_plan(made).regions
    rows = made.measurements
    wanted = {
        label
        for kind, labels, value in zip(rows.kind, rows.outlines, rows.value, strict=True)
        if kind != "coordinate" and np.isfinite(value)
        for label in labels
    }
    seen = module._group_pixels_by_frame(made)
    counts = {frame: len(wanted & one.lies.keys()) for frame, one in seen.items()}

    assert counts[regions[0].frame] == max(counts.values()) > 0
