"""Views of a flight log: text, JSON, plot."""
