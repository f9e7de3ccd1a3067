"""Review of a calibration in Rerun."""
