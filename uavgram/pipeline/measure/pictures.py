"""The pictures of a report: parts of the photos, within what a file may weigh."""

from __future__ import annotations

from itertools import groupby

from uavgram.imaging.photos.cutouts import cut_out
from uavgram.imaging.top_view.ground_cut import cut_ground
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.result.pictures import GroundPicture, Picture, Pictures, Region
from uavgram.model.result.result import Result
from uavgram.stages.products.picture_plan import picture_plan
from uavgram.views.report import shown_ground

MOST_BYTES = 9_000_000
"""Of all pictures together. As text in report.html they are a third more: it stays below 15 MB."""

_ORDER = {"overview": 0, "measurement": 1, "point": 2}


def report_pictures(result: Result) -> Pictures:
    """Cut out what a report shows of the photos, one photo in memory at a time.

    Raises
    ------
    InputError
        A photo cannot be read.
    """
    plan = picture_plan(result)
    made: list[Picture] = []
    for frame, regions in groupby(sorted(plan.regions, key=_frame), _frame):
        made += cut_out(result.frames.path[frame], tuple(regions))
    made.sort(key=lambda one: (_ORDER[one.region.subject], one.region.row))
    shown: list[Picture] = []
    left_out = list(plan.left_out)
    weight = 0
    for picture in made:
        weight += len(picture.jpeg)
        if weight <= MOST_BYTES:
            shown.append(picture)
        else:
            left_out.append(_name(result, picture.region))
    return Pictures(shown=tuple(shown), left_out=tuple(left_out))


def ground_picture(result: Result, texture: GroundTexture | None) -> GroundPicture | None:
    """Cut out what lies below the report's plans; None where photos show none of it."""
    corners = shown_ground(result)
    return None if texture is None or corners is None else cut_ground(texture, *corners)


def _frame(region: Region) -> int:
    return region.frame


def _name(result: Result, region: Region) -> str:
    rows = result.points.label if region.subject == "point" else result.measurements.name
    return rows[region.row]
