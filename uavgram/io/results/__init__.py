"""Reader and writer of results.json and calibration.json, with every number of a result."""
