"""The recording's curves over the photos: residuals, tests, poses, states."""
