"""Repetitions of one survey: a batch of adjustments at once, and their accuracy."""
