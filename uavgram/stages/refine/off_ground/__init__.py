"""Search for points off the ground that were not stated to be so."""
