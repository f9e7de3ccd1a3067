"""How far to trust it: withheld numbers, the fit, priors, what was taken out, the camera."""

from __future__ import annotations

import numpy as np

from uavgram.model.result.learnt_camera import learnt_camera
from uavgram.model.result.result import Result
from uavgram.views.markdown import plain, table
from uavgram.views.survey.reliability import overall_words, prior_rows, removal_rows
from uavgram.views.wording import chance, number

# Beyond three sigma a check has failed, as everywhere in the trade.
THREE_SIGMA = 3
MOST_PRIORS = 10


def checks_page(result: Result) -> str:
    """Everything that speaks for the result, or against it."""
    sections = (
        ("Withheld lengths and points", _withheld(result)),
        ("How it fits", _fit(result)),
        ("Taken out", "\n".join(f"- {plain(one)}" for one in removal_rows(result))),
        ("Known beforehand, the worst fit first", _priors(result)),
        ("Ground", _ground(result)),
        ("Camera, as the survey's own picks see it", _camera(result)),
    )
    parts = [part for title, text in sections if text for part in (f"## {title}", text)]
    return "\n\n".join(["# Checks", *parts])


def _withheld(result: Result) -> str:
    """Error and sigma of what was known and not used."""
    lines, points = result.line_checks, result.point_checks
    if not (lines.name or points.label):
        return "None: nothing outside of the adjustment speaks for it."
    rows = [
        (
            plain(name),
            f"{number(error, signed=True)} ± {number(sigma)}",
            number(z, 1, signed=True),
            "inside" if abs(z) <= THREE_SIGMA else "**OUTSIDE**",
        )
        for name, error, sigma, z in zip(
            lines.name, lines.error_m, lines.sigma_m, lines.z, strict=True
        )
    ]
    for label, error, sigma in zip(points.label, points.error_m, points.sigma_m, strict=True):
        z = float(np.abs(error / sigma).max())
        words = ", ".join(
            f"{number(e, signed=True)} ± {number(s)}" for e, s in zip(error, sigma, strict=True)
        )
        rows.append(
            (plain(label), words, number(z, 1), "inside" if z <= THREE_SIGMA else "**OUTSIDE**")
        )
    shown = table(("withheld", "found minus known [m]", "largest z", "three sigma"), rows)
    return f"{shown}\n\n{plain(overall_words(result))}"


def _fit(result: Result) -> str:
    solution = result.solution
    all_of_it = (
        "all",
        "",
        str(solution.degrees_of_freedom),
        number(solution.variance_factor, 2),
        chance(solution.chi2_probability),
    )
    groups = [
        (
            plain(group.name),
            str(group.observations),
            number(group.redundancy, 1),
            number(group.variance_factor, 2),
            chance(group.probability),
        )
        for group in solution.groups
    ]
    header = ("group", "observations", "redundancy", "variance factor", "chance")
    how = (
        f"{'Converged' if solution.converged else 'NOT converged'} in {solution.iterations} steps."
    )
    return table(header, [all_of_it, *groups]) + "\n\n" + how


def _priors(result: Result) -> str:
    rows = [
        (
            " ".join(filter(None, (plain(str(one["name"])), plain(str(one["frame"]))))),
            f"**{one['w']}**" if one["bad"] else str(one["w"]),
            str(one["residual"]),
            plain(str(one["bias"])),
            plain(str(one["effect"])),
        )
        for one in prior_rows(result)[:MOST_PRIORS]
    ]
    header = ("what", "w", "moved [σ]", "smallest error that would show", "it would move")
    return table(header, rows) if rows else ""


def _ground(result: Result) -> str:
    rows = [
        (
            plain(area.name),
            f"{number(area.height_m.value[0])} ± {number(area.height_m.sigma[0])}",
            " and ".join(
                f"{number(value, 2, signed=True)} ± {number(sigma, 2)}"
                for value, sigma in zip(area.slope_deg.value, area.slope_deg.sigma, strict=True)
            ),
        )
        for area in result.areas
    ]
    header = ("area", "height above the origin [m]", "slope to the east and north [°]")
    return table(header, rows) if rows else ""


def _camera(result: Result) -> str:
    learnt = learnt_camera(result.camera, result.shared.intrinsics)
    rows = [
        (
            name,
            f"{learnt.prior_value[i]:.6g} ± {learnt.prior_sigma[i]:.2g}",
            f"{learnt.value[i]:.6g} ± {learnt.sigma[i]:.2g}",
            "learnt" if learnt.learnt[i] else "",
        )
        for i, name in enumerate(learnt.names)
    ]
    return table(("parameter", "calibration", "refined", ""), rows)
