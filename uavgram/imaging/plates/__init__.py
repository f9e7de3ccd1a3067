"""Coded plates and uncoded targets that lie in the field: found, and measured to a hundredth of a pixel."""
