"""First values of adjustments, and the way from them to the minimum."""
