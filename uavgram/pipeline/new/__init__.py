"""A project file for a folder of photos."""
