"""Baarda's reliability: redundancy, w-tests, data snooping, effects of undetected errors."""
