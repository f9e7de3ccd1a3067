"""What many surveys together say, in words: the same on the terminal and on the page."""

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
"""Below this, honest sigmas and dishonest ones look alike."""


class Headline(NamedTuple):
    """For who has ten seconds: colour, a sentence, and what else."""

    level: VerdictLevel
    sentence: str
    reasons: list[str]


def headline(batch: Batch) -> Headline:
    """Whether all surveys are measured, whether their ± are right, which cameras are not."""
    reasons = [f"{kind_words(one)}: {pooled_words(one)}" for one in batch.pooled if _is_bad(one)]
    reasons += [
        f"camera {one.camera}: {drift_words(one)}"
        for one in batch.drifts
        if one.is_off or one.drifts
    ]
    failed, waiting = batch.count("failed"), batch.count("waiting")
    if failed:
        names = ", ".join(told_name(row) for row in batch.rows if row.status == "failed")
        reasons.insert(0, f"not measured: {names}; the table says why")
    level: VerdictLevel = "red" if failed else "amber" if reasons or waiting else "green"
    return Headline(level, counts(batch), reasons)


def counts(batch: Batch) -> str:
    """``12 surveys: 9 measured, 2 unchanged, 1 failed; 5 green, 6 amber, 0 red``."""
    parts = [f"{batch.count('done')} measured", f"{batch.count('unchanged')} unchanged"]
    parts += [f"{count} failed" for count in [batch.count("failed")] if count]
    parts += [f"{count} not begun" for count in [batch.count("waiting")] if count]
    levels = [row.level for row in batch.rows]
    lights = ", ".join(f"{levels.count(one)} {one}" for one in ("green", "amber", "red"))
    total = len(batch.rows)
    return f"{total} survey{'s' * (total != 1)}: {', '.join(parts)}; {lights}."


def _is_bad(one: PooledRatio) -> bool:
    """Of all surveys, what a reader must know; cameras and drones are in their table."""
    return one.of == "all" and (one.is_small or (one.is_large and one.kind == "checks"))


def kind_words(one: PooledRatio) -> str:
    """``withheld lengths``: of what kind the observations are."""
    return KINDS.get(one.kind, one.kind)


def pooled_words(one: PooledRatio) -> str:
    """``the stated ± are too small: errors are 1.4 times as large``."""
    if one.is_small:
        return f"the stated ± are too small: errors are {one.ratio:.2g} times as large"
    if one.is_large:
        return f"the stated ± are too large: errors are only {one.ratio:.2g} of them"
    if one.surveys < FEW_SURVEYS:
        return "nothing speaks against the stated ±, but few surveys tell"
    return "the stated ± are right"


def drift_words(one: Drift) -> str:
    """``fx drifts by 3.2 ± 0.4 a year``: calibrate again, or nothing."""
    said = []
    if one.is_off:
        said.append(
            f"{one.parameter} is off by {one.offset:+.3g} ± {one.offset_sigma:.2g} from its file"
        )
    if one.drifts:
        said.append(
            f"{one.parameter} drifts by {one.per_year:+.3g} ± {one.per_year_sigma:.2g} a year"
        )
    return " and ".join(said) + ": calibrate the camera again" if said else "as its file says"


def told_name(row: SurveyRow) -> str:
    """A survey's name, and its folder where that is another: names are often all alike."""
    path = Path(row.project)
    folder = path.parent.name if path.stem == "project" else path.stem
    return row.name if folder in {"", row.name} else f"{row.name} ({folder})"


def survey_line(row: SurveyRow) -> str:
    """One line when a survey ends: its name, and its verdict or its problem."""
    if row.status == "failed":
        return f"{told_name(row)}: failed. {row.message}"
    again = " (unchanged, not measured again)" if row.status == "unchanged" else ""
    return f"{told_name(row)}: {row.level or 'no verdict'}{again}"


def time_left(seconds: float) -> str:
    """``about 3 min left``."""
    if seconds < 60.0:
        return f"about {seconds:.0f} s left"
    if seconds < 5400.0:
        return f"about {seconds / 60.0:.0f} min left"
    return f"about {seconds / 3600.0:.1f} h left"
