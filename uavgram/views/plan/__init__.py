"""The plan: what was surveyed, drawn to scale on the ground as the photos show it."""
