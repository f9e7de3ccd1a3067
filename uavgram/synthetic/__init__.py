"""Synthetic surveys from a description of scene, flight and errors: demo, simulate, plan, study."""
