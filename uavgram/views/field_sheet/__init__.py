"""Page to take to the field: lines to lay out, flight, and expected accuracy."""
