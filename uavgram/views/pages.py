"""Pages from templates, compiled once: self-contained HTML, Markdown, and PDF of them."""

from __future__ import annotations

import base64
import contextlib
import gc
import importlib
import logging
import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any, NamedTuple

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

from uavgram.errors import UavgramError, install_command
from uavgram.model.maps import Paper
from uavgram.model.naming import METRIC
from uavgram.model.result.result import Result
from uavgram.views import formatting
from uavgram.views.tables import markdown, plain
from uavgram.views.units import (
    convert_sentence,
    exact_lengths,
    list_names_like_lengths,
    units_of,
)

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


WORDS = (
    formatting.number,
    formatting.size_text,
    formatting.utc,
    plain,
    markdown,
)
"""Filters of the templates, by their names: numbers and texts are formatted as everywhere else."""


def make_unit_variables(result: Result) -> dict[str, object]:
    """Return the variables of a survey's template by which `_convert_lengths` converts texts."""
    return {
        "units": units_of(result),
        "kept_names": list_names_like_lengths(result),
        "exact_lengths": exact_lengths(result),
    }


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
    environment.globals.update(zip=zip)
    return environment


DRAWING, PHOTO = "image/svg+xml", "image/jpeg"
SCHEME = "part"
"""Scheme of the addresses of parts."""

_DRAWING = re.compile(r"<svg\b([^>]*)>(.*?)</svg>", re.DOTALL)
_PHOTO = re.compile(r"data:image/jpeg;base64,([A-Za-z0-9+/=]+)")
_STYLE = re.compile(r"<style>.*?</style>", re.DOTALL)
_CLASS = re.compile(r'class="([^"]*)"')
_LABEL = re.compile(r'aria-label="([^"]*)"')
_SPACE = 'xmlns="http://www.w3.org/2000/svg"'


class PageFile(NamedTuple):
    """File of the page: its type and content."""

    kind: str
    content: bytes


class SplitPage(NamedTuple):
    """Page without its drawings and photos, and these parts by their addresses."""

    html: str
    parts: dict[str, PageFile]


def split_page(html: str) -> SplitPage:
    """Move each drawing and photo to a file of its own; styles of drawings then apply to images.

    A layout program styles each element of a page, including those inside drawings, and reads
    addresses letter by letter. Content in separate files avoids this cost.

    Parameters
    ----------
    html
        A page with inline drawings, and photos as data URLs.
    """
    parts: dict[str, PageFile] = {}

    def photo(found: re.Match[str]) -> str:
        return _add(parts, PHOTO, base64.b64decode(found[1]))

    def drawing(found: re.Match[str]) -> str:
        content = f"<svg {_SPACE}{found[1]}>{found[2]}</svg>".encode()
        label, looks = _LABEL.search(found[1]), _CLASS.search(found[1])
        return (
            f'<img class="{looks[1] if looks else ""}" alt="{label[1] if label else ""}" '
            f'src="{_add(parts, DRAWING, content)}">'
        )

    short = _DRAWING.sub(drawing, _PHOTO.sub(photo, html))
    styled = _STYLE.sub(lambda found: re.sub(r"\bsvg\b", "img", found[0]), short)
    return SplitPage(styled, parts)


def _add(parts: dict[str, PageFile], kind: str, content: bytes) -> str:
    address = f"{SCHEME}:{len(parts)}"
    parts[address] = PageFile(kind, content)
    return address


PAPER_SIZES: dict[Paper, str] = {"a4": "A4", "letter": "letter"}
"""Names of the paper sizes in style sheets."""


def page_pdf(html: str, sheet: str, name: str, **options: object) -> bytes:
    """Lay a page out on paper; nothing is loaded that is not in the page itself.

    Parameters
    ----------
    html
        The page.
    sheet
        Additional style sheet: at least the size of the paper.
    name
        Name of the file without its ending, for messages.
    **options
        Options of WeasyPrint's ``write_pdf``.

    Raises
    ------
    UavgramError
        If WeasyPrint, or a library of the system that it needs, is missing.
    """
    weasyprint = weasyprint_for(name)
    # WeasyPrint reports every screen style that it ignores
    logging.getLogger("weasyprint").setLevel(logging.ERROR)
    with warnings.catch_warnings(), _pause_garbage_collection():
        warnings.simplefilter("ignore", ResourceWarning)  # it leaves its colour profile open
        short, parts = split_page(html)
        inside = _fetcher(weasyprint, parts)
        source = weasyprint.HTML(string=short, url_fetcher=inside)
        styles = [weasyprint.CSS(string=sheet)]
        written: bytes = source.write_pdf(stylesheets=styles, **options)
    return written


@contextmanager
def _pause_garbage_collection() -> Iterator[None]:
    """Disable the garbage collector during a layout, which keeps nearly all its objects.

    The collector would take a tenth of the time.
    """
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def _fetcher(weasyprint: Any, parts: dict[str, PageFile]) -> Any:  # noqa: ANN401
    """Make a fetcher that returns the page's own parts and loads nothing from elsewhere."""

    class Inside(weasyprint.urls.URLFetcher):  # type: ignore[misc]
        def fetch(self, url: str, headers: object = None) -> Any:  # noqa: ANN401
            if url not in parts:
                return super().fetch(url, headers)
            kind, content = parts[url]
            return weasyprint.urls.URLFetcherResponse(url, content, {"Content-Type": kind})

    return Inside(allowed_protocols=())


def weasyprint_for(name: str) -> Any:  # noqa: ANN401
    """Import WeasyPrint, to make ``name.pdf`` with it.

    Raises
    ------
    UavgramError
        If it, or a library of the system that it needs, is missing.
    """
    try:
        return importlib.import_module("weasyprint")
    except ImportError as fault:
        raise UavgramError(
            f"{name}.pdf needs WeasyPrint, which is not installed: "
            f"{install_command('weasyprint')}. Or print {name}.html from a browser."
        ) from fault
    except OSError as fault:  # it loads the libraries when it is imported
        raise UavgramError(
            f"{name}.pdf needs the library Pango of this system, which is missing: install it "
            "(Debian and Ubuntu: apt install libpango-1.0-0 libpangoft2-1.0-0; macOS: brew install "
            f"pango). Or print {name}.html from a browser. ({fault})"
        ) from fault
