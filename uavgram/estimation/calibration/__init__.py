"""Camera calibration from photos of a board: first values, adjustment, tests, judgement."""
