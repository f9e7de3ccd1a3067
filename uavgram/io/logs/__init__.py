"""Readers of flight logs as FlightLog: a folder for each format, and shared code."""
