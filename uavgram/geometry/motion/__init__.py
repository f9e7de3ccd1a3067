"""Rotations, and position and attitude of a vehicle between the samples of its log."""
