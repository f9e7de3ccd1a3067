"""Hypotheses on the camera file: another zoom, or the file of another camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from uavgram.estimation.reliability.hypotheses import Explained, Moved
from uavgram.estimation.reliability.redundancy import redundancy_of
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import Calibration
from uavgram.model.message import Message
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing

ANY_ZOOM, ANY_CENTRE = 0.4, 0.1
"""Prior sigmas of the factor of both focal lengths, and of the principal point as a share of the
photo's width, for a useless camera file."""

SURE, LEAST = 5.0, 0.015
"""Least deviation of the factor from one for another zoom, in its own sigmas and as a share."""

ENOUGH = 30.0
"""Redundancy of the picks below which camera parameters could absorb a wrong pick or two."""


def other_camera_file(standing: Standing) -> Iterator[Hypothesis]:
    """Propose another focal length than in the camera file, or also another principal point."""
    adjustment = standing.adjustment
    if redundancy_of(adjustment, "pixels") < ENOUGH or not adjustment.problem.layout.intrinsics:
        return
    stated = adjustment.survey.calibration
    for unknowns, tell in ((by_zoom(stated)[:, None], other_zoom), (_by_frame(stated), _other)):
        yield Hypothesis(
            tell=partial(tell, adjustment.survey),
            moved=(calibration_moved(adjustment, unknowns),),
            settled=partial(_found, unknowns=unknowns),
            freed=partial(freed_camera, unknowns),
            price=unknowns.shape[1] * PRICE,
        )


def calibration_moved(adjustment: Adjustment, unknowns: Floats) -> Moved:
    """Return the derivative of the interior orientation's prior by unknowns (P, q)."""
    along: Floats = np.linalg.pinv(adjustment.problem.intrinsic_basis) @ unknowns
    return Moved("calibration", np.arange(len(along)), -along[:, None])


def _found(adjustment: Adjustment, *, unknowns: Floats) -> tuple[Floats, Floats]:
    """Compute a camera's deviation from its file in units of unknowns (P, q), and covariance."""
    problem, layout = adjustment.problem, adjustment.problem.layout
    to_unknowns = np.linalg.pinv(unknowns) @ problem.intrinsic_basis
    covariance = adjustment.shared(layout.first_intrinsic, layout.intrinsics)
    value = to_unknowns @ adjustment.state.intrinsic
    return value, to_unknowns @ covariance @ to_unknowns.T


def freed_camera(unknowns: Floats, survey: Survey) -> Survey:
    """Remove the prior of some combinations (P, q) of the interior orientation."""
    stated = survey.calibration
    covariance = stated.covariance + unknowns @ unknowns.T
    return replace(survey, calibration=replace(stated, covariance=covariance))


def by_zoom(camera: Calibration) -> Floats:
    """Return the change (P,) of the interior orientation by a prior sigma of the zoom."""
    change = np.zeros(len(camera.parameters))
    change[:2] = ANY_ZOOM * camera.parameters[:2]
    return change


def _by_frame(camera: Calibration) -> Floats:
    """Return the changes (P, 3) by a prior sigma of the zoom, and of the principal point."""
    change = np.zeros((len(camera.parameters), 3))
    change[:, 0] = by_zoom(camera)
    change[2, 1] = change[3, 2] = ANY_CENTRE * camera.width_px
    return change


def other_zoom(survey: Survey, found: Explained | None) -> Message:
    """Report photos of another zoom.

    Parameters
    ----------
    survey
        Survey with the camera as stated.
    found
        Difference of its focal length, in units of `ANY_ZOOM`.
    """
    assert found is not None  # noqa: S101  (it is judged by its linear test)
    stated = float(survey.calibration.parameters[0])
    factor = 1.0 + ANY_ZOOM * float(found.value[0])
    sigma = ANY_ZOOM * float(np.sqrt(found.covariance[0, 0]))
    return zoom_message(survey.calibration.name, stated, factor, sigma)


def zoom_message(name: str, stated_px: float, factor: float, sigma: float) -> Message:
    """Report photos of another zoom.

    Parameters
    ----------
    name, stated_px
        Name of the camera; its stated focal length.
    factor, sigma
        Estimated factor of the focal length, and its sigma.
    """
    text = (
        f"These photos were taken at another zoom than the camera file {name!r} describes: its "
        f"focal length would be {factor * stated_px:.0f} ± {sigma * stated_px:.0f} px, "
        f"{stated_px:.0f} px is stated. Look at zoom, focus and size of the "
        "photos, and calibrate the camera as it was used."
    )
    return Message("warning", "other-zoom", text)


def _other(survey: Survey, found: Explained | None) -> Message:
    assert found is not None  # noqa: S101
    camera = survey.calibration
    sigma = np.sqrt(found.covariance.diagonal())
    size = np.array([ANY_ZOOM * camera.parameters[0], *[ANY_CENTRE * camera.width_px] * 2])
    names = ("fx", "cx", "cy")
    said = ", ".join(
        f"{name} {stated + one * value:.0f} ± {one * s:.0f} px instead of {stated:.0f}"
        for name, stated, one, value, s in zip(
            names, camera.parameters[[0, 2, 3]], size, found.value, sigma, strict=True
        )
        if np.isfinite(s)
    )
    return Message(
        "warning",
        "camera-contradicted",
        f"The camera file {camera.name!r} does not belong to these photos: it would have to say "
        f"{said}. Look whether it is the file of this camera, and whether the "
        "photos were cut, stabilised or made smaller; calibrate the camera as it was used.",
    )
