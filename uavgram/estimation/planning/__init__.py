"""Observations that could be made: what each would tell, and which few tell most."""
