"""Photos of the built-in scene, rendered."""
