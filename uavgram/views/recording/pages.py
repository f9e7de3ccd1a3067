"""Text pages of the recording, each from its template."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from functools import partial

import numpy as np

from uavgram.model.naming import format_count
from uavgram.model.result.result import Result
from uavgram.views import formatting
from uavgram.views.pages import make_unit_variables, page_environment
from uavgram.views.recording.curves import FrameCurves, PoseCurves
from uavgram.views.recording.photo import FramePicks
from uavgram.views.recording.points import has_outlines
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.result_tables import Source, result_table
from uavgram.views.survey.fit import fit_tables
from uavgram.views.survey.heights import OffGround, height_of
from uavgram.views.survey.key_facts import (
    frame_origins,
    has_automatic_picks,
    key_facts,
    picks_text,
    ties_text,
)
from uavgram.views.survey.reliability import (
    overall_words,
    prior_table,
    removal_rows,
    second_order_rows,
    weakest_table,
)
from uavgram.views.survey.verdict import VerdictWords, summarise_result, verdict_words
from uavgram.views.tables import Cell, make_table
from uavgram.views.units import table_unit, units_of

LEVEL_MARKS = {"green": "✔", "amber": "⚠", "red": "⚠", None: "-"}
"""Mark before the headline, by level of the verdict.

The viewer's font has few signs, and a text ends at a sign that it does not have.
"""


def _page(name: str, result: Result, **shown: object) -> str:
    """Render one page from its template, with the variables that several of them use."""
    template = page_environment().get_template(f"recording/{name}.md")
    text = template.render(
        result=result,
        table=partial(result_table, result=result),
        **make_unit_variables(result),
        not_unique=formatting.NOT_UNIQUE,
        why_to_neighbours=formatting.WHY_TO_NEIGHBOURS,
        why_two_ellipses=formatting.WHY_TWO_ELLIPSES,
        measured=formatting.order_computed_first(result.measurements),
        **shown,
    )
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n")


def summary(result: Result, verdict: VerdictWords, scene: Scene) -> str:
    """Render the summary: verdict, problems, and measurements.

    Parameters
    ----------
    result
        Result of a run.
    verdict
        Verdict on the result.
    scene
        Extent of the scene, from which drawings are scaled.
    """
    return _page(
        "summary",
        result,
        verdict=verdict,
        headline=summarise_result(result),
        mark=LEVEL_MARKS[verdict.level],
        scene=scene,
        facts=key_facts(result),
        has_outlines=has_outlines(result),
        place=formatting.describe_origin(result),
        quoted=repr,
        found_any=has_automatic_picks(result),
        picks_made=picks_text(result),
        ties=ties_text(result),
    )


def measured_page(result: Result) -> str:
    """Render all measurements, with the effect of undetected errors on each."""
    weakest, second_order = weakest_table(result), second_order_rows(result)
    return _page("measured", result, weakest=weakest, second_order=second_order)


def lengths_page(result: Result) -> str:
    """Render the known lengths, the worst fit first, with the errors that the tests can detect."""
    return _page("lengths", result, lengths=formatting.order_worst_fit_first(result.lines.w))


def checks_page(result: Result) -> str:
    """Render the evidence for and against the result."""
    return _page(
        "checks",
        result,
        overall=overall_words(result),
        removals=removal_rows(result),
        priors=prior_table(result),
        **fit_tables(result),
    )


def points_page(result: Result) -> str:
    """Render the ground points, the least certain relative to their neighbours first."""
    within, rated = result.points.relative, result.points.neighbour_sigma_m
    known = np.isfinite(rated).any()  # a single point has no neighbours
    order = np.argsort(-(rated if known else within.ellipse_95_m[:, 0]), kind="stable")
    return _page("points", result, points_order=order)


def heights_page(result: Result, standing: OffGround) -> str:
    """Render the heights of points off the ground, the least certain first.

    Parameters
    ----------
    result
        Result of a run.
    standing
        Its points off the ground.
    """
    points, source = result.points, Source(result)
    rows = (
        (
            points.label[row := int(standing.rows[i])],
            Cell(height_of(points, row), look="value"),
            formatting.axes_text(standing.half_axes_m[i], source.units),
            source.length(points.position_world_m[row, 2]),
            str(len(points.frames[row])),
        )
        for i in np.argsort(-points.height_sigma_m[standing.rows], kind="stable").tolist()
    )
    titles = "label | above the ground | 95 % half axes within the survey | up [m] | photos"
    return _page("heights", result, heights=make_table(titles, rows, source.units))


def messages_page(result: Result) -> str:
    """Render the messages of the run, the worst first."""
    ordered = sorted(result.messages, key=lambda message: formatting.LEVEL_RANK[message.level])
    return _page("messages", result, messages=ordered)


def messages_title(result: Result) -> str:
    """Return the title of the messages: ``Messages: 1 error, 2 warnings``."""
    counts = Counter(message.level for message in result.messages)
    loud = [format_count(counts[level], level) for level in ("error", "warning") if counts[level]]
    return "Messages" + (f": {', '.join(loud)}" if loud else "")


def frame_sheets(
    result: Result, picks: FramePicks, curves: FrameCurves, poses: PoseCurves
) -> Iterator[str]:
    """Yield the text sheet of each frame, in their order.

    Parameters
    ----------
    result
        Result of a run.
    picks
        Picks of each frame.
    curves, poses
        Residuals and corrections of every frame.
    """
    template = page_environment().get_template("recording/frame.md")
    frames = result.frames
    sigma = np.sqrt(np.diagonal(frames.refined.covariance, axis1=1, axis2=2))[:, :3]
    center, unit = frames.refined.center_world_m, table_unit(units_of(result))
    moved = np.linalg.norm(frames.refined.center_world_m - frames.seed.center_world_m, axis=1)
    w = np.nan_to_num(np.abs(result.picks.w))
    made, shown = frame_origins(result), make_unit_variables(result)
    for i, rows in enumerate(picks.rows):
        sheet = template.render(
            **shown,
            result=result,
            frames=frames,
            frame_words=formatting.FRAME_STATUS_WORDS,
            i=i,
            picks=rows,
            made=made,
            curves=curves,
            poses=poses,
            unit=unit,
            place=formatting.each_plus_minus(unit.factor * center[i], unit.factor * sigma[i], 2),
            moved_m=moved[i],
            worst_label=result.picks.label[rows[np.argmax(w[rows])]] if len(rows) else "",
        )
        yield sheet.rstrip("\n")


SUMMARY = "documents/summary"
FRAME_SHEET = "documents/frame"
MEASURED = "documents/measurements"
LENGTHS = "documents/known_lengths"
CHECKS = "documents/checks"
POINTS = "documents/points"
HEIGHTS = "documents/heights"
MESSAGES = "documents/messages"


def log_documents(
    recorder: Recorder,
    result: Result,
    scene: Scene,
    picks: FramePicks,
    curves: FrameCurves,
    poses: PoseCurves,
) -> None:
    """Log all pages.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    picks
        Picks of each frame.
    curves, poses
        Residuals and corrections of every frame.
    """
    for path, text in (
        (SUMMARY, summary(result, verdict_words(result), scene)),
        (MEASURED, measured_page(result)),
        (LENGTHS, lengths_page(result)),
        (CHECKS, checks_page(result)),
        (POINTS, points_page(result)),
        (MESSAGES, messages_page(result)),
    ):
        recorder.page(path, text)
    if scene.off_ground is not None:
        recorder.page(HEIGHTS, heights_page(result, scene.off_ground))
    recorder.sheets(FRAME_SHEET, list(frame_sheets(result, picks, curves, poses)))
