"""How every page is made from a template: self-contained HTML, and Markdown for the recording."""

from __future__ import annotations

from functools import cache
from typing import Any

from jinja2 import (
    Environment,
    PackageLoader,
    StrictUndefined,
    pass_context,
    select_autoescape,
)
from jinja2.runtime import Context

from uavgram.model.naming import METRIC
from uavgram.model.result.result import Result
from uavgram.views import wording
from uavgram.views.compiled_templates import CompiledTemplates
from uavgram.views.markdown import MOST_ROWS, plain
from uavgram.views.unit_words import exact_lengths, in_units, names_like_lengths
from uavgram.views.units import column, units_of

WORDS = (
    wording.number,
    wording.chance,
    wording.plus_minus,
    wording.each_plus_minus,
    wording.parameter_text,
    wording.axes_text,
    wording.size_text,
    wording.utc,
    plain,
)
"""What templates call by name, as filters: numbers and texts as everywhere else."""


def units_shown(result: Result) -> dict[str, object]:
    """What a template of a survey must be given: the units in which it is shown.

    Tables have the `length_unit` in their heads, and numbers by the filter `in_length_unit`. What
    says its unit itself, such as ``1.40 m``, is converted when it is written: see `_told`.
    """
    units = units_of(result)
    return {
        "units": units,
        "length_unit": column(units).symbol,
        "kept_names": names_like_lengths(result),
        "exact_lengths": exact_lengths(result),
    }


@pass_context
def in_length_unit(context: Context, length_m: Any) -> Any:  # noqa: ANN401 (a number or an array)
    """A length, or an array of them, in the unit of the tables' heads."""
    return length_m * column(context.get("units", METRIC)).factor


_PICTURE = "data:image/"


@pass_context
def _told(context: Context, value: object) -> object:
    """What a template writes: of sentences the lengths in the units of the survey."""
    if not isinstance(value, str) or _PICTURE in value:  # long; what is said in it is told already
        return value
    if " " not in value and "\u00a0" not in value:  # most of what is written: it states no unit
        return value
    kept, exact = context.get("kept_names", ()), context.get("exact_lengths", ())
    text = in_units(value, context.get("units", METRIC), kept, exact)
    return value if text is value else type(value)(text)


def page(template: str, **facts: Any) -> str:  # noqa: ANN401 (whatever a template shows)
    """Fill in a template: a page that loads nothing from elsewhere.

    Parameters
    ----------
    template
        Its file below ``views/templates``.
    **facts
        What it names.
    """
    return page_environment().get_template(template).render(facts)


@cache
def page_environment() -> Environment:
    """Jinja over this package's templates; an unknown name in one is an error.

    What people wrote is escaped: in HTML always, in Markdown where a template says `plain`.
    """
    environment = Environment(
        loader=PackageLoader("uavgram.views"),
        autoescape=select_autoescape(disabled_extensions=("md",), default=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_told,
        # what is kept compiled must not hold what a filter made of a constant
        optimized=False,
        bytecode_cache=CompiledTemplates(),
    )
    environment.filters.update({word.__name__: word for word in WORDS})
    environment.filters["in_length_unit"] = in_length_unit
    environment.globals.update(zip=zip, most_rows=MOST_ROWS)
    return environment
