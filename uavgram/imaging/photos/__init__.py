"""Photos for display: reduced, cut into tiles, cached."""
