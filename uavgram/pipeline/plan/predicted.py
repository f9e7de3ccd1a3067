"""What a flight with its reference lines will reach, by the real likelihood at the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.measuring.propagation import propagate
from uavgram.estimation.reliability.redundancy import minimal_detectable_bias, reliability
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.target_families import CORNERS, corner_label
from uavgram.pipeline.plan.survey import Lines, Marks, PlannedSurvey, planned_survey
from uavgram.stages.plan.cameras import Cameras, large_enough, seen
from uavgram.stages.plan.scene import PlanScene
from uavgram.stages.plan.wanted import Wanted
from uavgram.stages.plate_sides import SIDES


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
        (L,) of the lines, of plates of each of their lengths: see `PlannedLines`.
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
    """The survey of wanted points, and of lines or plates on the ground.

    Parameters
    ----------
    scene, cameras, wanted
        Ground, photos, and what is measured.
    ends_m
        (L, 2, 2) ends of the lines, or (L, 4, 2) corners of the plates.
    """
    count, (laid, marks_each) = len(wanted.label), ends_m.shape[:2]
    of_plates = marks_each == CORNERS
    world = scene.on_ground(np.concatenate([wanted.point_m, ends_m.reshape(-1, 2)]))
    own = [
        corner_label(i, c) if of_plates else f"L{i + 1}{'ab'[c]}"
        for i, c in np.ndindex(laid, marks_each)
    ]
    found = seen(scene.calibration, cameras, world, scene.deviation)
    found = large_enough(found, count) if of_plates else found
    marks = Marks((*wanted.label, *own), world, found, len(own) if of_plates else 0)
    groups = count + np.arange(len(own)).reshape(laid, marks_each)
    pairs = groups[:, np.array(SIDES if of_plates else ((0, 1),))].reshape(-1, 2)
    names = tuple(f"L{i + 1}" for i in range(len(pairs)))
    return planned_survey(scene, cameras, marks, Lines(names, pairs, of_plates))


def predicted(scene: PlanScene, cameras: Cameras, wanted: Wanted, ends_m: Floats) -> Predicted:
    """What will be known of what is wanted, and how well the lines are checked.

    Parameters
    ----------
    scene, cameras
        Ground and photos.
    wanted
        What is measured.
    ends_m
        (L, 2, 2) ends of the reference lines, or (L, 4, 2) corners of the plates.

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
    sigma = planned.problem.survey.length_sigma_m
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
