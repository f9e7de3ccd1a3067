"""A flight log to look at: text, JSON, plot."""
