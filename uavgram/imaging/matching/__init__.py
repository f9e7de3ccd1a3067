"""A point of one photo found in another: pure pixels, by least-squares matching of patches."""
