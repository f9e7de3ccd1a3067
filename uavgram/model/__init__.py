"""Frozen data: what flows between the stages."""
