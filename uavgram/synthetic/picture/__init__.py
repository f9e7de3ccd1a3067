"""The photos of the built-in scene, rendered: ground, cars, marks, plates."""
