"""Curves of the recording over the photos: residuals, tests, poses, states."""
