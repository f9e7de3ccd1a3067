"""One photo at a time, and what is drawn on it."""
