"""report.html: one self-contained page, for people who have no viewer and for paper."""

from uavgram.views.report.ground import shown_ground
from uavgram.views.report.page import render_report, write_report
from uavgram.views.report.pdf import check_pdf, report_pdf

__all__ = ["check_pdf", "render_report", "report_pdf", "shown_ground", "write_report"]
