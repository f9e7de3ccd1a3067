"""Coded plates in the field: detection, and measurement to hundredths of a pixel."""
