"""Clocks of autopilot and camera: boot clock to UTC, photos to camera events."""
