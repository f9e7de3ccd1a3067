"""Report and annex on paper: from the same pages, for archives (PDF/A-3b) and for printing."""

from __future__ import annotations

import hashlib
import re
from datetime import datetime
from typing import Any

from uavgram.model.maps import Paper
from uavgram.views.pages_pdf import PAPER_SIZES, page_pdf, weasyprint_for

_NAME = "report"

_BESIDE = re.compile(r'href="([^":#]+)\.html"')
"""Link to the page beside this one, which on paper becomes a link to its PDF."""

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
    """Check that a PDF can be made here, before anything is computed.

    Raises
    ------
    UavgramError
        If WeasyPrint, or a library of the system that it needs, is missing.
    """
    weasyprint_for(_NAME)


def report_pdf(
    html: str, results: str, paper: Paper, name: str, made_utc: str, *, attach: bool = True
) -> bytes:
    """Lay out the report, or its annex, as a PDF/A-3b file.

    Fonts are embedded, colours are sRGB. Equal input gives equal bytes.

    Parameters
    ----------
    html
        The page of the report or of the annex.
    results
        The text of ``results.json``; its SHA-256 is at the foot of every page.
    paper
        Size of the paper.
    name
        Name of the project.
    made_utc
        Time of the computation, from the result.
    attach
        Whether ``results.json`` is attached.

    Raises
    ------
    UavgramError
        If WeasyPrint, or a library of the system that it needs, is missing.
    """
    digest = hashlib.sha256(results.encode()).hexdigest()
    made = datetime.fromisoformat(made_utc)
    attached = weasyprint_for(_NAME).Attachment(
        string=results,
        name="results.json",
        description="All results of the report, as numbers",
        created=made,
        modified=made,
        relationship="Data",
    )
    shown = name.translate({ord(c): " " for c in '"\\\n'})
    sheet = _SHEET.format(size=PAPER_SIZES[paper], digest=digest, name=shown)
    return page_pdf(
        _BESIDE.sub(r'href="\1.pdf"', html),
        sheet,
        _NAME,
        attachments=[attached] if attach else [],
        pdf_variant="pdf/a-3b",
        pdf_identifier=bytes.fromhex(digest)[:16],
        finisher=_finish,
    )


def _finish(_: object, pdf: Any) -> None:  # noqa: ANN401
    """Restore two rules of the archive format that WeasyPrint breaks.

    ISO 19005-3, 6.2.8: no image may ask to be interpolated; 6.8: each attachment is listed once.
    """
    for one in pdf.objects:
        image = getattr(one, "extra", {})
        if "Interpolate" in image:
            image["Interpolate"] = "false"
    if "AF" in pdf.catalog:
        pdf.catalog["AF"][:] = dict.fromkeys(pdf.catalog["AF"])
