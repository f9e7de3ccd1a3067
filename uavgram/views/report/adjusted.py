"""How the observations fit together, and what was found along with the measurements."""

from __future__ import annotations

import numpy as np

from uavgram.model.result.learnt_camera import learnt_camera
from uavgram.model.result.result import Result
from uavgram.model.result.shared import Estimate
from uavgram.views.report.rows import Row
from uavgram.views.survey.reliability import effect_words
from uavgram.views.wording import GROUP_WORDS, chance, number


def group_rows(result: Result) -> list[Row]:
    """Variance factors: of all observations, then of each group."""
    solution = result.solution
    whole = Row(
        name="all",
        observations="",
        redundancy=str(solution.degrees_of_freedom),
        factor=number(solution.variance_factor, 2),
        probability=chance(solution.chi2_probability),
    )
    return [whole] + [
        Row(
            name=GROUP_WORDS.get(group.name, group.name),
            observations=str(group.observations),
            redundancy=number(group.redundancy, 1),
            factor=number(group.variance_factor, 2),
            probability=chance(group.probability),
        )
        for group in solution.groups
    ]


def misfit_picks(result: Result) -> list[Row]:
    """Picks that are suspect or were removed, worst first."""
    picks, evidence = result.picks, result.evidence
    which = [i for i, status in enumerate(picks.status) if status in ("suspect", "removed")]
    which.sort(key=lambda i: -abs(float(np.nan_to_num(picks.w[i]))))
    return [
        Row(
            label=picks.label[i],
            image=picks.image[i],
            residual=", ".join(number(part, 1, signed=True) for part in picks.residual_px[i]),
            w=number(picks.w[i], 1, signed=True),
            redundancy=number(picks.redundancy[i], 2),
            effect="–" if evidence is None else effect_words(result, evidence.picks, i),
            status="SUSPECT" if picks.status[i] == "suspect" else picks.status[i],
        )
        for i in which
    ]


def shared_rows(result: Result) -> list[tuple[str, str]]:
    """What all frames have in common, in words; planes of several areas have their own table."""
    shared = result.shared
    entries = [
        ("camera clock minus UTC [s]", shared.clock_offset_s),
        ("drift of the camera clock [ppm]", shared.clock_drift_ppm),
        ("position of the log minus truth: east, north, up [m]", shared.position_bias_m),
        ("heading of the log minus truth [°]", shared.heading_bias_deg),
        ("camera against its mount: rotation vector [°]", shared.boresight_deg),
        ("autopilot to camera, in the vehicle's axes [m]", shared.lever_arm_m),
    ]
    if not area_rows(result):
        entries += [
            ("height of the ground plane [m]", result.plane.height_m),
            ("slope of the ground to the east, to the north [°]", result.plane.slope_deg),
        ]
    return [(name, _estimate(estimate)) for name, estimate in entries if estimate is not None]


def area_rows(result: Result) -> list[Row]:
    """The planes of several ground areas; none where there is only one."""
    if len(result.areas) < 2:
        return []
    return [
        Row(
            name=area.name,
            height=_estimate(area.height_m),
            slope=_estimate(area.slope_deg),
            pivot=", ".join(number(part, 2) for part in area.pivot_m),
        )
        for area in result.areas
    ]


def camera_rows(result: Result) -> list[Row]:
    """The camera before and with the survey, parameter by parameter."""
    camera = learnt_camera(result.camera, result.shared.intrinsics)
    return [
        Row(
            name=camera.names[i],
            before=_parameter(camera.prior_value[i], camera.prior_sigma[i]),
            after=_parameter(camera.value[i], camera.sigma[i]),
            ratio=number(camera.ratio[i], 2),
            shift=number(camera.shift[i], 1, signed=True),
            learnt="learnt" if camera.learnt[i] else "as calibrated",
        )
        for i in range(len(camera.names))
    ]


def _estimate(estimate: Estimate) -> str:
    return ", ".join(
        f"{number(value)} ± {number(sigma)}"
        for value, sigma in zip(estimate.value, estimate.sigma, strict=True)
    )


def _parameter(value: float, sigma: float) -> str:
    """Pixels and coefficients alike: two digits of the sigma, and the value to as many places."""
    if not sigma > 0:
        return f"{value:.6g}, held"
    places = max(0, 1 - int(np.floor(np.log10(sigma))))
    return f"{number(value, places)} ± {number(sigma, places)}"
