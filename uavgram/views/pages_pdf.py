"""Pages on paper: PDF of self-contained HTML.

WeasyPrint lays it out. It is an extra (``uavgram[pdf]``), as it needs libraries of the system.
"""

from __future__ import annotations

import importlib
import warnings
from typing import Any

from uavgram.errors import UavgramError
from uavgram.model.maps.plan import Paper

PAPER_SIZES: dict[Paper, str] = {"a4": "A4", "letter": "letter"}
"""As style sheets call them."""


def page_pdf(html: str, sheet: str, name: str, **options: object) -> bytes:
    """Lay a page out on paper; nothing is loaded that is not in the page itself.

    Parameters
    ----------
    html
        The page.
    sheet
        What its style sheet does not say: at least the size of the paper.
    name
        Of the file without its ending, for messages.
    **options
        Of WeasyPrint's ``write_pdf``.

    Raises
    ------
    UavgramError
        WeasyPrint, or a library of the system that it needs, is missing.
    """
    weasyprint = weasyprint_for(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # it leaves its colour profile open
        inside = weasyprint.urls.URLFetcher(allowed_protocols=("data",))
        page: bytes = weasyprint.HTML(string=html, url_fetcher=inside).write_pdf(
            stylesheets=[weasyprint.CSS(string=sheet)], **options
        )
    return page


def weasyprint_for(name: str) -> Any:  # noqa: ANN401
    """The library, to make ``name.pdf`` with.

    Raises
    ------
    UavgramError
        It, or a library of the system that it needs, is missing.
    """
    try:
        return importlib.import_module("weasyprint")
    except ImportError as fault:
        raise UavgramError(
            f"{name}.pdf needs WeasyPrint, which is not installed: pip install 'uavgram[pdf]'. "
            f"Or print {name}.html from a browser."
        ) from fault
    except OSError as fault:  # it loads them when it is imported
        raise UavgramError(
            f"{name}.pdf needs the library Pango of this system, which is missing: install it "
            "(Debian and Ubuntu: apt install libpango-1.0-0 libpangoft2-1.0-0; macOS: brew install "
            f"pango). Or print {name}.html from a browser. ({fault})"
        ) from fault
