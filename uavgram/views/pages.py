"""How every page is made from a template: self-contained HTML, and Markdown for the recording."""

from __future__ import annotations

from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from uavgram.views import wording
from uavgram.views.markdown import MOST_ROWS, plain

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
    )
    environment.filters.update({word.__name__: word for word in WORDS})
    environment.globals.update(zip=zip, most_rows=MOST_ROWS)
    return environment
