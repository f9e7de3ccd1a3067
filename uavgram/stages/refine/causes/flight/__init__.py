"""What could be wrong with the log of a flight, and with the camera file."""
