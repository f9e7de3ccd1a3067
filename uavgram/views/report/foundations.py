"""Basis of a result for people who did not make it: questions, answers, numbers of the method."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.estimation.reliability.redundancy import (
    TEST_POWER,
    compute_critical_value,
    compute_noncentrality,
)
from uavgram.geometry.ground.figures import ELLIPSE_95
from uavgram.model.naming import counted
from uavgram.model.provenance import InputDigest
from uavgram.model.result.result import Result
from uavgram.views.formatting import describe_origin, number
from uavgram.views.report.budget import WORDS
from uavgram.views.survey.reliability import significance_of
from uavgram.views.survey.sources import picks_text

MAX_FILES = 40
"""Number of files whose checksums are in the report; the annex has all."""


def list_foundations(result: Result) -> tuple[tuple[str, str], ...]:
    """List photos, camera, lengths, flight log, points, place and largest uncertainty.

    Returns
    -------
    Pairs of question and answer; missing items are omitted, or stated to be missing.
    """
    camera, options = result.camera, dict(result.provenance.options)
    log = options.get("log") or options.get("poses")
    sources = ", ".join(log) if isinstance(log, tuple) else str(log or "")
    facts = (
        ("Photos", _photos(result)),
        ("Camera", f"{camera.name}, {camera.width_px} x {camera.height_px} px"),
        ("Known lengths", _lengths(result)),
        ("Flight log", sources if result.has_seed.any() else "none"),
        ("Points", picks_text(result) or "all picked by people"),
        ("Place", describe_origin(result)),
        ("Largest uncertainty", _largest_source(result)),
    )
    return tuple((question, answer) for question, answer in facts if answer)


def select_files(result: Result) -> tuple[InputDigest, ...]:
    """Choose the files whose checksums the report has: photos after all others."""
    photos = {Path(path).name for path in result.frames.path}
    files = sorted(result.provenance.inputs, key=lambda one: Path(one.path).name in photos)
    return tuple(files[:MAX_FILES])


def _photos(result: Result) -> str:
    used = sum(status == "refined" for status in result.frames.status)
    return f"{used} of {counted(len(result.frames.status), 'photo')} used"


def _lengths(result: Result) -> str:
    status = result.lines.status
    if not status:
        return "none"
    used = sum(one in ("used", "suspect") for one in status)
    withheld = sum(one == "checked" for one in status)
    checks = f", {withheld} withheld as a check" if withheld else ""
    return f"{used} of {counted(len(status), 'length')} used{checks}"


def _largest_source(result: Result) -> str:
    """Name the source that is most often the largest in the error budget, and its remedy."""
    budget = result.error_budget
    if budget is None or not np.isfinite(budget.share).any():
        return ""
    known = budget.share[np.isfinite(budget.share).all(axis=1)]
    largest = np.bincount(np.argmax(known, axis=1), minlength=len(budget.source))
    row = int(np.argmax(largest))
    what, help_ = WORDS[budget.source[row]]
    return f"{what}: the largest in {largest[row]} of {counted(len(known), 'value')}. {help_}"


def method_facts(result: Result) -> dict[str, str | bool]:
    """Return the values for the section on the method, by their names in the template.

    The lens is ``brown``, ``rational`` or ``fisheye``; a log may be photo poses; the ellipse is in
    sigmas; the rest belongs to the tests of single observations.
    """
    camera, significance = result.camera, significance_of(result)
    rational = camera.model == "brown" and len(camera.parameters) > 9
    return {
        "lens": "rational" if rational else camera.model,
        "has_log": bool(result.has_seed.any()),
        "has_heights": bool(result.points.is_off_ground.any()),
        "has_skid": "skid_speed" in result.measurements.kind,
        "has_volume": "volume" in result.measurements.kind,
        "ellipse": number(ELLIPSE_95, 4),
        "significance": f"{significance:g}",
        "critical": number(compute_critical_value(significance), 2),
        "noncentrality": number(compute_noncentrality(significance), 2),
        "power": f"{100 * TEST_POWER:.0f} %",
    }
