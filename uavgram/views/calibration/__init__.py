"""Views of a calibration: report, text, drawings, recording."""
