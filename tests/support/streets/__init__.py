"""A renderer of streets with known truth: photos as a drone takes them, from a seed."""
