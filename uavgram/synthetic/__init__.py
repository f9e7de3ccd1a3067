"""Synthetic surveys: one description of scene, flight and errors; demo, simulate, plan, study."""
