"""Poses of frames from tie points alone: nothing is known but the camera."""
