"""Hypotheses on a whole photo: rotated, in disorder, of another place or camera."""
