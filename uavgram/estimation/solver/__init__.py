"""Levenberg-Marquardt and its normal equations, independent of photogrammetry."""
