"""Boards and targets in photos: detection, measurement to hundredths of a pixel, drawing."""
