"""Launcher of the Rerun viewer with a recording, on the desktop or in a browser."""
