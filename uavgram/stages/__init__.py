"""Stages of a run: pure functions of frozen data; none imports another."""
