"""Least squares, initial values, propagation of covariance, tests for blunders."""
