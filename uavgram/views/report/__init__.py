"""report.html: one self-contained page, for people who have no viewer and for paper."""

from uavgram.views.report.page import render_report, write_report

__all__ = ["render_report", "write_report"]
