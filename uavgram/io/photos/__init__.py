"""Photo files: names, sizes, times and tags; only calibration photos are decoded."""
