"""Picks that were made in other programs."""
