"""The photos of the built-in survey, rendered: road, marks, vehicles."""
