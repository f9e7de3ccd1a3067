"""Studies: their figures, what they say in words, and the page of both."""
