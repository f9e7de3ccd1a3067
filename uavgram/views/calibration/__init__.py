"""A calibration to look at: report, text, drawings, recording."""
