"""Repeated adjustment during picking, and predicted places of points in other photos."""
