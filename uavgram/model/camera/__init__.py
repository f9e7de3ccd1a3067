"""Camera: interior orientation, its sources, and results of a calibration."""
