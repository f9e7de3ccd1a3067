"""report.html: one self-contained page, for people who have no viewer and for paper."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from uavgram.errors import OutputError
from uavgram.model.learnt_camera import LearntCamera, learnt_camera
from uavgram.model.result import Result
from uavgram.views.evidence import (
    effect_words,
    overall_words,
    prior_rows,
    removal_rows,
    second_order_rows,
    weakest_links,
)
from uavgram.views.facts import key_facts
from uavgram.views.pages import page_environment
from uavgram.views.top_view import INK, top_view
from uavgram.views.verdict import THREE_SIGMA, judge
from uavgram.views.wording import (
    FRAME_STATUS_WORDS,
    KIND_WORDS,
    LINE_STATUS_WORDS,
    WHY_TWO_ELLIPSES,
    axes_text,
    chance,
    computed_first,
    interval,
    number,
    place,
    relative,
    utc,
    with_sigma,
)

Row = dict[str, str | bool]


def write_report(result: Result, path: str | os.PathLike[str]) -> None:
    """Write the report; the file is replaced only once the new one is complete.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    target = Path(path)
    unfinished = target.with_name(f".{target.name}.unfinished")
    page = render_report(result)
    try:
        unfinished.write_text(page, encoding="utf-8")
        unfinished.replace(target)
    except OSError as error:
        raise OutputError(f"{target}: the report cannot be written: {error}") from error
    finally:
        unfinished.unlink(missing_ok=True)


def render_report(result: Result) -> str:
    """The page as text. Names that people wrote are escaped; nothing is loaded from elsewhere."""
    environment = page_environment()
    environment.filters.update(number=number, chance=chance)
    return environment.get_template("report.html").render(
        result=result,
        verdict=judge(result),
        place=place(result),
        facts=key_facts(result),
        why_two_ellipses=WHY_TWO_ELLIPSES,
        measurements=_measurements(result),
        lines=_lines(result),
        weakest=weakest_links(result),
        priors=prior_rows(result),
        removals=removal_rows(result),
        second_order=second_order_rows(result),
        overall=overall_words(result),
        line_checks=_line_checks(result),
        point_checks=_point_checks(result),
        frames=_frames(result),
        points=_points(result),
        shared=_shared(result),
        view=top_view(result),
        ink=INK,
    )


def _measurements(result: Result) -> list[Row]:
    rows, table = result.measurements, []
    for i in computed_first(rows):
        value, sigma, unit = float(rows.value[i]), float(rows.sigma[i]), rows.unit[i]
        low, high = map(float, rows.interval_95[i])
        no_share = rows.kind[i] == "coordinate"
        table.append(
            Row(
                name=rows.name[i],
                kind=KIND_WORDS.get(rows.kind[i], rows.kind[i]),
                points=" – ".join(rows.points[i]),
                value=with_sigma(value, sigma, unit),
                interval=interval(low, high, sigma, unit),
                relative="–" if no_share else relative(value, sigma, unit),
                bad=not np.isfinite(value),
            )
        )
    return table


def _lines(result: Result) -> list[Row]:
    lines = result.lines
    order = np.argsort(-np.nan_to_num(np.abs(lines.w), nan=-1.0), kind="stable")
    return [
        Row(
            name=lines.name[i],
            ends=f"{lines.start[i]} – {lines.end[i]}",
            taped=f"{number(lines.length_m[i])} ± {number(lines.sigma_m[i])}",
            found=f"{number(lines.adjusted_m[i])} ± {number(lines.adjusted_sigma_m[i])}"
            if np.isfinite(lines.adjusted_m[i])
            else "–",
            difference=number(lines.residual_m[i], signed=True),
            w=number(lines.w[i], 1, signed=True),
            redundancy=number(lines.redundancy[i], 2),
            mdb=number(lines.mdb_m[i]),
            effect="–"
            if result.evidence is None
            else effect_words(result, result.evidence.lines, int(i)),
            status=LINE_STATUS_WORDS.get(lines.status[i], lines.status[i]),
            bad=lines.status[i] in ("suspect", "removed"),
        )
        for i in order
    ]


