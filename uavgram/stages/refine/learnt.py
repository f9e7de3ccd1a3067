"""Report significant properties of camera and ground that the survey found without a statement."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.estimation.reliability.redundancy import core_fit
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.ground_planes import PLANE_SIZE
from uavgram.model.message import Message
from uavgram.model.naming import figures

SURE = 3.0
"""Sigmas from zero beyond which a value is reported."""

LEVEL_DEG = 2.0
"""Slope [deg] up to which people call a ground level."""

BY_PHOTOS = (
    "The camera reads its rows one after the other (a rolling shutter): tie points fit much better "
    "so. Taken into account as far as they show it; what they cannot show, how long a photo takes "
    "to read and how far the drone flew meanwhile, is in the sigmas. Name the flight's log "
    "(`log:`), or state `readout_ms` in the camera file."
)


def learnt_remarks(adjustment: Adjustment) -> Iterator[Message]:
    """Report a rolling shutter, and ground that slopes."""
    if adjustment.minimum.converged:
        sure = SURE * _misfit(adjustment)
        yield from _shutter(adjustment, sure)
        yield from _slopes(adjustment, sure)


def _misfit(adjustment: Adjustment) -> float:
    """Return the ratio of actual to stated errors, at least 1: a wrong pick may tilt a plane."""
    fit = core_fit(adjustment)
    return float(np.sqrt(max(fit.squares / max(fit.degrees, 1.0), 1.0)))


def _shutter(adjustment: Adjustment, sure: float) -> Iterator[Message]:
    rolling, layout = adjustment.survey.rolling, adjustment.problem.layout
    if rolling is None or not layout.readout or rolling.readout.value_s:
        return
    if rolling.by_photos:
        yield Message("info", "shutter-found", BY_PHOTOS)
        return
    found_s = float(adjustment.state.readout[0])
    sigma_s = float(np.sqrt(adjustment.shared(layout.first_readout, 1)[0, 0]))
    if abs(found_s) > sure * sigma_s:
        text = (
            f"The camera reads its rows one after the other, in {1e3 * abs(found_s):.0f} ± "
            f"{1e3 * sigma_s:.0f} ms (a rolling shutter): taken into account. Where the camera's "
            "own time is known, state it in the camera file, as readout_ms."
        )
        yield Message("info", "shutter-found", text)


def _slopes(adjustment: Adjustment, sure: float) -> Iterator[Message]:
    layout, survey = adjustment.problem.layout, adjustment.survey
    if not layout.plane:
        return
    plane = adjustment.state.plane.reshape(-1, PLANE_SIZE)
    fixed = len(plane) - layout.plane // PLANE_SIZE
    for area in range(fixed, len(plane)):
        # Sigma of the slope in its own direction; angle = atan(slope).
        slope = plane[area, 1:]
        first = layout.first_plane + PLANE_SIZE * (area - fixed) + 1
        size = float(np.linalg.norm(slope))
        toward = slope / size if size else slope
        sigma = float(np.sqrt(toward @ adjustment.shared(first, 2) @ toward))
        angle, error = np.degrees([np.arctan(size), sigma / (1.0 + size**2)])
        usual = np.degrees(SURE * survey.grounds[area].slope_sigma_rad)
        if angle > min(LEVEL_DEG, usual) and angle > sure * error:
            name = survey.grounds[area].name
            where = f"The ground of area {name!r}" if len(plane) > 1 else "The ground"
            text = (
                f"{where} slopes by {angle:.1f} ± {figures(error, 1)} degrees: taken into account."
            )
            yield Message("info", "ground-slopes", text)
