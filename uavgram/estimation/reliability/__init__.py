"""Reliability after Baarda: redundancy, w-tests, data snooping, effects of undetected errors."""
