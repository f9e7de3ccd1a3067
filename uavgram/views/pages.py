"""Rendering of pages from templates, compiled once: self-contained HTML, and Markdown."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Sequence
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

import jinja2
from jinja2 import (
    Environment,
    PackageLoader,
    StrictUndefined,
    pass_context,
    select_autoescape,
)
from jinja2.bccache import Bucket
from jinja2.runtime import Context

from uavgram.model.naming import METRIC
from uavgram.model.result.result import Result
from uavgram.views import formatting
from uavgram.views.sentence_units import convert_sentence, exact_lengths, list_names_like_lengths
from uavgram.views.units import table_unit, units_of

_TEMPLATES = Path(__file__).parent / "templates"


class CompiledTemplates(jinja2.FileSystemBytecodeCache):
    """Cache of Jinja's bytecode in ``__pycache__`` of this package or below Python's cache prefix.

    Compiling the templates of a report takes as long as filling them in.

    If the folder cannot be written, templates are compiled each time, as modules are. A user who
    can write there can also change the modules, so the cached templates are as trustworthy as they.
    """

    def __init__(self) -> None:
        folder = Path(cache_from_source(str(_TEMPLATES / "page.py"))).parent
        super().__init__(str(folder), f"%s.jinja-{jinja2.__version__}")

    def load_bytecode(self, bucket: Bucket) -> None:
        """Load a compiled template if the cache has it."""
        with contextlib.suppress(OSError):
            super().load_bytecode(bucket)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Store a compiled template, complete or not at all."""
        if sys.dont_write_bytecode:
            return
        with contextlib.suppress(OSError):  # such as a folder that only root can write to
            Path(self.directory).mkdir(parents=True, exist_ok=True)
            super().dump_bytecode(bucket)


# Longer tables are in the files beside the recording.
MAX_ROWS = 200


def plain(text: str) -> str:
    """Escape text written by a person so that Markdown shows it unchanged."""
    return re.sub(r"([\\`*_{}\[\]<>#|~$!])", r"\\\1", " ".join(text.split()))


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a Markdown table, with a note if rows are omitted."""
    body = ["| " + " | ".join(cells) + " |" for cells in rows[:MAX_ROWS]]
    more = len(rows) - MAX_ROWS
    note = [f"\n{more} more rows are in the report and in results.json."] if more > 0 else []
    rule = "|" + " --- |" * len(header)
    return "\n".join(["| " + " | ".join(header) + " |", rule, *body, *note])


WORDS = (
    formatting.number,
    formatting.chance,
    formatting.plus_minus,
    formatting.each_plus_minus,
    formatting.parameter_text,
    formatting.axes_text,
    formatting.size_text,
    formatting.utc,
    plain,
)
"""Filters of the templates, by their names: numbers and texts are formatted as everywhere else."""


def units_shown(result: Result) -> dict[str, object]:
    """Return the variables of a survey's template that define its units.

    Tables have the `length_unit` in their heads, and numbers by the filter `in_length_unit`. Texts
    that contain their unit, such as ``1.40 m``, are converted when they are written: see
    `_convert_lengths`.
    """
    units = units_of(result)
    return {
        "units": units,
        "length_unit": table_unit(units).symbol,
        "kept_names": list_names_like_lengths(result),
        "exact_lengths": exact_lengths(result),
    }


@pass_context
def in_length_unit(context: Context, length_m: Any) -> Any:  # noqa: ANN401 (a number or an array)
    """Convert a length, or an array of lengths, to the unit of the table heads."""
    return length_m * table_unit(context.get("units", METRIC)).factor


_PICTURE = "data:image/"


@pass_context
def _convert_lengths(context: Context, value: object) -> object:
    """Convert the lengths in a sentence of a template to the units of the survey."""
    if not isinstance(value, str) or _PICTURE in value:  # long; its texts are converted already
        return value
    if " " not in value and "\u00a0" not in value:  # most values: no unit in them
        return value
    kept, exact = context.get("kept_names", ()), context.get("exact_lengths", ())
    text = convert_sentence(value, context.get("units", METRIC), kept, exact)
    return value if text is value else type(value)(text)


def page(template: str, **facts: Any) -> str:  # noqa: ANN401 (whatever a template shows)
    """Fill in a template: a page that loads nothing from elsewhere.

    Parameters
    ----------
    template
        Its file below ``views/templates``.
    **facts
        Its variables.
    """
    return page_environment().get_template(template).render(facts)


@cache
def page_environment() -> Environment:
    """Return Jinja's environment for this package's templates; an unknown name is an error.

    Text written by people is escaped: in HTML always, in Markdown where a template uses `plain`.
    """
    environment = Environment(
        loader=PackageLoader("uavgram.views"),
        autoescape=select_autoescape(disabled_extensions=("md",), default=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_convert_lengths,
        # a cached template must not contain the result of a filter for a constant
        optimized=False,
        bytecode_cache=CompiledTemplates(),
    )
    environment.filters.update({word.__name__: word for word in WORDS})
    environment.filters["in_length_unit"] = in_length_unit
    environment.globals.update(zip=zip, most_rows=MAX_ROWS)
    return environment
