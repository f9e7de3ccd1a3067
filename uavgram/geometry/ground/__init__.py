"""Geometry on the ground: where rays meet it, shapes on it, its top view."""
