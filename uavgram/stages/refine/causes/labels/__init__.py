"""What could be wrong with picks, their labels and the heights of their points."""
