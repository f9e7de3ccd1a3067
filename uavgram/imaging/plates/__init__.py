"""Coded plates and uncoded targets in the field: found, and measured to hundredths of a pixel."""
