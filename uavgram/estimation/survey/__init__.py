"""Likelihood, unknowns and adjustment of a survey."""
