"""Simulated surveys to look at."""
