"""The report on paper: report.pdf from the same page, for archives (PDF/A-3b) and for printing.

WeasyPrint lays it out. It is an extra (``uavgram[pdf]``), as it needs libraries of the system.
"""

from __future__ import annotations

import hashlib
import importlib
import logging
import warnings
from datetime import datetime
from typing import Any, Literal

from uavgram.errors import UavgramError
from uavgram.views.report.parts import Part, take_apart

Paper = Literal["a4", "letter"]
"""What it is to be printed on."""

_SIZES: dict[Paper, str] = {"a4": "A4", "letter": "letter"}

_SHEET = """
@page {{
  size: {size} !important; margin: 16mm 14mm 20mm !important;
  @bottom-left {{
    content: "{name} \\B7  results.json SHA-256 {digest}";
    font: 6.5pt sans-serif; color: #5b6470; width: 85%;
  }}
  @bottom-right {{
    content: "page " counter(page) " of " counter(pages);
    font: 6.5pt sans-serif; color: #5b6470; width: 15%;
  }}
}}
.contents a::after {{ content: leader(".") target-counter(attr(href), page); }}
"""


def check_pdf() -> None:
    """See whether a PDF can be made here, before anything is computed.

    Raises
    ------
    UavgramError
        WeasyPrint, or a library of the system that it needs, is missing.
    """
    _weasyprint()


def report_pdf(html: str, results: str, paper: Paper, name: str, made_utc: str) -> bytes:
    """The report as a PDF/A-3b file, with ``results.json`` attached.

    Fonts are embedded, colours are those of sRGB. Equal input gives equal bytes.

    Parameters
    ----------
    html
        The report's page.
    results
        The text of ``results.json``; its SHA-256 stands at the foot of every page.
    paper
        Its size.
    name
        Of the project.
    made_utc
        When the result was computed, as it says.

    Raises
    ------
    UavgramError
        WeasyPrint, or a library of the system that it needs, is missing.
    """
    weasyprint = _weasyprint()
    digest = hashlib.sha256(results.encode()).hexdigest()
    made = datetime.fromisoformat(made_utc)
    attached = weasyprint.Attachment(
        string=results,
        name="results.json",
        description="Everything that the report tells, as numbers",
        created=made,
        modified=made,
        relationship="Data",
    )
    shown = name.translate({ord(c): " " for c in '"\\\n'})
    sheet = _SHEET.format(size=_SIZES[paper], digest=digest, name=shown)
    # styles of screens, which it passes over, are no news to who asked for a report
    logging.getLogger("weasyprint").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # it leaves its colour profile open
        short, parts = take_apart(html)
        inside = _fetcher(weasyprint, parts)
        page: bytes = weasyprint.HTML(string=short, url_fetcher=inside).write_pdf(
            stylesheets=[weasyprint.CSS(string=sheet)],
            attachments=[attached],
            pdf_variant="pdf/a-3b",
            pdf_identifier=bytes.fromhex(digest)[:16],
        )
    return page


def _fetcher(weasyprint: Any, parts: dict[str, Part]) -> Any:  # noqa: ANN401
    """Hand out the page's own parts: nothing is loaded from elsewhere."""

    class Inside(weasyprint.urls.URLFetcher):  # type: ignore[misc]
        def fetch(self, url: str, headers: object = None) -> Any:  # noqa: ANN401
            if url not in parts:
                return super().fetch(url, headers)
            kind, content = parts[url]
            return weasyprint.urls.URLFetcherResponse(url, content, {"Content-Type": kind})

    return Inside(allowed_protocols=())


def _weasyprint() -> Any:  # noqa: ANN401
    try:
        return importlib.import_module("weasyprint")
    except ImportError as fault:
        raise UavgramError(
            "report.pdf needs WeasyPrint, which is not installed: pip install 'uavgram[pdf]'. "
            "Or print report.html from a browser."
        ) from fault
    except OSError as fault:  # it loads them when it is imported
        raise UavgramError(
            "report.pdf needs the library Pango of this system, which is missing: install it "
            "(Debian and Ubuntu: apt install libpango-1.0-0 libpangoft2-1.0-0; macOS: brew install "
            f"pango). Or print report.html from a browser. ({fault})"
        ) from fault
