"""Hypotheses on known lengths: readings, ends, and common errors."""
