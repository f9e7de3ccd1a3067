"""One open project: its adjustment, its calibration, its outputs."""
