"""The adjustment repeated while somebody picks, and where other photos show a point."""
