"""Planning before a flight: camera positions, reference lines, and expected accuracy."""
