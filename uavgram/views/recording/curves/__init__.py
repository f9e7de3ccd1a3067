"""Curves over the frames."""
