"""results.json and calibration.json: every number of a result, both directions."""
