"""Results of a batch of surveys in words, the same on the terminal and on the page."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from uavgram.model.batch import Batch, Drift, PooledRatio, SurveyRow
from uavgram.model.result.verdict import VerdictLevel

KINDS = {
    "checks": "withheld lengths and check points",
    "pixels": "picks",
    "lengths": "known lengths",
    "telemetry": "the flight log",
}
FEW_SURVEYS = 3
"""Number of surveys below which correct and wrong sigmas cannot be distinguished."""


class Headline(NamedTuple):
    """Summary of a batch: colour, sentence and reasons."""

    level: VerdictLevel
    sentence: str
    reasons: list[str]


def headline(batch: Batch) -> Headline:
    """Summarise a batch: surveys not measured, stated sigmas that are wrong, cameras that drift."""
    reasons = [f"{kind_words(one)}: {pooled_words(one)}" for one in batch.pooled if _is_bad(one)]
    reasons += [
        f"camera {one.camera}: {drift_words(one)}"
        for one in batch.drifts
        if one.is_off or one.drifts
    ]
    failed, waiting = batch.count("failed"), batch.count("waiting")
    if failed:
        names = ", ".join(display_name(row) for row in batch.rows if row.status == "failed")
        reasons.insert(0, f"not measured: {names}; the table gives the reasons")
    level: VerdictLevel = "red" if failed else "amber" if reasons or waiting else "green"
    return Headline(level, counts(batch), reasons)


def counts(batch: Batch) -> str:
    """Count the surveys: ``12 surveys: 9 measured, 2 unchanged, 1 failed; 5 green, 6 amber...``."""
    parts = [f"{batch.count('done')} measured", f"{batch.count('unchanged')} unchanged"]
    parts += [f"{count} failed" for count in [batch.count("failed")] if count]
    parts += [f"{count} not begun" for count in [batch.count("waiting")] if count]
    levels = [row.level for row in batch.rows]
    lights = ", ".join(f"{levels.count(one)} {one}" for one in ("green", "amber", "red"))
    total = len(batch.rows)
    return f"{total} survey{'s' * (total != 1)}: {', '.join(parts)}; {lights}."


def _is_bad(one: PooledRatio) -> bool:
    """Return whether pooled statistics of all surveys belong into the summary.

    Those of single cameras and drones are in their table.
    """
    return one.of == "all" and (one.is_small or (one.is_large and one.kind == "checks"))


def kind_words(one: PooledRatio) -> str:
    """Return the words for the kind of the observations, such as ``withheld lengths``."""
    return KINDS.get(one.kind, one.kind)


def pooled_words(one: PooledRatio) -> str:
    """Judge the stated sigmas: ``the stated ± are too small: errors are 1.4 times as large``."""
    if one.is_small:
        return f"the stated ± are too small: errors are {one.ratio:.2g} times as large"
    if one.is_large:
        return f"the stated ± are too large: errors are only {one.ratio:.2g} of them"
    if one.surveys < FEW_SURVEYS:
        return "no sign that the stated ± are wrong, but there are few surveys"
    return "the stated ± are right"


def drift_words(one: Drift) -> str:
    """Describe a camera's drift (``fx drifts by 3.2 ± 0.4 a year``) and whether to recalibrate."""
    said = []
    if one.is_off:
        said.append(
            f"{one.parameter} is off by {one.offset:+.3g} ± {one.offset_sigma:.2g} from its file"
        )
    if one.drifts:
        said.append(
            f"{one.parameter} drifts by {one.per_year:+.3g} ± {one.per_year_sigma:.2g} a year"
        )
    return " and ".join(said) + ": calibrate the camera again" if said else "agrees with its file"


def display_name(row: SurveyRow) -> str:
    """Return a survey's name, followed by its folder if that differs: names are often all alike."""
    path = Path(row.project)
    folder = path.parent.name if path.stem == "project" else path.stem
    return row.name if folder in {"", row.name} else f"{row.name} ({folder})"


def survey_line(row: SurveyRow) -> str:
    """Return the line for a survey that has ended: its name, and its verdict or its problem."""
    if row.status == "failed":
        return f"{display_name(row)}: failed. {row.message}"
    again = " (unchanged, not measured again)" if row.status == "unchanged" else ""
    return f"{display_name(row)}: {row.level or 'no verdict'}{again}"


def time_left(seconds: float) -> str:
    """Format the remaining time: ``about 3 min left``."""
    if seconds < 60.0:
        return f"about {seconds:.0f} s left"
    if seconds < 5400.0:
        return f"about {seconds / 60.0:.0f} min left"
    return f"about {seconds / 3600.0:.1f} h left"
