"""Views of studies: their figures, their results in words, and the page of both."""
