"""Stage: which picks to look for in which photos, and what of that was found agrees."""
