"""Cameras from files, from photos, and from photos of a board."""
