"""Pixels: previews and rendering."""
