"""Pages of text in the recording: summary, tables, and a sheet for every frame."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import rerun as rr

from uavgram.model.result import MeasurementResults, Result
from uavgram.views.facts import key_facts
from uavgram.views.recording.frame_picks import FramePicks
from uavgram.views.recording.plots import Curves
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.verdict import Verdict
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
    utc,
    with_sigma,
)

SUMMARY = "documents/summary"
FRAME_SHEET = "documents/frame"
LINES = "documents/known_lengths"
POINTS = "documents/points"

# Longer tables belong into the files beside the recording.
MOST_ROWS = 200


def log_documents(
    recorder: Recorder,
    result: Result,
    verdict: Verdict,
    scene: Scene,
    picks: FramePicks,
    curves: Curves,
) -> None:
    """Log all pages."""
    for path, text in (
        (SUMMARY, summary(result, verdict, scene)),
        (LINES, lines_page(result)),
        (POINTS, points_page(result)),
    ):
        recorder.static(path, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
    sheets = [frame_sheet(result, picks, curves, i) for i in range(len(result.frames.frame_id))]
    recorder.static(FRAME_SHEET, rr.TextDocument.from_fields(media_type=rr.MediaType.MARKDOWN))
    recorder.rows(
        FRAME_SHEET,
        np.arange(len(sheets)),
        lambda some: [rr.TextDocument.columns(text=[sheets[i] for i in some])],
    )


def plain(text: str) -> str:
    """Text that a person wrote, so that Markdown shows it as it is."""
    return re.sub(r"([\\`*_{}\[\]<>#|~$!])", r"\\\1", " ".join(text.split()))


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; a note where rows were left out."""
    body = ["| " + " | ".join(cells) + " |" for cells in rows[:MOST_ROWS]]
    more = len(rows) - MOST_ROWS
    note = [f"\n{more} more rows are in the report and in results.json."] if more > 0 else []
    rule = "|" + " --- |" * len(header)
    return "\n".join(["| " + " | ".join(header) + " |", rule, *body, *note])


def summary(result: Result, verdict: Verdict, scene: Scene) -> str:
    """The page that is read first."""
    headline = f"✔ {verdict.sentence}" if verdict.level == "good" else "⚠ Look at this first"
    reasons = "\n".join(f"- {plain(reason)}" for reason in verdict.reasons)
    parts = [
        f"# {headline}",
        *([reasons] if reasons else []),
        _facts(result),
        plain(verdict.counts),
        "## Measured",
        _measurements(result),
        "## Known lengths",
        _lines(result),
        "## How it fits",
        _fit(result),
    ]
    if result.line_checks.name or result.point_checks.label:
        parts += ["## Checks", _checks(result)]
    if result.messages:
        parts += ["## Messages", _messages(result)]
    parts += ["## Pictures", _pictures(scene), plain(place(result))]
    return "\n\n".join(parts)


def _facts(result: Result) -> str:
    facts = key_facts(result)
    rows = [(question, f"**{plain(answer)}**") for question, answer in facts]
    return table(("at a glance", ""), rows)


def _measurements(result: Result) -> str:
    rows = result.measurements
    if not rows.name:
        return "Nothing was asked for."
    return table(
        ("name", "value ± 1 σ", "95 % interval", "kind"),
        [
            (
                plain(rows.name[i]),
                f"**{with_sigma(float(rows.value[i]), float(rows.sigma[i]), rows.unit[i])}**",
                _interval(rows, int(i)),
                KIND_WORDS.get(rows.kind[i], rows.kind[i]),
            )
            for i in computed_first(rows)
        ],
    )


def _interval(rows: MeasurementResults, row: int) -> str:
    low, high = map(float, rows.interval_95[row])
    return interval(low, high, float(rows.sigma[row]), rows.unit[row])


def _lines(result: Result) -> str:
    lines = result.lines
    if not lines.name:
        return "None were given."
    order = np.argsort(-np.nan_to_num(np.abs(lines.w), nan=-1.0), kind="stable")
    return table(
        ("name", "taped [m]", "found [m]", "difference [m]", "w", "status"),
        [
            (
                plain(lines.name[i]),
                f"{number(lines.length_m[i])} ± {number(lines.sigma_m[i])}",
                f"{number(lines.adjusted_m[i])} ± {number(lines.adjusted_sigma_m[i])}",
                number(lines.residual_m[i], signed=True),
                number(lines.w[i], 1, signed=True),
                _loud(lines.status[i]),
            )
            for i in order
        ],
    )


def _loud(status: str) -> str:
    words = LINE_STATUS_WORDS.get(status, status)
    return f"**{words}**" if status in ("suspect", "removed") else words


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


