"""Rotations, and positions and rotations between the samples of a log."""
