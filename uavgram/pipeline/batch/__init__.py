"""Batch of surveys: found, measured by long-lived processes, and collected in one table."""