def _checks(result: Result) -> str:
    lines, points = result.line_checks, result.point_checks
    rows = [
        (
            plain(name),
            f"{number(error, signed=True)} ± {number(sigma)}",
            number(z, 1, signed=True),
            "inside" if abs(z) <= 3 else "**OUTSIDE**",
        )
        for name, error, sigma, z in zip(
            lines.name, lines.error_m, lines.sigma_m, lines.z, strict=True
        )
    ]
    for label, error, sigma in zip(points.label, points.error_m, points.sigma_m, strict=True):
        z = float(np.abs(error / sigma).max())
        words = ", ".join(number(e, signed=True) for e in error)
        rows.append((plain(label), words, number(z, 1), "inside" if z <= 3 else "**OUTSIDE**"))
    return table(("withheld", "found minus known [m]", "largest z", "three sigma"), rows)


def _messages(result: Result) -> str:
    return "\n".join(
        f"- **{message.level}** {plain(message.text)}"
        for message in sorted(
            result.messages, key=lambda m: ("error", "warning", "info").index(m.level)
        )
    )


def _pictures(scene: Scene) -> str:
    return (
        f"Ellipses hold 95 % and are those within the survey, drawn ×{scene.ellipse_factor}. "
        f"{WHY_TWO_ELLIPSES} Residuals in the photo are drawn ×{scene.residual_factor}."
    )


def lines_page(result: Result) -> str:
    """Known lengths with what the tests can see."""
    lines = result.lines
    rows = [
        (
            plain(lines.name[i]),
            f"{plain(lines.start[i])} – {plain(lines.end[i])}",
            number(lines.length_m[i]),
            number(lines.adjusted_m[i]),
            number(lines.residual_m[i], signed=True),
            number(lines.w[i], 2, signed=True),
            number(lines.redundancy[i], 2),
            number(lines.mdb_m[i]),
            _loud(lines.status[i]),
        )
        for i in range(len(lines.name))
    ]
    header = (
        *("name", "ends", "taped [m]", "found [m]", "difference [m]", "w", "redundancy"),
        *("smallest error that would show [m]", "status"),
    )
    return "# Known lengths\n\n" + (table(header, rows) if rows else "None were given.")


def points_page(result: Result) -> str:
    """Ground points, the least certain within the survey first."""
    points = result.points
    rows = [
        (
            plain(points.label[k]),
            *(number(x) for x in points.position_world_m[k]),
            f"**{axes_text(points.relative.ellipse_95_m[k])}**",
            f"{np.degrees(points.relative.ellipse_azimuth_rad[k]):.0f}°",
            axes_text(points.ellipse_95_m[k]),
            str(len(points.frames[k])),
        )
        for k in np.argsort(-points.relative.ellipse_95_m[:, 0], kind="stable")[: MOST_ROWS + 1]
    ]
    header = (
        "label",
        "east [m]",
        "north [m]",
        "up [m]",
        "95 % half axes within the survey",
        "azimuth",
        "on the earth",
        "frames",
    )
    shown = f"{WHY_TWO_ELLIPSES}\n\n{table(header, rows)}" if rows else "No point was picked."
    return f"# Points\n\n{shown}"


def frame_sheet(result: Result, picks: FramePicks, curves: Curves, frame: int) -> str:
    """What there is to know of one frame."""
    frames, rows = result.frames, picks.rows[frame]
    status = FRAME_STATUS_WORDS[frames.status[frame]]
    lines = [
        f"# {plain(frames.frame_id[frame])}: {status}",
        plain(frames.reason[frame]),
        f"- exposure (UTC): {utc(float(frames.time_utc_s[frame]))}",
        f"- picks: {len(rows)}",
    ]
    if np.isfinite(curves.refined_rms_px[frame]):
        lines.append(f"- residuals: {curves.refined_rms_px[frame]:.2f} px refined")
    if np.isfinite(curves.seed_rms_px[frame]):
        lines.append(f"- residuals: {curves.seed_rms_px[frame]:.1f} px from the flight log alone")
    if result.has_refined[frame]:
        center = frames.refined.center_world_m[frame]
        sigma = np.sqrt(np.diagonal(frames.refined.covariance[frame]))
        position = ", ".join(f"{c:.2f} ± {s:.2f}" for c, s in zip(center, sigma[:3], strict=True))
        lines.append(f"- position east, north, up [m]: {position}")
        lines.append(f"- attitude sigma [°]: {np.degrees(sigma[3:].max()):.2f}")
        if result.has_seed[frame]:
            moved = np.linalg.norm(center - frames.seed.center_world_m[frame])
            lines.append(f"- moved by {moved:.2f} m from where the flight log has it")
    w = np.nan_to_num(np.abs(result.picks.w[rows]))
    if len(rows) and w.max() > 0:
        worst = rows[int(np.argmax(w))]
        lines.append(f"- worst pick: {plain(result.picks.label[worst])} (w = {w.max():.1f})")
    return "\n\n".join(line for line in lines[:2] if line) + "\n\n" + "\n".join(lines[2:])
