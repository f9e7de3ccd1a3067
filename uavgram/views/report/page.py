"""The page as a whole: which section shows what."""

from __future__ import annotations

import os
from pathlib import Path

from uavgram.errors import OutputError
from uavgram.model.result.result import Result
from uavgram.views.pages import page_environment
from uavgram.views.report.adjusted import (
    area_rows,
    camera_rows,
    group_rows,
    misfit_picks,
    shared_rows,
)
from uavgram.views.report.budget import budget_table
from uavgram.views.report.checks import (
    checks_summary,
    line_check_rows,
    point_check_rows,
)
from uavgram.views.report.custody import option_rows
from uavgram.views.report.known_lengths import length_rows
from uavgram.views.report.measured import (
    alternative_tables,
    measurement_rows,
    sampled_words,
    second_order_note,
)
from uavgram.views.report.method import method_facts
from uavgram.views.report.places import frame_rows, point_rows
from uavgram.views.survey.key_facts import key_facts
from uavgram.views.survey.reliability import prior_rows, removal_rows, weakest_links
from uavgram.views.survey.top_view import INK, top_view
from uavgram.views.survey.verdict import judge
from uavgram.views.wording import NOT_UNIQUE, WHY_TWO_ELLIPSES, place


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
    return (
        page_environment()
        .get_template("report.html")
        .render(
            result=result,
            verdict=judge(result),
            facts=key_facts(result),
            measurements=measurement_rows(result),
            not_unique=NOT_UNIQUE if result.measurements.is_ambiguous.any() else "",
            sampled=sampled_words(result),
            second_order=second_order_note(result),
            alternatives=alternative_tables(result),
            view=top_view(result),
            ink=INK,
            place=place(result),
            why_two_ellipses=WHY_TWO_ELLIPSES,
            budget=budget_table(result),
            lines=length_rows(result),
            removals=removal_rows(result),
            line_checks=line_check_rows(result),
            point_checks=point_check_rows(result),
            checks=checks_summary(result),
            weakest=weakest_links(result),
            groups=group_rows(result),
            misfits=misfit_picks(result),
            shared=shared_rows(result),
            areas=area_rows(result),
            camera=camera_rows(result),
            priors=prior_rows(result),
            frames=frame_rows(result),
            points=point_rows(result),
            method=method_facts(result),
            options=option_rows(result),
        )
    )
