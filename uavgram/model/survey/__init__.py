"""Observations by people and programs, and the survey that enters the adjustment."""
