"""Camera calibration from photos of a board: initial values, adjustment, tests, assessment."""
