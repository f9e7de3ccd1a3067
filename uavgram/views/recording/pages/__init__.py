"""Pages of text in the recording."""
