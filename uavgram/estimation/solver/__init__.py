"""Levenberg-Marquardt and its normal equations; knows no photo."""
