"""Hypotheses on mistakes in the flight log, and in the camera file."""
