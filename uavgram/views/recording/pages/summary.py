"""The page that is read first."""

from __future__ import annotations

from uavgram.model.result.result import Result
from uavgram.views.markdown import plain, table
from uavgram.views.recording.pages.tables import measured_table
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.world.survey import has_outlines
from uavgram.views.survey.key_facts import key_facts
from uavgram.views.survey.verdict import Verdict
from uavgram.views.wording import WHY_TWO_ELLIPSES, place

# As many as are seen without scrolling; the page of measurements has them all.
MOST_MEASURED = 8


def summary(result: Result, verdict: Verdict, scene: Scene) -> str:
    """Is it good, what is wrong, and what was measured."""
    headline = f"✔ {verdict.sentence}" if verdict.level == "good" else "⚠ Look at this first"
    reasons = "\n".join(f"- {plain(reason)}" for reason in verdict.reasons)
    facts = [(question, f"**{plain(answer)}**") for question, answer in key_facts(result)]
    parts = [
        f"# {headline}",
        *([reasons] if reasons else []),
        table(("at a glance", ""), facts),
        plain(verdict.counts),
        "## Measured, the least certain for their size first; ± is one sigma",
        measured_table(result, MOST_MEASURED),
        "## Pictures",
        _pictures(result, scene),
        plain(place(result)),
    ]
    return "\n\n".join(parts)


def _pictures(result: Result, scene: Scene) -> str:
    lowered = (
        f" The ground is drawn {scene.ground_drop_m:.2f} m too low, so that the points of lower "
        "areas are seen."
        if scene.ground_is_lowered
        else ""
    )
    drawn = (
        f"drawn ×{scene.ellipse_factor}"
        if has_outlines(result)
        else "too many to be drawn: points have their colours"
    )
    return (
        f"Ellipses hold 95 % and are those within the survey, {drawn}. "
        f"{WHY_TWO_ELLIPSES} Residuals in the photo are drawn ×{scene.residual_factor}; its grey "
        f"borders are those of the photos before and after.{lowered}{_planes(result)}"
    )


def _planes(result: Result) -> str:
    """Of several areas of the ground, whose plane the picture of it lies on."""
    first, others = result.areas[:1], result.areas[1:]
    if not others:
        return ""
    names = plain(", ".join(repr(area.name) for area in others))
    return (
        f" The photos on the ground lie on the plane of the area {plain(repr(first[0].name))}: "
        f"what lies on {names} is seen beside its place there; points and lines are right."
    )
