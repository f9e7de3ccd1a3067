"""Tables of how the result fits: checks, known things, groups, noise, ground and camera."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np

from uavgram.model.result.result import Result, compare_cameras
from uavgram.views.formatting import (
    GROUP_WORDS,
    KNOWN_STATUS_WORDS,
    KNOWN_WORDS,
    chance,
    each_plus_minus,
    format_with_sigma,
    number,
    order_worst_fit_first,
    parameter_text,
    plus_minus,
)
from uavgram.views.result_tables import BAD_LINES, Source
from uavgram.views.survey.key_facts import SOURCE_WORDS
from uavgram.views.survey.reliability import effect_words, overall_words
from uavgram.views.survey.verdict import THREE_SIGMA
from uavgram.views.tables import Cell, Row, Table, draw_gauge, make_table
from uavgram.views.units import format_sigma, format_value, table_unit, units_of


def known_table(result: Result) -> Table:
    """Return the table of all known observations, the worst fit first."""
    return make_table(
        "name and points | what | >known | >found | >difference | >w | >redun\u00addancy | "
        ">smallest error that shows | status",
        (_known_row(result, int(i)) for i in order_worst_fit_first(result.known.w)),
    )


def _known_row(result: Result, i: int) -> Row:
    known, units = result.known, units_of(result)
    unit, sigma, own = known.unit[i], float(known.sigma[i]), float(known.adjusted_sigma[i])
    is_condition = bool(np.isnan(known.value[i]))
    given = format_with_sigma(float(known.value[i]), sigma, unit, units)
    found = format_value(float(known.adjusted[i]), sigma, unit, units)
    if own > 0:
        found = format_with_sigma(float(known.adjusted[i]), own, unit, units)
    cells = (
        Cell(known.name[i], below=" – ".join(known.points[i])),
        KNOWN_WORDS.get(known.kind[i], known.kind[i]),
        f"± {format_sigma(sigma, unit, units)}" if is_condition else given,
        "–" if is_condition else found,
        "+" * bool(known.residual[i] > 0)
        + format_value(float(known.residual[i]), sigma, unit, units),
        number(float(known.w[i]), 1, signed=True),
        number(float(known.redundancy[i]), 2),
        format_value(float(known.mdb[i]), sigma, unit, units),
        KNOWN_STATUS_WORDS[known.status[i]],
    )
    return Row(cells, known.status[i] in BAD_LINES)


def withheld_lengths(result: Result) -> Table:
    """Return the table of the lengths that were withheld as checks."""
    lines, checks, source = result.lines, result.line_checks, Source(result)
    row_of = {lines.name[i]: i for i, s in enumerate(lines.status) if s == "checked"}
    rows = []
    for k, name in enumerate(checks.name):
        i, z = row_of[name], float(checks.z[k])
        cells = (
            Cell(name, below=f"{lines.start[i]} – {lines.end[i]}"),
            source.like_tape(lines.length_m[i], lines.sigma_m[i]),
            source.found_length(i),
            source.like_tape(checks.error_m[k], checks.sigma_m[k], signed=True),
            Cell(number(z, 1, signed=True), gauge=draw_gauge(z, THREE_SIGMA)),
            _within(abs(z)),
        )
        rows.append(Row(cells, abs(z) > THREE_SIGMA))
    return make_table(
        "withheld length | >taped [tape] | >found [tape] | *error and its uncertainty [tape] | "
        ">error over its uncertainty | within three times",
        rows,
        source.units,
    )


def check_points(result: Result) -> Table:
    """Return the table of the check points."""
    points, source, rows = result.point_checks, Source(result), []
    for k, label in enumerate(points.label):
        z = points.error_m[k] / points.sigma_m[k]
        errors = (
            Cell(
                source.length_with_sigma(error, sigma, signed=True),
                gauge=draw_gauge(float(own), THREE_SIGMA),
            )
            for error, sigma, own in zip(points.error_m[k], points.sigma_m[k], z, strict=True)
        )
        largest = float(np.abs(z).max())
        distance = number(float(points.mahalanobis[k]), 1)
        rows.append(Row((label, *errors, distance, _within(largest)), largest > THREE_SIGMA))
    axes = " | ".join(f">error {axis} and its uncertainty [m]" for axis in ("east", "north", "up"))
    return make_table(
        f"check point | {axes} | >joint distance over its uncertainty | "
        "within three times, each axis",
        rows,
        source.units,
    )


def _within(sigmas: float) -> Cell:
    return Cell("OUTSIDE", look="bad") if sigmas > THREE_SIGMA else Cell("inside", look="good")


def group_table(result: Result) -> Table:
    """Return the fit of each group of observations, and of all."""
    solution = result.solution
    rows = [
        ("all", "", str(solution.degrees_of_freedom), number(solution.variance_factor, 2),
         chance(solution.chi2_probability))
    ]  # fmt: skip
    rows += [
        (GROUP_WORDS.get(one.name, one.name), str(one.observations), number(one.redundancy, 1),
         number(one.variance_factor, 2), chance(one.probability))
        for one in solution.groups
    ]  # fmt: skip
    return make_table(
        "observations | >how many | >redundancy | >variance factor | >chance of one as large", rows
    )


def wrong_picks(result: Result) -> Table:
    """Return the picks that do not fit, the worst first."""
    picks = result.picks
    rows = [
        Row(
            (
                picks.label[i],
                picks.image[i],
                ", ".join(number(float(part), 1, signed=True) for part in picks.residual_px[i]),
                number(float(picks.w[i]), 1, signed=True),
                number(float(picks.redundancy[i]), 2),
                "–" if result.evidence is None else effect_words(result, result.evidence.picks, i),
                "SUSPECT" if picks.status[i] == "suspect" else "removed",
                SOURCE_WORDS[picks.source[i]],
            ),
            is_bad=True,
        )
        for i in order_worst_fit_first(picks.w).tolist()
        if picks.status[i] in BAD_LINES
    ]
    return make_table(
        "point | photo | >residual right, down [px] | >w | >redun\u00addancy | "
        "an unseen error would move | status | picked",
        rows,
    )


def noise_table(result: Result) -> Table:
    """Return the sizes of errors as stated and as found in this survey; empty if none was found."""
    noise, rows = result.noise, list[tuple[str, ...]]()
    if noise is None:
        return make_table("", rows)
    for picks in noise.picks:
        places = 2 if picks.stated_px >= 0.3 else 3
        found = plus_minus(picks.stated_px * picks.factor, picks.stated_px * picks.sigma, places)
        stated = number(picks.stated_px, places)
        what = f"{noise.describe_picks(picks)}, one coordinate"
        rows.append((what, f"{stated} px", f"{found} px", ""))
    alike = "distance of picked from intended points, the same in all photos"
    for one, what in ((noise.lengths, "taped lengths"), (noise.identification, alike)):
        if one is not None:
            found = plus_minus(one.stated_m * one.factor, one.stated_m * one.sigma)
            rows.append((what, f"{number(one.stated_m)} m", f"{found} m", ""))
    shapes = {"quadratic": "and a crown or a hollow of", "correlated": "and smooth relief of"}
    for area in noise.roughness:
        what = "each point of the ground off its plane"
        what += f", area {area.area}" if len(result.areas) > 1 else ""
        found = plus_minus(area.estimated_m, area.sigma_m)
        shape = shapes.get(area.shape, "")
        relief = f"{shape} {number(area.relief_m)} m" if shape else ""
        rows.append((what, f"{number(area.stated_m)} m", f"{found} m", relief))
    return make_table("error | >stated | >found | ", rows)


def area_table(result: Result) -> Table:
    """Return the plane of each area of the ground."""
    source = Source(result)
    rows = [
        (
            area.name,
            source.length_with_sigma(area.height_m.value[0], area.height_m.sigma[0]),
            each_plus_minus(area.slope_deg.value, area.slope_deg.sigma),
            ", ".join(source.length(one, 2) for one in area.pivot_m),
        )
        for area in result.areas
    ]
    return make_table(
        "area | >height [m] | >slope to the east, to the north [°] | >about east, north [m]",
        rows,
        source.units,
    )


def shared_facts(result: Result) -> list[tuple[str, str]]:
    """Return what was found along with the measurements: names, and values with their sigmas."""
    shared, source, several = result.shared, Source(result), len(result.areas) > 1
    factor, unit = table_unit(source.units).factor, table_unit(source.units).symbol
    found = (
        ("camera clock minus UTC [s]", shared.clock_offset_s, 1.0),
        ("drift of the camera clock [ppm]", shared.clock_drift_ppm, 1.0),
        ("time in which a photo is read, first row to last [s]", shared.readout_s, 1.0),
        (f"position of the log minus truth: east, north, up [{unit}]", shared.position_bias_m,
         factor),
        ("heading of the log minus truth [°]", shared.heading_bias_deg, 1.0),
        ("camera against its mount: rotation vector [°]", shared.boresight_deg, 1.0),
        (f"autopilot to camera, in the vehicle's axes [{unit}]", shared.lever_arm_m, factor),
        (f"height of the ground plane [{unit}]", None if several else result.plane.height_m,
         factor),
        ("slope of the ground to the east, to the north [°]",
         None if several else result.plane.slope_deg, 1.0),
        *((f"scale of the tape{f' {tape}' if tape else ''}, + where it is too long [%]", one, 100.0)
          for tape, one in shared.tape_scale.items()),
    )  # fmt: skip
    return [
        (name, each_plus_minus(size * one.value, size * one.sigma))
        for name, one, size in found
        if one is not None
    ]


def camera_table(result: Result) -> Table:
    """Return the parameters of the camera, as calibrated and with the survey."""
    one = compare_cameras(result.camera, result.shared.intrinsics)
    rows = [
        (
            name,
            parameter_text(one.prior_value[i], one.prior_sigma[i]),
            parameter_text(one.value[i], one.sigma[i]),
            number(one.ratio[i], 2),
            number(one.shift[i], 1, signed=True),
            "learnt" if one.learnt[i] else "as calibrated",
        )
        for i, name in enumerate(one.names)
    ]
    return make_table(
        "parameter | >as calibrated | >with the survey | >ratio of sigmas | "
        ">moved by [its sigmas] | ",
        rows,
    )


def fit_tables(result: Result) -> dict[str, Any]:
    """Return all tables of this module by their names in templates."""
    return {
        "withheld_lengths": withheld_lengths(result),
        "check_points": check_points(result),
        "known": known_table(result),
        "groups": group_table(result),
        "wrong_picks": wrong_picks(result),
        "noise": noise_table(result),
        "areas": area_table(result),
        "shared": shared_facts(result),
        "camera": camera_table(result),
    }


class ChecksSummary(NamedTuple):
    """Number of checks within three times their uncertainty, and the joint test of all.

    Attributes
    ----------
    inside, overall
        The two sentences.
    look
        "good" if all are inside and agree together too, "bad" if not; "none" if they agree but the
        verdict is red.
    """

    inside: str
    look: Literal["good", "bad", "none"]
    overall: str


def checks_summary(result: Result) -> ChecksSummary | None:
    """Describe all checks in two sentences; return None if nothing was withheld."""
    points = result.point_checks
    z = points.error_m / points.sigma_m
    outside = [
        *(np.abs(result.line_checks.z) > THREE_SIGMA),
        *np.asarray((np.abs(z) > THREE_SIGMA).any(axis=1)),
    ]
    if not outside:
        return None
    bad = int(np.sum(outside))
    inside = f"{len(outside) - bad} of {len(outside)} are within three times their uncertainty"
    # each alone may be inside if all share a large sigma
    off = any(message.code == "checks-misfit" for message in result.messages)
    if bad:
        inside += f", {bad} OUTSIDE"
    elif off:
        inside += ", but TOGETHER they are further off than their uncertainties allow"
    overall, look = (
        overall_words(result, in_statistics=False),
        _colour_class(result, fits=not (bad or off)),
    )
    if look == "none":
        overall = f"{overall} But the verdict on the whole is red: see the first page.".lstrip()
    return ChecksSummary(inside=f"{inside}.", look=look, overall=overall)


def _colour_class(result: Result, *, fits: bool) -> Literal["good", "bad", "none"]:
    if not fits:
        return "bad"
    return "none" if result.verdict.level == "red" else "good"
