"""Measured values of the adjusted survey, their covariance and their error budget."""
