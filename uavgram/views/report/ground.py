"""The ground as photos show it, below the plans of the report."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.pictures import GroundPicture, Pictures
from uavgram.model.result.result import Result
from uavgram.views.report.brief import brief
from uavgram.views.report.inline import GROUND, picture_mark
from uavgram.views.survey.top_view import TopView, lay_out

PLAN_HEIGHT = 500.0
"""Of the large plan: on a printed page there is room for a photo below it."""


class Backdrop(NamedTuple):
    """A picture behind a drawing: its place there, and itself."""

    x: float
    y: float
    width: float
    height: float
    data: str


def shown_ground(result: Result) -> tuple[Floats, Floats] | None:
    """South-west and north-east corner (2,) of what the report's plans cover; None without one."""
    plans = [lay_out(result, high) for high in (PLAN_HEIGHT, brief(result).plan_height)]
    corners = [plan.sheet.extent_m for plan in plans if plan is not None]
    if not corners:
        return None
    low, high = np.stack(corners, axis=1)
    return low.min(axis=0), high.max(axis=0)


def backdrop(view: TopView | None, pictures: Pictures) -> Backdrop | None:
    """Where the picture of the ground lies in a drawing."""
    ground = pictures.ground
    if view is None or ground is None:
        return None
    return _placed(view, ground)


def _placed(view: TopView, ground: GroundPicture) -> Backdrop:
    x, y = view.sheet(np.array([ground.west_m, ground.north_m]))
    scale = view.sheet.scale
    return Backdrop(
        x=round(float(x), 2),
        y=round(float(y), 2),
        width=round(ground.width_m * scale, 2),
        height=round(ground.height_m * scale, 2),
        data=picture_mark(GROUND),
    )
