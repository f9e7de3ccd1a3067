"""Top views of the ground from above, composed from photos."""
