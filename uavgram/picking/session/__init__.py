"""One open project: adjusted in the background, calibrated, run, and saved."""
