"""Calibration boards in photos: found coarsely, measured to hundredths of a pixel, drawn."""
