"""How every page of HTML is made: self-contained, what people wrote escaped."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined


def page_environment() -> Environment:
    """Jinja over this package's templates; an unknown name in one is an error."""
    return Environment(
        loader=PackageLoader("uavgram.views"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
