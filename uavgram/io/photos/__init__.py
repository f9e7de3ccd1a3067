"""Photos as files: which there are, their sizes, times and tags; pixels of boards alone."""
