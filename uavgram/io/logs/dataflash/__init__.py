"""Readers of ArduPilot's DataFlash logs: formats, columns, samples, events."""
