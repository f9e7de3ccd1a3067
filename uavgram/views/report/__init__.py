"""report.html for readers, report-annex.html for specialists: self-contained, also on paper."""

from uavgram.views.report.first_page import ground_extent
from uavgram.views.report.page import (
    annex_of,
    check_pdf,
    render_annex,
    render_report,
    report_pdf,
    write_report,
)

__all__ = [
    "annex_of",
    "check_pdf",
    "ground_extent",
    "render_annex",
    "render_report",
    "report_pdf",
    "write_report",
]
