"""The camera: interior orientation, where it comes from, and what a calibration found."""
