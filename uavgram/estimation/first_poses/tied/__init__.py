"""Poses of frames from tie points alone, with nothing known but the camera."""
