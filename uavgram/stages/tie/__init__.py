"""Tie points: which photos to compare, and which of what was found in them is kept."""
