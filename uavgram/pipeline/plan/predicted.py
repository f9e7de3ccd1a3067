"""What a flight with its reference lines will reach, by the real likelihood at the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.measuring.propagation import propagate
from uavgram.estimation.reliability.redundancy import minimal_detectable_bias, reliability
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.pipeline.plan.survey import Lines, Marks, PlannedSurvey, planned_survey
from uavgram.stages.plan.cameras import Cameras, seen
from uavgram.stages.plan.scene import PlanScene
from uavgram.stages.plan.wanted import Wanted


@dataclass(frozen=True, eq=False)
class Predicted:
    """M values as they will be known.

    Attributes
    ----------
    name, kind, unit, value, sigma
        (M,) of each.
    request
        (M,) which of the requests each is of.
    redundancy, mdb_m
        (L,) of the lines: see `PlannedLines`.
    """

    name: tuple[str, ...]
    kind: tuple[str, ...]
    unit: tuple[str, ...]
    value: Floats
    sigma: Floats
    request: tuple[int, ...]
    redundancy: Floats
    mdb_m: Floats


def survey_with(
    scene: PlanScene, cameras: Cameras, wanted: Wanted, ends_m: Floats
) -> PlannedSurvey:
    """The survey of wanted points and lines (L, 2, 2) on the ground.

    Parameters
    ----------
    scene, cameras, wanted
        Ground, photos, and what is measured.
    ends_m
        (L, 2, 2) ends of the lines.
    """
    count, lines = len(wanted.label), len(ends_m)
    world = scene.on_ground(np.concatenate([wanted.point_m, ends_m.reshape(-1, 2)]))
    label = (*wanted.label, *(f"L{i + 1}{end}" for i in range(lines) for end in "ab"))
    marks = Marks(label, world, seen(scene.calibration, cameras, world, scene.deviation))
    pairs = count + np.arange(2 * lines).reshape(-1, 2)
    return planned_survey(
        scene, cameras, marks, Lines(tuple(f"L{i + 1}" for i in range(lines)), pairs)
    )


def predicted(scene: PlanScene, cameras: Cameras, wanted: Wanted, ends_m: Floats) -> Predicted:
    """What will be known of what is wanted, and how well the lines are checked.

    Parameters
    ----------
    scene, cameras
        Ground and photos.
    wanted
        What is measured.
    ends_m
        (L, 2, 2) ends of the reference lines.

    Raises
    ------
    SingularError
        The lines do not hold the photos.
    """
    planned = survey_with(scene, cameras, wanted, ends_m)
    blocks = planned.blocks()
    adjustment = planned.adjusted(blocks)
    values = propagate(adjustment, wanted.requests, planned.frames)
    redundancy = np.zeros(0)
    if len(ends_m):
        redundancy = reliability(blocks["lengths"], adjustment.covariance).redundancy[:, 0]
    sigma = np.full(len(redundancy), scene.tape_sigma_m)
    place = {request.name: k for k, request in enumerate(wanted.requests)}
    return Predicted(
        name=values.name,
        kind=tuple(row.request.kind for row in values.rows),
        unit=values.unit,
        value=values.value,
        sigma=values.sigma,
        request=tuple(place[row.request.name] for row in values.rows),
        redundancy=redundancy,
        mdb_m=minimal_detectable_bias(redundancy, sigma, SolveOptions().significance),
    )