def _line_checks(result: Result) -> list[Row]:
    checks = result.line_checks
    return [
        Row(
            name=name,
            error=number(error, signed=True),
            sigma=number(sigma),
            z=number(z, 1, signed=True),
            bad=bool(abs(z) > THREE_SIGMA),
        )
        for name, error, sigma, z in zip(
            checks.name, checks.error_m, checks.sigma_m, checks.z, strict=True
        )
    ]


def _point_checks(result: Result) -> list[Row]:
    checks, table = result.point_checks, []
    for label, error, sigma, distance in zip(
        checks.label, checks.error_m, checks.sigma_m, checks.mahalanobis, strict=True
    ):
        table.append(
            Row(
                label=label,
                error=", ".join(number(e, signed=True) for e in error),
                sigma=", ".join(number(s) for s in sigma),
                distance=number(distance, 1),
                bad=bool((np.abs(error / sigma) > THREE_SIGMA).any()),
            )
        )
    return table


def _frames(result: Result) -> list[Row]:
    frames, image = result.frames, np.array(result.picks.image, dtype=str)
    names, counts = np.unique(image, return_counts=True)
    picks = dict(zip(names.tolist(), counts.tolist(), strict=True))
    table = []
    for i, name in enumerate(frames.frame_id):
        sigma = np.sqrt(np.diagonal(frames.refined.covariance[i]))
        height = frames.refined.center_world_m[i, 2]
        table.append(
            Row(
                name=name,
                time=utc(float(frames.time_utc_s[i])),
                status=FRAME_STATUS_WORDS[frames.status[i]],
                reason=frames.reason[i],
                picks=str(picks.get(name, 0)),
                height=number(height, 2),
                position=number(float(sigma[:3].max()), 2),
                attitude=number(float(np.degrees(sigma[3:].max())), 2),
                bad=frames.status[i] in ("rejected", "unmatched"),
            )
        )
    return table


def _points(result: Result) -> list[Row]:
    points = result.points
    return [
        Row(
            label=points.label[k],
            position=", ".join(number(x) for x in points.position_world_m[k]),
            geodetic=(
                f"{points.latitude_deg[k]:.8f}, {points.longitude_deg[k]:.8f}"
                if np.isfinite(points.latitude_deg[k])
                else "–"
            ),
            within=axes_text(points.relative.ellipse_95_m[k]),
            azimuth=f"{np.degrees(points.relative.ellipse_azimuth_rad[k]):.0f}°",
            on_earth=axes_text(points.ellipse_95_m[k]),
            frames=str(len(points.frames[k])),
        )
        for k in range(len(points.label))
    ]


def _shared(result: Result) -> list[tuple[str, str]]:
    """What all frames have in common, in words."""
    shared = result.shared
    entries = (
        ("camera clock minus UTC [s]", shared.clock_offset_s),
        ("position of the log minus truth: east, north, up [m]", shared.position_bias_m),
        ("heading of the log minus truth [°]", shared.heading_bias_deg),
        ("camera against its mount: rotation vector [°]", shared.boresight_deg),
        ("autopilot to camera, in the vehicle's axes [m]", shared.lever_arm_m),
        ("height of the ground plane [m]", shared.plane_height_m),
        ("slope of the ground to the east, to the north [°]", shared.plane_slope_deg),
    )
    return [
        (
            name,
            ", ".join(
                f"{number(value)} ± {number(sigma)}"
                for value, sigma in zip(estimate.value, estimate.sigma, strict=True)
            ),
        )
        for name, estimate in entries
        if estimate is not None
    ] + _camera(learnt_camera(result.camera, shared.intrinsics))


def _camera(camera: LearntCamera) -> list[tuple[str, str]]:
    """What the survey says of the camera: a row for each parameter that it refined."""
    rows = [
        (
            f"camera: {camera.names[i]} before, and with the survey",
            f"{camera.prior_value[i]:.6g} ± {camera.prior_sigma[i]:.2g}, "
            f"{camera.value[i]:.6g} ± {camera.sigma[i]:.2g}",
        )
        for i in np.flatnonzero(camera.learnt)
    ]
    rest = [name for name, learnt in zip(camera.names, camera.learnt, strict=True) if not learnt]
    return [*rows, ("camera: as calibrated, nothing learnt of", " ".join(rest))] if rest else rows
