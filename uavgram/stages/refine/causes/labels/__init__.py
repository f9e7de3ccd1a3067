"""Hypotheses on picks, their labels and the heights of their points."""
