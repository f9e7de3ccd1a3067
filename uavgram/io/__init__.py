"""Files to model types and back, one file per format; computes nothing."""
