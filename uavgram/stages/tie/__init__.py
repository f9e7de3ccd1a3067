"""Stage: choose pairs of photos for tie points, and the tie points to keep."""
