"""Ground as photos show it, below the plan of the report."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.pictures import GroundPicture, Pictures
from uavgram.model.result.result import Result
from uavgram.views.report.brief import Brief, brief
from uavgram.views.report.inline import GROUND, picture_mark
from uavgram.views.survey.top_view import TopView, lay_out, top_view, used_points


class Backdrop(NamedTuple):
    """Picture behind a drawing: its place there, and its address."""

    x: float
    y: float
    width: float
    height: float
    data: str


def shown_ground(result: Result) -> tuple[Floats, Floats] | None:
    """Return south-west and north-east corner (2,) of the report's plan; None without one."""
    plan = lay_out(result, brief(result).plan_height, used_points(result))
    return None if plan is None else plan.sheet.extent_m


def report_plan(result: Result, first: Brief) -> TopView | None:
    """Draw the plan of the first page; return None if there is no point to draw."""
    return top_view(result, first.plan_height, used_points(result))


def backdrop(view: TopView | None, pictures: Pictures) -> Backdrop | None:
    """Place the picture of the ground in a drawing."""
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
