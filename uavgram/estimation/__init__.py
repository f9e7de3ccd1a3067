"""Least squares, first values, propagation of covariance, tests for blunders."""
