"""Tie points: found in the photos, and put into the project's table."""
