"""Data of a flight: log, photos, poses."""
