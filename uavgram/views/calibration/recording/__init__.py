"""The review of a calibration in Rerun."""
