"""Pages on paper: PDF of self-contained HTML.

WeasyPrint lays them out. It is an extra (``uavgram[pdf]``), as it needs libraries of the system.
"""

from __future__ import annotations

import gc
import importlib
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from uavgram.errors import UavgramError
from uavgram.model.maps import Paper
from uavgram.views.page_parts import Part, take_apart
from uavgram.views.text_tables import SHEET, with_text_tables

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
    with warnings.catch_warnings(), _without_collector():
        warnings.simplefilter("ignore", ResourceWarning)  # it leaves its colour profile open
        short, parts = take_apart(with_text_tables(html))
        inside = _fetcher(weasyprint, parts)
        page: bytes = weasyprint.HTML(string=short, url_fetcher=inside).write_pdf(
            stylesheets=[weasyprint.CSS(string=SHEET + sheet)], **options
        )
    return page


@contextmanager
def _without_collector() -> Iterator[None]:
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


def _fetcher(weasyprint: Any, parts: dict[str, Part]) -> Any:  # noqa: ANN401
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
            f"{name}.pdf needs WeasyPrint, which is not installed: pip install weasyprint. "
            f"Or print {name}.html from a browser."
        ) from fault
    except OSError as fault:  # it loads the libraries when it is imported
        raise UavgramError(
            f"{name}.pdf needs the library Pango of this system, which is missing: install it "
            "(Debian and Ubuntu: apt install libpango-1.0-0 libpangoft2-1.0-0; macOS: brew install "
            f"pango). Or print {name}.html from a browser. ({fault})"
        ) from fault
