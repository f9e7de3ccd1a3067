"""Checks of the rows of a log, independent of its format."""
