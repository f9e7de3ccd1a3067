"""The recording's view of one photo, and what is drawn on it."""
