"""Tie points between photos: features and their matches."""
