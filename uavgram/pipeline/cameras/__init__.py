"""Cameras from a file, from the tags of photos, or from photos of a calibration board."""
