"""Rotations, and where a vehicle was and how it was turned between samples of its log."""
