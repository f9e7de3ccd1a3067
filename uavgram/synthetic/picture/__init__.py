"""Rendered photos of the built-in scene: ground, cars, marks, plates."""
