"""What could be wrong with known lengths: readings, ends, and what all have in common."""
