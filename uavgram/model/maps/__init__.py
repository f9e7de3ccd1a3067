"""What maps and drawings show of a survey: layers of shapes, and rasters."""
